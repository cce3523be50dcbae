"""The state of a tracker, smoothers included, in one file from which it goes on as if nothing had happened.

The file is an `.npz` of two arrays: a text that says what is there, and a block with all numbers. It holds
our own arrays and nothing of GTSAM's: the windows inside GTSAM are built anew from them, in the tracker that
was saved and in the one that is loaded alike, so that both give the same bytes from there on.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from jeat_graph.config.reading import config_from_dict, config_to_dict
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.packing import Codec, pack, plain_codec, unpack
from jeat_graph.io.state_file import read_state_file, write_state_file
from jeat_graph.smoothers.engine import WholeTrackSmoother
from jeat_graph.smoothers.fixed_lag import FixedLagSmoother
from jeat_graph.smoothers.track_data import Prior, SmoothedTrack
from jeat_graph.smoothers.window import Window
from jeat_graph.tracking.appearance import Looks
from jeat_graph.tracking.classes import ClassTally, Votes
from jeat_graph.tracking.first_sight import wider
from jeat_graph.tracking.smoothing.behind import InProcessSmoothing
from jeat_graph.tracking.smoothing.history import TrackHistory
from jeat_graph.tracking.smoothing.observation_times import ObservationTimes
from jeat_graph.tracking.smoothing.online import TrackSmoothers
from jeat_graph.tracking.smoothing.priors import ErrorStates
from jeat_graph.tracking.smoothing.recorder import StepRecorder
from jeat_graph.tracking.smoothing.shares import Share
from jeat_graph.tracking.smoothing.sizes import SizeWindow
from jeat_graph.tracking.smoothing.waiting import WaitingRows
from jeat_graph.tracking.snapshot import Snapshot
from jeat_graph.tracking.state import SceneState, TrackArrays
from jeat_graph.tracking.state_check import checked_snapshot, made_with
from jeat_graph.tracking.state_check import refusing_damage as refusing_damage
from jeat_graph.tracking.step_record import StepRecord
from jeat_graph.version import __version__

#: Raised with every change of what is saved: a file of another format is refused, not guessed at.
FORMAT = 26
_MAGIC, _WHAT = "jeat-graph tracker", "saved tracker"
_PLAIN = (
    ClassTally,
    InProcessSmoothing,
    Looks,
    ObservationTimes,
    Prior,
    Scan,
    SceneState,
    SizeWindow,
    SmoothedTrack,
    StepRecord,
    StepRecorder,
    TrackArrays,
    TrackHistory,
    TrackSmoothers,
    Trajectories,
    Votes,
    WholeTrackSmoother,
)


def pack_smoothers(config: Config, smoothers: TrackSmoothers) -> tuple[str, bytes]:
    """Return the state of smoothers as plain text and bytes; they themselves stay as they are."""
    return pack(smoothers, _codecs(config, forget=False))


def unpack_smoothers(config: Config, state: tuple[str, bytes]) -> TrackSmoothers:
    """Make smoothers of what `pack_smoothers` returned."""
    made: TrackSmoothers = unpack(*state, _codecs(config))
    return made


def _codecs(config: Config, forget: bool = True) -> dict[str, Codec]:
    """All classes that a file may name; `forget` has the saved smoothers build GTSAM's windows anew too."""
    plain = {kind.__name__: _whole_codec(kind) for kind in _PLAIN}
    lag = plain_codec(FixedLagSmoother)

    def lag_apart(one: FixedLagSmoother) -> dict[str, Any]:
        if forget:
            one.forget_gtsam()
        return one.saved()

    return plain | {
        "Snapshot": Codec(
            Snapshot,
            lambda one: one._asdict(),
            lambda saved: checked_snapshot(Snapshot(**saved), config),
        ),
        "FixedLagSmoother": Codec(FixedLagSmoother, lag_apart, lag.together),
        "Window": Codec(Window, Window.saved, Window.from_saved),
        "WaitingRows": Codec(WaitingRows, _rows_apart, lambda saved: _rows_together(config, saved)),
        "Share": Codec(Share, Share.saved, Share.from_saved),
        "Config": Codec(type(config), lambda _: {}, lambda _: config),
        "ErrorStates": Codec(ErrorStates, lambda _: {}, lambda _: ErrorStates.of(config)),
    }


def _whole_codec(kind: type[Any]) -> Codec:
    """Codec of objects that are their attributes, all of which must be there."""
    plain, needed = plain_codec(kind), made_with(kind)

    def together(saved: dict[str, Any]) -> Any:
        missing = needed - saved.keys()
        if missing:
            raise DataError(f"is damaged: {kind.__name__} without {min(missing)}")
        return plain.together(saved)

    return Codec(kind, plain.apart, together)


def _rows_apart(rows: WaitingRows) -> dict[str, Any]:
    return {"tables": rows.peek()}


def _rows_together(config: Config, saved: dict[str, Any]) -> WaitingRows:
    rows = WaitingRows(config.sensor_names)
    for table in saved["tables"]:
        rows.append(table)
    return rows


def save_state(path: str | Path, config: Config, state: dict[str, Any]) -> None:
    """Write a state; the file appears when it is complete, in place of the one before.

    The system writes it to the disk in its own time: it survives the death of the process at any moment, and
    after a power cut the file is this one or the one before.

    Args:
        path: the file.
        config: the configuration of the tracker.
        state: what to keep, of plain data and the classes that `_codecs` names.

    Raises:
        JeatGraphError: the smoothers are in a process of their own.
    """
    if config.smoother.worker:
        raise JeatGraphError("a smoothing worker's state cannot be saved: set smoother.worker to false")
    text, block = pack(state, _codecs(config))
    described = _head(config) + b"\n" + text.encode()
    write_state_file(path, described, block)


_heads: dict[int, tuple[Config, bytes]] = {}


def _head(config: Config) -> bytes:
    """What the file says of its origin; made once for the configuration of the last call, which is frozen."""
    known = _heads.get(id(config))
    if known is None:
        head = {"kind": _MAGIC, "format": FORMAT, "version": __version__, "config": config_to_dict(config)}
        known = config, json.dumps(head).encode()
        _heads.clear()
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
            f"{FORMAT}): finish with that version, or begin anew without the file"
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
                "begin anew without the file"
            )
    with refusing_damage(path):
        kept = config_from_dict(settings)
        if config is not None and config.sensors.keys() == kept.sensors.keys():
            kept = config
        state = unpack(text, block, _codecs(kept))
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
