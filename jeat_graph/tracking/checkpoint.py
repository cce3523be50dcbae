"""The state of a tracker, smoothers included, in one file from which it goes on as if nothing had happened.

The file is an `.npz` of two arrays: a text that says what is there, and a block with all numbers. It holds
our own arrays: the tracker that was saved and the one that is loaded give the same bytes from there on.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from jeat_graph.config.reading import config_from_dict, config_to_dict
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.io.files.packing import Codec, pack, plain_codec, unpack
from jeat_graph.io.files.state_file import read_state_file, write_state_file
from jeat_graph.tracking.appearance import Appearances
from jeat_graph.tracking.classes import ClassTally
from jeat_graph.tracking.damage import refusing_damage
from jeat_graph.tracking.engine import StepBoxes
from jeat_graph.tracking.first_sight import wider
from jeat_graph.version import __version__

#: Raised with every change of what is saved: a file of another format is refused, not guessed at.
FORMAT = 45
_MAGIC, _WHAT = "jeat-graph tracker", "saved tracker"


def _codecs() -> dict[str, Codec]:
    """All classes that a file may name."""
    return {
        kind.__name__: plain_codec(kind) for kind in (ClassTally, Detections, Appearances, Scan, StepBoxes)
    }


def save_state(path: str | Path, config: Config, state: dict[str, Any]) -> None:
    """Write a state; the file appears when it is complete, in place of the one before.

    The system writes it to the disk in its own time: it survives the death of the process at any moment, and
    after a power cut the file is this one or the one before.

    Args:
        path: the file.
        config: the configuration of the tracker.
        state: what to keep, of plain data and the classes that `_codecs` names.
    """
    text, block = pack(state, _codecs())
    described = _head(config) + b"\n" + text.encode()
    write_state_file(path, described, block)


#: A process may track many cameras, each with a configuration of its own.
_MOST_HEADS = 128
_heads: dict[int, tuple[Config, bytes]] = {}


def _head(config: Config) -> bytes:
    """What the file says of its origin; made once for each configuration of late, which are frozen."""
    known = _heads.get(id(config))
    if known is None:
        head = {"kind": _MAGIC, "format": FORMAT, "version": __version__, "config": config_to_dict(config)}
        known = config, json.dumps(head).encode()
        while len(_heads) >= _MOST_HEADS:
            del _heads[next(iter(_heads))]
        _heads[id(config)] = known
    return known[1]


def load_state(path: str | Path, config: Config | None = None) -> tuple[Config, dict[str, Any]]:
    """Read what `save_state` wrote.

    Args:
        path: the file.
        config: the configuration that it must have been made with; None takes what the file says.

    Returns:
        The configuration and the state.

    Raises:
        DataError: no such file, not a state of a tracker, or a damaged one.
        JeatGraphError: it is of another version, or was made with other settings.
    """
    described, block = read_state_file(path, _WHAT)
    try:
        head_text, _, text = described.decode().partition("\n")
        head = json.loads(head_text)
        found = (head["kind"], head["format"], head["version"], head["config"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DataError(f"is no {_WHAT} ({type(error).__name__})", path) from None
    kind, form, version, settings = found
    if kind != _MAGIC or form != FORMAT or version != __version__:
        raise JeatGraphError(
            f"{path}: was saved by version {version} (format {form}), and this is {__version__} (format "
            f"{FORMAT}): finish with that version, or start over without the file"
        )
    if not isinstance(settings, dict):
        raise DataError(f"is no {_WHAT}: its settings are none", path)
    if config is not None:
        # Sensors that were met are declared there.
        met = wider(config, settings.get("sensors", ())) or config
        wanted = json.loads(json.dumps(config_to_dict(met)))
        if wanted != settings:
            raise JeatGraphError(
                f"{path}: was saved with other settings: {_difference(settings, wanted)}; give the same, or "
                "start over without the file"
            )
    with refusing_damage(path):
        kept = config_from_dict(settings)
        if config is not None and config.sensors.keys() == kept.sensors.keys():
            kept = config
        state = unpack(text, block, _codecs())
        if not isinstance(state, dict):
            raise DataError("is damaged: it holds no state")
    return kept, state


def _difference(saved: Any, wanted: Any, where: str = "") -> str:
    """The first setting that differs, with both values."""
    if isinstance(saved, dict) and isinstance(wanted, dict):
        for key in (*saved, *wanted):
            if saved.get(key) != wanted.get(key):
                return _difference(saved.get(key), wanted.get(key), f"{where}.{key}" if where else str(key))
    return f"{where} was {saved}, not {wanted}"


def load_plain_state(path: str | Path, config: Config | None = None) -> tuple[Config, dict[str, Any]]:
    """Read what `save_state` wrote of a tracker alone, and not of one that takes late scans.

    Args:
        path: the file.
        config: the configuration that it must have been made with; None takes what the file says.

    Raises:
        DataError, JeatGraphError: as `load_state`; or it is of a tracker that takes late scans.
    """
    kept, state = load_state(path, config)
    if "policy" in state:
        # Scans that may be taken again are apart there, and identities are not those that were given out.
        raise DataError("holds a tracker that takes late scans; LiveTracker.load goes on from it", path)
    return kept, state
