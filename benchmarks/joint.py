"""`python -m benchmarks joint`: two sensors at one time, associated scan by scan or in one joint problem.

Drawn scenes first: a few tracks and the boxes of two sensors, of which the truth is known. Then the recording
of `demo` with its times rounded, so that its sensors do look at one time, by each preset: all scans of a time
in one step, or each in a step of its own, in either order.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from benchmarks import common
from benchmarks.provenance import provenance
from jeat_graph.api.functions import evaluate
from jeat_graph.association.assignment import assign
from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.config.argument_types import counting, natural
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.scan import Scan
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.runs.demo_recording import read_demo_recording
from jeat_graph.tracking.tracker import Tracker

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Table

#: Of drawn scenes: tracks, share that each sensor detects, false boxes of each, standard deviation of the
#: predictions and of the exact and the poor sensor, side of the square (all in px).
_TRACKS, _DETECTED, _FALSE = 3, 0.9, 0.5
_PREDICTED, _EXACT, _POOR, _SIDE = 6.0, 2.0, 5.0, 40.0
#: Times of the recording are rounded to so many digits of a second.
_DIGITS = 2
TOGETHER = "in one step"


class DrawnScene(NamedTuple):
    """What two sensors see of N tracks at one time.

    Attributes:
        mean: (N, 2) predicted places (px).
        boxes: of each sensor (M, 2).
        truth: of each sensor (M,) the track of each box, or −1 where it is false.
    """

    mean: FloatArray
    boxes: tuple[FloatArray, FloatArray]
    truth: tuple[IntArray, IntArray]


def drawn_scene(rng: np.random.Generator) -> DrawnScene:
    """Draw tracks near enough to each other to be confused, and what an exact and a poor sensor see."""
    mean = rng.uniform(0.0, _SIDE, (_TRACKS, 2))
    there = mean + rng.normal(0.0, _PREDICTED, mean.shape)
    boxes, truth = [], []
    for std in (_EXACT, _POOR):
        seen = np.flatnonzero(rng.random(_TRACKS) < _DETECTED)
        false = rng.uniform(0.0, _SIDE, (rng.poisson(_FALSE), 2))
        boxes.append(np.concatenate([there[seen] + rng.normal(0.0, std, (len(seen), 2)), false]))
        truth.append(np.concatenate([seen, np.full(len(false), -1)]))
    return DrawnScene(mean, (boxes[0], boxes[1]), (truth[0], truth[1]))


def log_ratios(mean: FloatArray, var: FloatArray, boxes: FloatArray, std: float) -> FloatArray:
    """Return ln L (N, M) of each pair: ln[P_D / (1 − P_D)] + ln N(z; m, (P + R) I) − ln κ.

    Args:
        mean: (N, 2) places of the tracks (px).
        var: (N,) their variances P (px²).
        boxes: (M, 2).
        std: √R of their sensor (px).
    """
    S = (var + std * std)[:, None]
    d2 = ((boxes[None] - mean[:, None]) ** 2).sum(axis=2) / S
    odds = np.log(_DETECTED / (1.0 - _DETECTED)) - np.log(_FALSE / _SIDE**2)
    return np.asarray(odds - 0.5 * d2 - np.log(2.0 * np.pi * S))


def after(
    scene: DrawnScene, sensor: int, made: tuple[IntArray, IntArray], std: float
) -> tuple[FloatArray, FloatArray]:
    """Return means (N, 2) and variances (N,) of the tracks after an update with a sensor's boxes."""
    mean, var = scene.mean.copy(), np.full(len(scene.mean), _PREDICTED**2)
    row, box = made
    gain = var[row] / (var[row] + std * std)
    mean[row] += gain[:, None] * (scene.boxes[sensor][box] - mean[row])
    var[row] *= 1.0 - gain
    return mean, var


def _best(ratio: FloatArray) -> tuple[IntArray, IntArray]:
    return assign(np.maximum(ratio, 0.0))


_Made = tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]
_STD = (_EXACT, _POOR)


def by_predictions(scene: DrawnScene) -> _Made:
    """Associate both sensors with the predicted tracks, as a joint assignment with a slot a sensor does."""
    var = np.full(len(scene.mean), _PREDICTED**2)
    first, second = (_best(log_ratios(scene.mean, var, scene.boxes[s], _STD[s])) for s in (0, 1))
    return first, second


def in_turn(scene: DrawnScene, order: Sequence[int]) -> _Made:
    """Associate one sensor, update, then associate the other: what `default` does, the exact one first."""
    first, second = order
    var = np.full(len(scene.mean), _PREDICTED**2)
    made = {first: _best(log_ratios(scene.mean, var, scene.boxes[first], _STD[first]))}
    now = after(scene, first, made[first], _STD[first])
    made[second] = _best(log_ratios(*now, scene.boxes[second], _STD[second]))
    return made[0], made[1]


def most_likely(scene: DrawnScene) -> _Made:
    """Find the most likely pair of assignments: all of the exact sensor are tried, NP-hard in general."""
    var = np.full(len(scene.mean), _PREDICTED**2)
    ratio = log_ratios(scene.mean, var, scene.boxes[0], _EXACT)
    best, found = -np.inf, None
    for made in _assignments(len(scene.mean), len(scene.boxes[0])):
        second = log_ratios(*after(scene, 0, made, _EXACT), scene.boxes[1], _POOR)
        other = _best(second)
        sum_ = ratio[made].sum() + second[other].sum()
        if sum_ > best:
            best, found = sum_, (made, other)
    assert found is not None, "no pair at all is an assignment, too"
    return found


def _assignments(tracks: int, boxes: int) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield all assignments of tracks to boxes, none twice."""

    def below(row: int, free: tuple[int, ...]) -> Iterator[list[tuple[int, int]]]:
        if row == tracks:
            yield []
            return
        yield from below(row + 1, free)
        for k, box in enumerate(free):
            for rest in below(row + 1, free[:k] + free[k + 1 :]):
                yield [(row, box), *rest]

    for pairs in below(0, tuple(range(boxes))):
        both = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        yield both[:, 0], both[:, 1]


def wrong(scene: DrawnScene, made: _Made) -> int:
    """Count boxes whose track is not the true one, those of no track included."""
    count = 0
    for (row, box), truth in zip(made, scene.truth, strict=True):
        predicted = np.full(len(truth), -1)
        predicted[box] = row
        count += int((predicted != truth).sum())
    return count


#: How both sensors of a drawn scene may be associated.
WAYS = {
    "one joint assignment, costs of the predicted tracks": by_predictions,
    "scan by scan, the exact sensor first": lambda scene: in_turn(scene, (0, 1)),
    "scan by scan, the poor sensor first": lambda scene: in_turn(scene, (1, 0)),
    "the most likely of all pairs of assignments": most_likely,
}


def drawn_errors(scenes: int, seed: int) -> dict[str, tuple[float, float]]:
    """Return by way the share of wrong boxes, and the standard error of its difference to the first way."""
    rng = np.random.default_rng(seed)
    drawn = [drawn_scene(rng) for _ in range(scenes)]
    boxes = sum(len(part) for scene in drawn for part in scene.boxes)
    counts = {name: np.array([wrong(one, way(one)) for one in drawn]) for name, way in WAYS.items()}
    first = next(iter(counts.values()))
    return {
        name: (count.sum() / boxes, float((count - first).std()) * np.sqrt(scenes) / boxes)
        for name, count in counts.items()
    }


def demo_scores(preset: str, order: Sequence[str] | None, digits: int) -> dict[str, Any]:
    """Return the causal scores of the demo's recording, its times rounded to so many digits of a second.

    For `paper` also `twins`, how many pairs of tracks overlapped by more than half at times of both sensors,
    and `both fed`, how many of them both got a box there.

    Args:
        preset: name of the configuration.
        order: sensors in the order of their steps; None takes all scans of a time in one.
        digits: of the times.
    """
    demo = read_demo_recording()
    found = demo.detections
    rounded = Detections.from_scans(replace(one, t=round(one.t, digits)) for one in found.scans())
    tracker = Tracker(preset, image=(demo.width, demo.height))
    tables = []
    pairs = both = 0
    for batch in rounded.batches():
        fed: set[int] = set()
        answers = []
        for scans in _steps(batch, order):
            answers.append(tracker.step(scans))
            fed |= set(tracker.assigned(sum(map(len, scans))).tolist())
        tables.append(answers[-1])  # the answer of a time is that after its last scan
        if preset == "paper" and len(batch) > 1:
            one, other = _twins(tracker)
            pairs += len(one)
            both += int((np.isin(one, list(fed)) & np.isin(other, list(fed))).sum())
    scores = dict(evaluate(Trajectories.concatenate(tables), demo.truth)["causal"])
    return scores | ({"twins": pairs, "both fed": both} if preset == "paper" else {})


def _twins(tracker: Tracker) -> tuple[IntArray, IntArray]:
    """Return identities (K,) and (K,) of living tracks of `paper` that overlap by more than half (IoU)."""
    tracks = tracker.snapshot().moment.tracks  # type: ignore[attr-defined]
    size = np.exp(tracks.size_mean[:, :, 0])
    boxes = np.concatenate([tracks.mean[:, :, 0] - size / 2.0, size], axis=1)
    one, other = np.nonzero(np.triu(pairwise_iou(boxes, boxes) > 0.5, 1))
    return tracks.track_id[one], tracks.track_id[other]


def _steps(batch: list[Scan], order: Sequence[str] | None) -> list[list[Scan]]:
    if order is None:
        return [batch]
    return [[scan] for scan in sorted(batch, key=lambda scan: order.index(scan.sensor))]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(parser, "joint", {"quick": "few scenes: to see that it runs"})
    parser.add_argument("--scenes", type=counting, default=1000, metavar="N", help="drawn scenes (1000)")
    parser.add_argument("--seed", type=natural, default=0, metavar="N", help="of the scenes (0)")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    if args.quick:
        args.scenes = min(args.scenes, 50)
    return common.measure_or_read(args, "joint", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Associate drawn scenes and track the rounded recording."""
    orders = {TOGETHER: None, "rgb, then evt": ("rgb", "evt"), "evt, then rgb": ("evt", "rgb")}
    return {
        "benchmark": "joint",
        **provenance({"scenes": args.scenes, "seed": args.seed}, {}),
        "drawn": drawn_errors(args.scenes, args.seed),
        "demo": [
            {"preset": preset, "scans of one time": name, **demo_scores(preset, order, _DIGITS)}
            for preset in ("default", "paper")
            for name, order in orders.items()
        ],
    }


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Make the tables of a result, by the names of their markers."""
    from jeat_graph.eval.tables import Table

    drawn = [
        {"associated": way, "wrong boxes (%)": f"{100 * share:.2f}", "± (%)": f"{100 * error:.2f}"}
        for way, (share, error) in result["drawn"].items()
    ]
    shown = ("preset", "scans of one time", "MOTA", "HOTA", "IDF1", "FP", "FN", "IDSW", "twins", "both fed")
    scores = [
        {key: f"{one[key]:.1f}" if isinstance(one.get(key), float) else one.get(key) for key in shown}
        for one in result["demo"]
    ]
    return {
        "joint-drawn": Table.from_records(drawn, title="Two sensors at one time, drawn scenes"),
        "joint-demo": Table.from_records(scores, title="The recording of demo, times rounded to 10 ms"),
    }
