"""The classes that a saved compiled tracker may name, and its smoothers as plain text and bytes."""

from __future__ import annotations

from typing import Any

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.packing import Codec, pack, plain_codec, unpack
from jeat_graph.smoothers.engine import WholeTrackSmoother
from jeat_graph.smoothers.fixed_lag import FixedLagSmoother
from jeat_graph.smoothers.track_data import Prior, SmoothedTrack
from jeat_graph.smoothers.window import Window
from jeat_graph.tracking.appearance import Looks
from jeat_graph.tracking.classes import ClassTally, Votes
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
from jeat_graph.tracking.step_record import StepRecord

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
    return pack(smoothers, compiled_codecs(config, forget=False))


def unpack_smoothers(config: Config, state: tuple[str, bytes]) -> TrackSmoothers:
    """Make smoothers of what `pack_smoothers` returned."""
    made: TrackSmoothers = unpack(*state, compiled_codecs(config))
    return made


def compiled_codecs(config: Config, forget: bool = True) -> dict[str, Codec]:
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
