"""What `count` writes: columns of its records, on the clock that the user gives."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.eval.stations import StationRecord
from jeat_graph.io.tables.rounding import round_decimals

if TYPE_CHECKING:
    from jeat_graph.eval.passing import LineCrossing
    from jeat_graph.io.exports.datex2 import Publication
    from jeat_graph.io.exports.datex2_sites import SitePlace

#: Two letters of the country, and a name.
_PUBLISHER = re.compile(r"[A-Za-z]{2}:\S.*")
Columns = dict[str, npt.NDArray[Any]]
_CROSSINGS = "crossings.csv"
#: Times from here on (1973) are those of a clock: no recording lasts so long.
_SINCE_1970_S = 1e8
#: A recording that begins so near to `--begin` begins there (s).
_SAME_BEGIN_S = 1.0
#: Columns of times (s) and of the same times on the clock.
_CLOCKS = {"t": "time", "t_from": "begin", "t_to": "end", "t_start": "begin", "t_end": "end"}


def clock_s(begin: str | None) -> float:
    """Return the clock's time (s since 1970) of a recording's time 0; 0 where it is not declared.

    Raises:
        ConfigError: no date and time.
    """
    return 0.0 if begin is None else _date(begin).timestamp()


def later_s(begin: str | None, first_s: float, source: str) -> float:
    """Return how much later (s) the clock is than a recording's times; 0 where these are dates themselves.

    Args:
        begin: date and time of the recording's time 0, or None.
        first_s: first time of the recording.
        source: what was recorded, for messages.

    Raises:
        ConfigError: no date and time.
        DataError: the recording's own times are dates, and begin at another one.
    """
    at = clock_s(begin)
    if begin is None or first_s < _SINCE_1970_S:
        return at
    if abs(at - first_s) > _SAME_BEGIN_S:
        own = datetime.fromtimestamp(first_s, _date(begin).tzinfo).isoformat(timespec="seconds")
        raise DataError(f"has dates of its own, from {own} on: --begin {begin} contradicts them", source)
    return 0.0


def _date(begin: str) -> datetime:
    try:
        date = datetime.fromisoformat(begin)
    except ValueError:
        raise ConfigError(f"--begin {begin}: must be a date and time, say 2026-11-27T07:30:00") from None
    return date if date.tzinfo is not None else date.replace(tzinfo=UTC)


def with_clock(columns: Mapping[str, npt.NDArray[Any]], begin: str | None) -> Columns:
    """Return columns with the clock's times beside those in seconds; as they are where there is no clock."""
    if begin is None:
        return dict(columns)
    zone = _date(begin).tzinfo
    local = datetime.fromisoformat(begin).tzinfo is None
    out: Columns = {}
    for name, values in columns.items():
        out[name] = values
        if name in _CLOCKS:
            dates = [datetime.fromtimestamp(t, zone) for t in values.tolist()]
            texts = [(date.replace(tzinfo=None) if local else date).isoformat() for date in dates]
            out[_CLOCKS[name]] = np.array(texts, dtype=np.str_)
    return out


#: Decimals of columns: of times (s), of flows an hour, of shares (per cent), of speeds (km/h), of vehicles.
_DECIMALS = {
    **dict.fromkeys(("t", "t_from", "t_to", "headway_s", "expected"), 3),
    **dict.fromkeys(("flow_per_hour", "speed_kmh"), 1),
    "occupancy": 2,
    "observed": 3,
    "probability": 6,
}


def rounded(columns: Mapping[str, npt.NDArray[Any]]) -> Columns:
    """Return columns with the decimals that mean something; those that are no measures stay as they are."""
    return {
        name: round_decimals(values, _DECIMALS[name]) if name in _DECIMALS else values
        for name, values in columns.items()
    }


def station_columns(records: Sequence[StationRecord]) -> Columns:
    """Return one column an attribute, rounded, and one a class (`flow_car`)."""
    names = [one.name for one in fields(StationRecord) if one.name != "by_class"]
    columns = {name: np.array([getattr(record, name) for record in records]) for name in names}
    classes = list(records[0].by_class) if records else []
    return rounded(columns) | {
        f"flow_{kind}": np.array([one.by_class[kind] for one in records], dtype=np.int64) for kind in classes
    }


@dataclass(frozen=True)
class PublicationOptions:
    """What the user says of a publication in DATEX II.

    Attributes:
        begin: date and time of the recording's time 0, with a zone.
        publisher: country and name, `CC:NAME`.
        time: of the publication, with a zone; None: when the recording ends.
        table: identifier of the table of measurement sites.

    Raises:
        ConfigError: names the option that is missing or wrong.
    """

    begin: str | None
    publisher: str | None
    time: str | None
    table: str

    def __post_init__(self) -> None:
        if self.begin is None:
            raise ConfigError("--datex needs the date and time of the recording's time 0: --begin")
        _date(self.begin)
        if datetime.fromisoformat(self.begin).tzinfo is None:
            raise ConfigError(f"--begin {self.begin}: --datex needs a time zone, say {self.begin}+01:00")
        if self.publisher is None or not _PUBLISHER.fullmatch(self.publisher):
            raise ConfigError("--datex needs who publishes: --publisher CC:NAME, say DE:city-of-bonn")
        self.made(0.0)

    def made(self, last_s: float) -> Publication:
        """Return the publication of a recording that ends at a time of the clock (s since 1970).

        Raises:
            ConfigError: the time of the publication is none.
        """
        from jeat_graph.io.exports.datex2 import Publication

        when = datetime.fromtimestamp(last_s, _date(str(self.begin)).tzinfo)
        if self.time is not None:
            when = _zoned(self.time)
        country, _, name = str(self.publisher).partition(":")
        return Publication(when, country.upper(), name, self.table)


def _zoned(text: str) -> datetime:
    try:
        date = datetime.fromisoformat(text)
    except ValueError:
        date = datetime.min
    if date.tzinfo is None:
        raise ConfigError(
            f"--publication-time {text}: must be a date and time with a zone, say 2026-11-27T09:00:00Z"
        )
    return date


def write_publication(
    records: Sequence[StationRecord],
    last_s: float,
    publication: PublicationOptions,
    path: str | Path,
    places: Mapping[str, SitePlace] | None = None,
) -> None:
    """Write records as DATEX II.

    Args:
        records: of stations, on the clock.
        last_s: when the recording ends, on the clock (s since 1970).
        publication: what the user says of it.
        path: the file.
        places: of the stations; with them the table of sites is written beside the data (`sites_beside`).

    Raises:
        DataError: a site has no place.
    """
    from jeat_graph.io.exports.datex2 import SiteInterval, write_datex2
    from jeat_graph.io.exports.datex2_sites import write_sites

    zone = _date(str(publication.begin)).tzinfo
    intervals = [
        SiteInterval(
            "-".join(part for part in (one.station, one.direction, one.lane) if part),
            datetime.fromtimestamp(one.t_from, zone),
            datetime.fromtimestamp(one.t_to, zone),
            one.observed,
            one.flow,
            one.flow_per_hour,
            one.occupancy,
            one.headway_s,
            one.speed_kmh,
            one.by_class,
        )
        for one in records
    ]
    if places is not None:  # first, for it refuses what has no place
        write_sites(intervals, places, publication.made(last_s), sites_beside(path))
    write_datex2(intervals, publication.made(last_s), path)


def sites_beside(path: str | Path) -> Path:
    """Return where the table of sites of a file of data is written: `measured.sites.xml`."""
    return Path(path).with_suffix(".sites.xml")


def on_road(folder: Path, found: Sequence[LineCrossing]) -> tuple[list[str], list[float]]:
    """Return lane and speed (km/h) of crossings as `road` has them; empty and NaN where it has none.

    Raises:
        DataError: its `crossings.csv` cannot be read.
    """
    from jeat_graph.io.tables.file_tables import read_table

    table = read_table(folder / _CROSSINGS, ("track_id", "line", "lane", "speed_kmh"))
    keys = zip(table.whole("track_id").tolist(), table.text("line").tolist(), strict=True)
    lanes, speeds = table.text("lane", blank_ok=True), table.number("speed_kmh", blank_ok=True, nan_ok=True)
    values = zip(lanes.tolist(), speeds.tolist(), strict=True)
    known = dict(zip(keys, values, strict=True))
    rows = [known.get((c.track_id, c.line), ("", math.nan)) for c in found]
    return [lane for lane, _ in rows], [speed for _, speed in rows]
