"""How good a network is on pictures or events that it did not learn from: average precision, COCO style."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
import torch

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.events import EventArray
from jeat_graph.data.interop import from_xyxy
from jeat_graph.detection.models.choosing import choose
from jeat_graph.detection.models.event_places import EventPlaces, event_scale
from jeat_graph.detection.models.feeding import picture_input, place, usual_feed
from jeat_graph.detection.models.layouts import decode
from jeat_graph.detection.models.model_settings import OWN_OVERLAPS, ModelSettings
from jeat_graph.eval.detection_ap import average_precision, match_greedily
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph_sehn.training.data_sets import EventSegment, FusedSegment, Picture
from jeat_graph_sehn.training.event_samples import asked_for, windows_of
from jeat_graph_sehn.training.fused_network import FusedNet
from jeat_graph_sehn.training.network import PICTURE_INPUT, VehicleNet
from jeat_graph_sehn.training.serving import ServedNet
from jeat_graph_sehn.training.settings import TrainSettings
from jeat_graph_sehn.training.truth_at import TrueBoxes

#: How the outputs are laid out, one of those in `detection.models.layouts`.
LAYOUT = "yolov8"
#: Scores below count for nothing.
_LEAST_SCORE = 0.01
#: Classes of sizes, by the square root of the area (px): the paper's half that is small, and COCO's limit.
SIZES = {"below 12 px": (0.0, 12.0), "12 to 32 px": (12.0, 32.0), "above 32 px": (32.0, np.inf)}
#: Windows are judged every 20 ms.
_STEP_BINS = 4
#: Of a recording at least so many are.
_LEAST_WINDOWS = 8
#: Who has hardly moved for so long is not asked for: nothing shows it, though a memory may know of it (s).
_SEEN_S = 0.2
_US = 1e6
Judged = TypeVar("Judged", Picture, EventSegment)


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
) -> dict[str, Precision]:
    """Judge a network.

    Args:
        net: left in the mode for use.
        members: pictures, or recordings of events.
        side: width and height of the network's input (px).
        settings: of the training.
        most: at most so many pictures or windows, evenly chosen.

    Returns:
        Precision of `all`, of each data set, and of each class of sizes.
    """
    net.eval()
    pictures = [m for m in members if isinstance(m, Picture)]
    segments = [m for m in members if isinstance(m, EventSegment)]
    looks = (
        list(_pictures(net, _evenly(pictures, most), side, settings.second_look))
        if pictures
        else list(_windows(net, *_shared_out(segments, most), side, settings))
    )
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


@torch.no_grad()
def _windows(
    net: VehicleNet,
    segments: Sequence[EventSegment],
    most: int,
    side: tuple[int, int],
    settings: TrainSettings,
) -> Iterator[Looked]:
    shape = net.settings
    bin_us = round(shape.bin_s * _US)
    for segment in segments:
        with EventFile(segment.path) as file:
            first_us = max(segment.truth.times[0] * _US - shape.bins * bin_us, 0.0)
            first_us = int(first_us) // bin_us * bin_us
            count = int((segment.truth.times[-1] * _US - first_us) // bin_us - shape.bins) // _STEP_BINS + 1
            ends = [(shape.bins + k * _STEP_BINS) * bin_us for k in range(min(count, most))]
            if not ends:
                continue
            events = file.between(first_us, first_us + ends[-1])
            size_px = file.size_px or settings.crop_px
        places = EventPlaces(size_px, event_scale(size_px, side))
        own = places.moved(EventArray.trusted(events.t_us - first_us, events.x, events.y, events.polarity))
        reader = _Reader(net, side, settings.second_look)
        for end, window in zip(ends, windows_of(own, side, shape, ends), strict=True):
            now = (first_us + end) / _US
            shown = torch.from_numpy(window[None]).float()
            corners, scores = reader.look((shown, *_seen(net, segment, now, (side, places.shown_px))))
            begin = max(first_us / _US, now - _SEEN_S)
            truth = (
                segment.truth.at(now)  # pictures show who stands, too
                if isinstance(net, FusedNet)
                else asked_for(segment, begin, now, settings.least_way_px)
            )
            yield Looked(segment.source, places.back(corners), scores, truth)


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
    """Looks at one thing after the other, and turns what is said into boxes just as its ONNX file is read."""

    def __init__(self, net: VehicleNet, side: tuple[int, int], second_look: bool) -> None:
        self._side = side
        self._device = next(net.parameters()).device
        self._served = ServedNet(net, side, second_look).to(self._device)
        self._state = self._served.empty_state()

    def look(self, shown: tuple[torch.Tensor, ...]) -> tuple[FloatArray, FloatArray]:
        """Return corners (M, 4) and scores (M,); what the network remembers goes on."""
        boxes, *self._state = self._served(*(one.to(self._device) for one in shown), *self._state)
        found = decode(LAYOUT, {"boxes": boxes.cpu().numpy()}, self._side)
        corners, scores, _ = choose(found, None, _LEAST_SCORE, *OWN_OVERLAPS)
        return corners, scores
