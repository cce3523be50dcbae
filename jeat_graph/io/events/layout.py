"""Which column of a table of events is which, and in which unit its times are: by names, else by the data.

A table of events is text, a NumPy or MATLAB file, or HDF5. Nothing in such a file says more than its names,
and often there are none. What can be read in two ways is refused, and the message names the option that says
it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import ConfigError

#: Roles of columns: time, column and row of the pixel, polarity.
ROLES = ("t", "x", "y", "p")
#: Clocks of a bag's events: the camera's own, or that of the messages' headers.
SENSOR, HEADER = CLOCKS = ("sensor", "header")
#: A column that is not read, in `EventLayout.columns`.
PASSED_OVER = "-"
#: Units of time, and how many of them a second has.
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}

_NAMES = {
    "t": ("t", "ts", "time", "times", "timestamp", "timestamps"),
    "x": ("x", "xs", "col", "column", "pos_x", "x_pos", "address_x"),
    "y": ("y", "ys", "row", "pos_y", "y_pos", "address_y"),
    "p": ("p", "ps", "pol", "pols", "polarity", "polarities", "on", "sign"),
}
_ROLE_OF = {name: role for role, names in _NAMES.items() for name in names}
_UNIT_NAMES = {
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "milliseconds"),
    "us": ("us", "usec", "µs", "μs", "microseconds"),
    "ns": ("ns", "nsec", "nanoseconds"),
}
_UNIT_OF = {name: unit for unit, names in _UNIT_NAMES.items() for name in names}
#: A time's name with a unit behind it: `timestamp_us`, `time [ns]`, `t(s)`.
_WITH_UNIT = re.compile(r"(.+?)[ _\-]*[\[(_ ] *(\w+) *[\])]?")

#: Orders of four columns without names; x stands before y in all of them.
_ORDERS = ("txyp", "xypt", "xytp", "ptxy", "tpxy", "pxyt")
_MOST_PX = 1 << 16
#: Of columns and rows so many must be places of pixels: a few may be damaged.
_MOST_PLACES = 0.99
#: Times that stand in order step back at most so often.
_MOST_STEPS_BACK = 0.05

# Events of a pixel in a second. Noise alone makes .05 to 10, a road .1 to 100; less is left after filters.
_LOW_HZ_PX, _HIGH_HZ_PX = 0.02, 500.0
#: Finely divided times are seconds down to this rate (Hz/px): hardly anything else is written so.
_LEAST_HZ_PX = 1e-5
#: With fewer events, or a smaller picture (px), a rate says nothing.
_LEAST_EVENTS, _LEAST_PIXELS = 100, 64 * 64
_THOUSAND = 1000
#: So many different times that are all thousands are so by no chance.
_LEAST_TIMES = 10
#: So many steps of a floating-point number may a decimal fraction be off.
_ROUNDINGS = 4
#: Times since 1970 lie above this (s): the year 1998. As a camera's own time that is 28 years.
_EPOCH_S = 9e8
_LAST_EPOCH_S = 2.2e9


@dataclass(frozen=True)
class EventLayout:
    """What the user says of a file of events that does not say it itself.

    Attributes:
        columns: role of each column, `t`, `x`, `y`, `p` once each, `-` for others; None leaves it to names
            and data.
        time_unit: `s`, `ms`, `us` or `ns`; None leaves it to names and data.
        stream: which recording of several in the file: the group or data set of HDF5, the topic of a bag, the
            member of a zip archive; None where there is one.
        clock: of a bag, `sensor` (as None): the camera's clock from the first message's stamp on; `header`:
            the stamps of all messages.

    Raises:
        ConfigError: a role that is missing or there twice, or a unit that is none.
    """

    columns: tuple[str, ...] | None = None
    time_unit: str | None = None
    stream: str | None = None
    clock: str | None = None

    def __post_init__(self) -> None:
        if self.columns is not None:
            roles = [name for name in self.columns if name != PASSED_OVER]
            if sorted(roles) != sorted(ROLES):
                shown = ",".join(self.columns)
                raise ConfigError(
                    f"columns of events must be t, x, y and p once each (- for others), not {shown}"
                )
        if self.time_unit is not None and self.time_unit not in PER_SECOND:
            raise ConfigError(f"the unit of time must be {', '.join(PER_SECOND)}, not {self.time_unit}")
        if self.clock is not None and self.clock not in CLOCKS:
            raise ConfigError(f"the clock of events must be {' or '.join(CLOCKS)}, not {self.clock}")


def role_of(name: str) -> tuple[str, str | None] | None:
    """Return the role of a column by its name, and the unit that the name gives a time; None if unknown."""
    plain = name.strip().strip("\"'").lower()
    if plain in _ROLE_OF:
        return _ROLE_OF[plain], None
    found = _WITH_UNIT.fullmatch(plain)
    if found and _ROLE_OF.get(found[1]) == "t" and found[2] in _UNIT_OF:
        return "t", _UNIT_OF[found[2]]
    return None


def roles_of_names(names: Sequence[str]) -> tuple[dict[str, int], str | None]:
    """Return the places of the columns whose names are known, the first of each role, and the time's unit."""
    places: dict[str, int] = {}
    unit = None
    for place, name in enumerate(names):
        found = role_of(name)
        if found is not None and found[0] not in places:
            places[found[0]] = place
            unit = found[1] if found[0] == "t" else unit
    return places, unit


def orders_of(columns: Sequence[npt.NDArray[Any]]) -> list[str]:
    """Return the orders of four columns (N,) without names that the data allow, such as `["txyp"]`.

    Polarity is the column of 0 and 1 or of -1 and 1, time the one that ascends. Of several orders,
    those go whose time could as well be a place and has fewer different values than another's.
    """
    if len(columns) != len(ROLES) or not len(columns[0]):
        return []
    allowed = [order for order in _ORDERS if _allows(order, columns)]
    times = {order: columns[order.index("t")] for order in allowed}
    certain = [order for order, t in times.items() if not _are_places(t)]
    if certain:
        return certain
    values = {order: len(np.unique(t)) for order, t in times.items()}
    return [order for order, count in values.items() if count == max(values.values())]


def _allows(order: str, columns: Sequence[npt.NDArray[Any]]) -> bool:
    by_role = dict(zip(order, columns, strict=True))
    if not is_polarity(by_role["p"]) or not (_are_places(by_role["x"]) and _are_places(by_role["y"])):
        return False
    t = by_role["t"]
    return not _are_places(t) or float(np.mean(np.diff(t) < 0) if len(t) > 1 else 0.0) <= _MOST_STEPS_BACK


def _are_places(values: npt.NDArray[Any]) -> bool:
    """Whether nearly all values may be columns or rows of a picture."""
    if values.dtype.kind not in "uif":
        return False
    good = (values >= 0) & (values < _MOST_PX)
    return float(np.mean(good & (values == np.rint(values)))) >= _MOST_PLACES


def is_polarity(values: npt.NDArray[Any]) -> bool:
    """Whether all values are 0 or 1, or all -1 or 1."""
    if values.dtype.kind == "b":
        return True
    if values.dtype.kind not in "uif":
        return False
    low = values.min() if len(values) else 0
    return bool(np.isin(values, (-1, 1) if low < 0 else (0, 1)).all())


def polarity_of_words(words: Sequence[Any]) -> npt.NDArray[np.float64] | None:
    """Return 1 and 0 for words that say brighter and darker (N,), such as `True` and `OFF`; else None."""
    known = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0, "+": 1.0, "-": 0.0}
    values = [known.get(str(word).strip().strip("\"'").lower(), np.nan) for word in words]
    found = np.asarray(values, dtype=np.float64)
    return None if np.isnan(found).any() or not is_polarity(found) else found


def unit_of(
    t: npt.NDArray[Any], x: npt.NDArray[Any], y: npt.NDArray[Any], likely: str | None = None
) -> str | None:
    """Tell the unit of times by how often the pixels fire; None where it cannot be known.

    Args:
        t: (N,) times as the file has them, in any order.
        x: (N,) columns (px).
        y: (N,) rows (px).
        likely: the unit that the layout stands for; it is taken where the data do not contradict.
    """
    whole = bool((t == np.rint(t)).all())
    usual = likely or ("us" if whole else "s")
    if len(t) < _LEAST_EVENTS:
        return usual
    since_1970 = _since_1970(float(np.median(t)), whole)
    if since_1970 is not None:
        return since_1970
    early, late = (float(q) for q in np.percentile(t, (1, 99)))
    if late <= early:
        return usual
    sides = [max(float(np.percentile(column, 99.9)), 0.0) + 1.0 for column in (x, y)]
    per_unit = 0.98 * len(t) / (late - early) / max(sides[0] * sides[1], _LEAST_PIXELS)
    hz_px = {unit: per_unit * count for unit, count in PER_SECOND.items()}
    if likely == "ns" and hz_px["ns"] <= _HIGH_HZ_PX:
        return "ns"
    return _whole_unit(t, hz_px, likely) if whole else _divided_unit(t, hz_px)


def _since_1970(median: float, whole: bool) -> str | None:
    """The unit in which a time is one since 1970; whole milliseconds are taken for microseconds."""
    units = ("us", "ns") if whole else ("s",)
    for unit in units:
        if _EPOCH_S <= median / PER_SECOND[unit] < _LAST_EPOCH_S:
            return unit
    return None


def _whole_unit(t: npt.NDArray[Any], hz_px: dict[str, float], likely: str | None) -> str | None:
    """The unit of times that are whole numbers: µs, as cameras count, or ns.

    Times that are all thousands come from a clock of µs, in ns, or from a simulator that steps by ms, in µs:
    the rate tells them apart, but for rates that either may have.
    """
    thousands = bool((np.mod(t, _THOUSAND) == 0).all())
    if thousands and len(np.unique(t)) < _LEAST_TIMES:
        return likely  # of a few ticks the rate is not known well enough
    if thousands and hz_px["us"] < _LOW_HZ_PX <= hz_px["ns"]:
        return "ns"
    if thousands and hz_px["ns"] <= _HIGH_HZ_PX:
        return likely
    return "us" if likely == "us" or _LOW_HZ_PX <= hz_px["us"] <= _HIGH_HZ_PX else None


def _divided_unit(t: npt.NDArray[Any], hz_px: dict[str, float]) -> str | None:
    """The unit of times with decimals: s; or ms, where there are three at most, as of a clock of µs."""
    thousandths = t.astype(np.float64) * _THOUSAND
    uncertain = _ROUNDINGS * _THOUSAND * np.spacing(np.abs(t)).astype(np.float64)
    if (np.abs(thousandths - np.rint(thousandths)) > uncertain).any():
        return "s" if hz_px["s"] >= _LEAST_HZ_PX else None
    if hz_px["s"] < _LOW_HZ_PX <= hz_px["ms"]:
        return "ms"
    # Of a few ticks of the clock the rate is not known well enough.
    clear = hz_px["s"] <= _HIGH_HZ_PX < hz_px["ms"] and len(np.unique(t)) >= _LEAST_TIMES
    return "s" if clear else None
