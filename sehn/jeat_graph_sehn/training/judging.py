"""How good a network is on pictures or events that it did not learn from: average precision, COCO style."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
import torch

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.events import EventArray
from jeat_graph.data.interop import from_xyxy
from jeat_graph.detection.models.choosing import choose
from jeat_graph.detection.models.event_places import EventPlaces, event_scale
from jeat_graph.detection.models.feeding import picture_input, place, usual_feed
from jeat_graph.detection.models.layouts.registry import decode
from jeat_graph.detection.models.model_settings import OWN_OVERLAPS, ModelSettings
from jeat_graph.detection.models.parts import discounted
from jeat_graph.eval.detection_ap import average_precision, match_greedily
from jeat_graph_sehn.training.data_sets import EventSegment, FusedSegment, Picture
from jeat_graph_sehn.training.event_samples import windows_of
from jeat_graph_sehn.training.fused_network import FusedNet
from jeat_graph_sehn.training.network import PICTURE_INPUT, VehicleNet
from jeat_graph_sehn.training.serving import BOXES, ServedNet
from jeat_graph_sehn.training.settings import EVENTS, NetSettings, TrainSettings
from jeat_graph_sehn.training.truth_at import TrueBoxes

#: How the outputs are laid out, one of those in `detection.models.layouts`.
LAYOUT = "yolov8"
#: Scores below count for nothing.
_LEAST_SCORE = 0.01
#: Classes of sizes, by the square root of the area (px): the paper's half that is small, and COCO's limit.
SIZES = {"below 12 px": (0.0, 12.0), "12 to 32 px": (12.0, 32.0), "above 32 px": (32.0, np.inf)}
#: Windows are judged every 20 ms.
_STEP_BINS = 4
#: Of labels with times of their own one in so long is judged (s), each by the last of so many windows, before
#: which the network has seen nothing.
_APART_S, _LEADING = 0.1, 8
#: Of a recording at least so many are.
_LEAST_WINDOWS = 8
#: Who has hardly moved for so long is not asked for: nothing shows it, though a memory may know of it (s).
_SEEN_S = 0.2
_US = 1e6
Judged = TypeVar("Judged", Picture, EventSegment, float)


class Precision(NamedTuple):
    """Average precision in per cent, and of how many boxes; NaN where there are none."""

    ap50: float
    ap: float
    boxes: int


class Looked(NamedTuple):
    """What was found in one picture or window, and what is there.

    Attributes:
        source: name of the data set.
        corners: (M, 4) found.
        scores: (M,).
        truth: what is there.
    """

    source: str
    corners: FloatArray
    scores: FloatArray
    truth: TrueBoxes


def judge(
    net: VehicleNet,
    members: Sequence[Picture | EventSegment],
    side: tuple[int, int],
    settings: TrainSettings,
    most: int,
    on_look: Callable[[int, int], object] = lambda *_: None,
) -> dict[str, Precision]:
    """Judge a network.

    Args:
        net: left in the mode for use.
        members: pictures, or recordings of events.
        side: width and height of the network's input (px).
        settings: of the training.
        most: at most so many pictures or windows, evenly chosen.
        on_look: called with how many pictures or recordings were looked at, and how many there are.

    Returns:
        Precision of `all`, of each data set, and of each class of sizes.
    """
    net.eval()
    pictures = [m for m in members if isinstance(m, Picture)]
    segments = [m for m in members if isinstance(m, EventSegment)]
    looks: list[Looked] = []
    if pictures:
        chosen = _evenly(pictures, most)
        for k, look in enumerate(_pictures(net, chosen, side, settings.second_look)):
            looks.append(look)
            on_look(k + 1, len(chosen))
    else:
        shared, each = _shared_out(segments, most)
        for k, segment in enumerate(shared):
            looks += _windows(net, segment, each, side, settings)
            on_look(k + 1, len(shared))
    found = {"all": precision_of(looks)}
    for source in dict.fromkeys(look.source for look in looks):
        found[source] = precision_of([look for look in looks if look.source == source])
    for name, (low, high) in SIZES.items():
        found[name] = precision_of(looks, low, high)
    return found


def precision_of(looks: Sequence[Looked], low: float = 0.0, high: float = np.inf) -> Precision:
    """Average precision over pictures, of boxes with √area from `low` to below `high` (px)."""
    scores: list[FloatArray] = [np.zeros(0)]
    hits: list[BoolArray] = [np.zeros((10, 0), dtype=bool)]
    outs: list[BoolArray] = [np.zeros((10, 0), dtype=bool)]
    count = 0
    for look in looks:
        truth = look.truth.corners
        ignored = look.truth.ignored | ~_between(truth, low, high)
        order = np.argsort(-look.scores, kind="stable")
        corners = look.corners[order]
        hit, out = match_greedily(from_xyxy(corners), from_xyxy(truth), ignored)
        scores.append(look.scores[order])
        hits.append(hit)
        outs.append(out | (~hit & ~_between(corners, low, high)[None]))
        count += int((~ignored).sum())
    ap, _ = average_precision(np.concatenate(scores), np.hstack(hits), np.hstack(outs), count)
    return Precision(100.0 * float(ap[0]), 100.0 * float(ap.mean()), count)


def _between(corners: FloatArray, low: float, high: float) -> BoolArray:
    side = np.sqrt((corners[:, 2:] - corners[:, :2]).prod(axis=1))
    return np.asarray((side >= low) & (side < high))


def _shared_out(segments: Sequence[EventSegment], most: int) -> tuple[list[EventSegment], int]:
    """Return whose windows are judged, and how many of each: in a recording's first one nothing has moved."""
    each = max(most // max(len(segments), 1), min(most, _LEAST_WINDOWS))
    return _evenly(segments, max(most // each, 1)), each


def _evenly(members: Sequence[Judged], most: int) -> list[Judged]:
    chosen = np.unique(np.linspace(0, len(members) - 1, min(most, len(members))).round().astype(int))
    return [members[k] for k in chosen.tolist()]


@torch.no_grad()
def _pictures(
    net: VehicleNet, pictures: Sequence[Picture], side: tuple[int, int], second_look: bool
) -> Iterator[Looked]:
    reader = _Reader(net, side, second_look)
    feed = usual_feed(LAYOUT, ModelSettings())
    for picture in pictures:
        values, at = place(picture.load(), side, feed)
        corners, scores = reader.look((torch.from_numpy(values),))
        yield Looked(picture.source, at.back(corners), scores, picture.truth)


class _Run(NamedTuple):
    """Windows that follow one another: where they begin (µs), their ends after that, how many are judged."""

    first_us: int
    ends: list[int]
    judged: int


def _runs(segment: EventSegment, shape: NetSettings, most: int) -> list[_Run]:
    """Return what of a recording is looked at: its first windows, or those that lead to each label."""
    bin_us = round(shape.bin_s * _US)
    times = segment.truth.times
    if segment.truth.own_times:
        apart = np.unique(np.searchsorted(times, np.arange(times[0], times[-1] + _APART_S, _APART_S)))
        labels: list[float] = times[apart[apart < len(times)]].tolist()
        ends = [(shape.bins + k * _STEP_BINS) * bin_us for k in range(_LEADING)]
        return [_Run(round(t * _US) - ends[-1], ends, 1) for t in _evenly(labels, most)]
    first_us = int(max(times[0] * _US - shape.bins * bin_us, 0.0)) // bin_us * bin_us
    count = int((times[-1] * _US - first_us) // bin_us - shape.bins) // _STEP_BINS + 1
    ends = [(shape.bins + k * _STEP_BINS) * bin_us for k in range(min(count, most))]
    return [_Run(first_us, ends, len(ends))] if ends else []


@torch.no_grad()
def _windows(
    net: VehicleNet, segment: EventSegment, most: int, side: tuple[int, int], settings: TrainSettings
) -> Iterator[Looked]:
    shape = net.settings
    reader = _Reader(net, side, settings.second_look)
    with segment.open() as file:
        size_px = file.size_px or settings.crop_px
        places = EventPlaces(size_px, event_scale(size_px, side))
        for run in _runs(segment, shape, most):
            events = file.between(run.first_us, run.first_us + run.ends[-1])
            t_us = events.t_us - run.first_us
            own = places.moved(EventArray.trusted(t_us, events.x, events.y, events.polarity))
            reader.forget()
            for k, window in enumerate(windows_of(own, side, shape, run.ends)):
                now = (run.first_us + run.ends[k]) / _US
                shown = torch.from_numpy(window[None]).float()
                seen = _seen(net, segment, now, (side, places.shown_px))
                passed = _elapsed(shape, run.ends, k)
                corners, scores = reader.look((shown, *seen, *passed))
                if k < len(run.ends) - run.judged:
                    continue
                begin = max(run.first_us / _US, now - _SEEN_S)
                truth = (
                    segment.truth.at(now)  # pictures show who stands, too
                    if isinstance(net, FusedNet)
                    else segment.truth.asked(begin, now, settings.least_way_px)
                )
                yield Looked(segment.source, places.back(corners), scores, truth)


def _elapsed(shape: NetSettings, ends: Sequence[int], number: int) -> tuple[torch.Tensor, ...]:
    """Return how much has passed since the window before (s), where the network takes that."""
    if not shape.by_time:
        return ()
    passed = (ends[number] - ends[number - 1]) / _US if number else shape.bins * shape.bin_s
    return (torch.full((1, 1), passed),)


def _seen(
    net: VehicleNet, segment: EventSegment, now: float, sides: tuple[tuple[int, int], tuple[int, int]]
) -> tuple[torch.Tensor, ...]:
    """Return the newest picture up to a time (s) and what there is, for a network of both; () for another.

    Args:
        net: the network.
        segment: the recording.
        now: the time.
        sides: width and height (px) of the input, and of the picture in it.
    """
    if not isinstance(net, FusedNet) or not isinstance(segment, FusedSegment):
        return ()
    index = segment.newest(now)
    if index is None:
        shown, given = net.inputs(sides[0])[PICTURE_INPUT], [0.0, 0.0, 1.0]
    else:
        shown = torch.from_numpy(picture_input(segment.picture(index), *sides))
        given = [1.0, max(now - float(segment.times_s[index]), 0.0), 1.0]
    return (shown, torch.tensor([given]))


class _Reader:
    """Looks at one thing after the other, and turns the output into boxes just as its ONNX file is read."""

    def __init__(self, net: VehicleNet, side: tuple[int, int], second_look: bool) -> None:
        self._side = side
        self._device = next(net.parameters()).device
        self._served = ServedNet(net, side, second_look).to(self._device)
        self.forget()

    def forget(self) -> None:
        """Begin with nothing seen."""
        self._state = self._served.empty_state()

    def look(self, shown: tuple[torch.Tensor, ...]) -> tuple[FloatArray, FloatArray]:
        """Return corners (M, 4) and scores (M,); what the network remembers goes on."""
        given = self._served(*(one.to(self._device) for one in shown), *self._state)
        boxes = given[self._served.outputs.index(BOXES)]
        self._state = given[len(given) - len(self._state) :]
        found = decode(LAYOUT, {BOXES: boxes.cpu().numpy()}, self._side)
        chosen = choose(found, None, _LEAST_SCORE, *OWN_OVERLAPS)
        if self._served.net.settings.kind == EVENTS:
            chosen = discounted(chosen, _LEAST_SCORE)
        return chosen.corners, chosen.scores
