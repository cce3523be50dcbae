"""Sequences of windows of events with the pictures of their times, either left out or late at random."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.detection.models.event_places import event_scale
from jeat_graph.io.media.decoders import RgbImage
from jeat_graph_sehn.training.data_sets import FusedSegment
from jeat_graph_sehn.training.event_samples import Sequence, cut_sequence, drawn_events
from jeat_graph_sehn.training.fused_network import AVAILABILITY
from jeat_graph_sehn.training.picture_samples import cut_out, draw_light, draw_window
from jeat_graph_sehn.training.settings import COLOURS, FusedChanges, NetSettings, TrainSettings


class FusedSequence(NamedTuple):
    """Windows of events that follow one another, and pictures.

    Attributes:
        events: windows, and the truth at their ends.
        pictures: (K, 3, H, W) red, green, blue of 0 to 1; K is at least 1.
        which: (L,) the picture of each window.
        given: (L, 3) whether there is a picture, how old it is at the window's end (s), and whether there
            are events.
    """

    events: Sequence
    pictures: npt.NDArray[np.float32]
    which: npt.NDArray[np.int64]
    given: npt.NDArray[np.float32]


class _Lack(NamedTuple):
    """What a sequence lacks: pictures, events, and by how much pictures are late (s)."""

    no_picture: bool
    no_events: bool
    late_s: float


def draw_fused(
    segment: FusedSegment,
    rng: np.random.Generator,
    net: NetSettings,
    settings: TrainSettings,
    picture: Callable[[int], RgbImage],
    side: tuple[int, int] | None = None,
) -> FusedSequence:
    """Draw a sequence of a segment.

    Args:
        segment: the recording.
        rng: random numbers.
        net: what the network takes.
        settings: of the training.
        picture: reads a picture by its index, or has kept it.
        side: width and height of the network's input in use (px); None: those of the recording.

    Raises:
        DataError: the recording is too short, or cannot be read.
    """
    plan, events, size_px = drawn_events(segment, rng, net, settings)
    lack = _draw_lack(rng, settings.fused)
    ends = plan.ends_us(net)
    now = [plan.file_s(end) for end in ends]
    # Pictures show who stands; events do not.
    first_s, least_px = plan.file_s(0.0), settings.least_way_px
    truth = [
        segment.truth.asked(first_s, t, least_px) if lack.no_picture else segment.truth.at(t) for t in now
    ]
    changes = settings.pictures
    shares = (settings.events.zoom, changes.mirror_share, changes.on_box_share)
    served = event_scale(size_px, side or size_px)
    window = draw_window(rng, size_px, settings.crop_px, truth[-1], shares, served)
    windows = cut_sequence(events, truth, plan, window, (rng, net, settings))
    if lack.no_events:
        windows = windows._replace(windows=np.zeros_like(windows.windows))
    seen = [None if lack.no_picture else segment.newest(t - lack.late_s / plan.rate) for t in now]
    kept = sorted({one for one in seen if one is not None})
    light = draw_light(rng, changes)
    width, height = settings.crop_px
    pictures = [cut_out(picture(one), window, rng, light) for one in kept]
    given = np.zeros((len(ends), AVAILABILITY), dtype=np.float32)
    which = np.zeros(len(ends), dtype=np.int64)
    for k, (one, t) in enumerate(zip(seen, now, strict=True)):
        age_s = 0.0 if one is None else max(plan.rate * (t - segment.times_s[one]), 0.0)
        given[k] = (one is not None, age_s, not lack.no_events)
        which[k] = 0 if one is None else kept.index(one)
    shown = np.stack(pictures) if pictures else np.zeros((1, COLOURS, height, width), dtype=np.float32)
    return FusedSequence(windows, shown, which, given)


def _draw_lack(rng: np.random.Generator, changes: FusedChanges) -> _Lack:
    no_picture, no_events, stale, late = rng.random(4)
    without = bool(no_picture < changes.no_picture_share)
    return _Lack(
        without,
        not without and bool(no_events < changes.no_events_share),
        float(late * changes.stale_s) if stale < changes.stale_share else 0.0,
    )
