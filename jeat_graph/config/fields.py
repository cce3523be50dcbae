"""How one setting is declared: its default, unit, meaning and bounds, all in one line of a dataclass."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from jeat_graph.data.errors import ConfigError

#: Bounds of every setting without some of its own: their fourth powers are neither 0 nor infinite.
LARGEST = 1e16
SMALLEST = 1e-12


def number(
    default: Any, unit: str, doc: str, low: float = 0.0, high: float = LARGEST, open_low: bool = False
) -> Any:
    """Declare a numeric field with unit, meaning and closed bounds (open at `low` if `open_low`)."""
    meta = {"unit": unit, "doc": doc, "low": low, "high": high, "open_low": open_low}
    return field(default=default, metadata=meta)


def choice(default: str | None, options: tuple[str, ...], doc: str) -> Any:
    """Declare a text field that takes one of `options`, or nothing where that is its default."""
    return field(default=default, metadata={"options": options, "doc": doc})


def flag(default: bool, doc: str) -> Any:
    """Declare a field that is true or false."""
    return field(default=default, metadata={"doc": doc})


def check(section: Any) -> None:
    """Check each field of a section against its declared bounds or options.

    A section does not know where in a configuration it stands: whoever does puts the path before the message
    (`section_tree.build`).

    Raises:
        ConfigError: begins with the name of the field, then its value and what would be right.
    """
    for f in fields(section):
        value, meta = getattr(section, f.name), f.metadata
        is_nothing = value is None and f.default is None
        if "options" in meta and value not in meta["options"] and not is_nothing:
            raise ConfigError(f"{f.name}: {value!r} is not one of {', '.join(meta['options'])}")
        if "low" in meta and value is not None:
            for v in value if isinstance(value, tuple) else (value,):
                too_low = v <= meta["low"] if meta["open_low"] else v < meta["low"]
                if not math.isfinite(v) or too_low or v > meta["high"]:
                    bracket = "(" if meta["open_low"] else "["
                    bounds = f"{bracket}{meta['low']}, {meta['high']}]"
                    raise ConfigError(f"{f.name}: {v} is not in {bounds} ({meta['unit']})")
                if 0.0 < abs(v) < SMALLEST:
                    raise ConfigError(f"{f.name}: {v} is closer to 0 than {SMALLEST} ({meta['unit']})")


@dataclass(frozen=True)
class Section:
    """A part of a configuration that checks its own fields when it is made.

    Raises:
        ConfigError: a value out of its bounds, named without the path of the section.
    """

    def __post_init__(self) -> None:
        check(self)
