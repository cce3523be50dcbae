"""What the tracker learns of its sensors while it runs, taken along to other recordings.

How far a detector's scores are to be believed, and how far one sensor bears out another, a tracker finds out
by itself, but a short recording is over before it has. So recordings are tracked one after another, each
beginning with what those before taught, and what is known at the end is written down.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from jeat_graph.calibration.cuts import folds
from jeat_graph.calibration.parts import PartChoice
from jeat_graph.calibration.supervised import Recording
from jeat_graph.calibration.verdict import judge
from jeat_graph.config.learnt import LearntConfig
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.progress import with_progress
from jeat_graph.runs.declaring import own_picture
from jeat_graph.tracking.tracker import Tracker

#: Name of the choice.
LEARNT = "what tracking taught of sensors"
# What was learnt elsewhere counts for so much of what is learnt on the spot. On KITTI's cars and walkers, on
# TUD and in simulated worlds .3 did as well as 1 in the mean, and lost less where recordings differ.
_SHARE = 0.3


def learn_sensors(recordings: Sequence[Detections], config: Config) -> Config:
    """Track recordings for what is learnt of their sensors, and let `config` begin with that.

    Args:
        recordings: detections, with latencies taken off their times.
        config: declares all their sensors.

    Returns:
        The same configuration with `sensors.*.learnt`; the same where it learns nothing of sensors.
    """
    causal = replace(config, smoother=replace(config.smoother, engine="none"))
    for detections in with_progress(recordings):
        tracker = Tracker(own_picture(causal, detections))
        for _ in tracker.run(detections):
            pass
        causal = _with_learnt(causal, tracker.learnt())
    std = config.lifecycle.worth_std
    known = {
        name: s.learnt.counting_for(_SHARE, std) for name, s in causal.sensors.items() if s.learnt is not None
    }
    return _with_learnt(config, known)


def choose_learnt(config: Config, recordings: Sequence[Recording]) -> tuple[Config, PartChoice | None]:
    """Learn of the sensors, and keep it unless it loses on recordings that it was not learnt from.

    A tracker learns the same in any case, only later, so it need not win by more than chance. (To let it lose
    by as much as scenes scatter was tried: walkers seen by one camera had three points of MOTA less.)

    Returns:
        The configuration, and what was decided; None where there are too few recordings to decide, or the
        configuration learns nothing.
    """
    parts = folds(recordings)
    if len(parts) < 2 or not config.lifecycle.judges_worth:
        return config, None
    now = judge([config] * len(parts), parts)
    then = judge([learn_sensors(_detections(other), config) for other in reversed(parts)], parts)
    kept = then.mean >= now.mean
    choice = PartChoice(LEARNT, kept, then.mean - now.mean)
    return (learn_sensors(_detections(recordings), config) if kept else config), choice


def _detections(recordings: Sequence[Recording]) -> list[Detections]:
    return [detections for detections, _ in recordings]


def without_learnt(config: Config) -> Config:
    """Return the configuration as if nothing had been learnt of its sensors before."""
    return replace(config, sensors={name: replace(s, learnt=None) for name, s in config.sensors.items()})


def _with_learnt(config: Config, learnt: Mapping[str, LearntConfig]) -> Config:
    sensors = {name: replace(s, learnt=learnt.get(name, s.learnt)) for name, s in config.sensors.items()}
    return replace(config, sensors=sensors)
