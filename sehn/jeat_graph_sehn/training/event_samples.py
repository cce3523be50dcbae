"""Sequences of windows of events, changed at random, with the boxes at the end of each window."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.models.event_places import event_scale
from jeat_graph.detection.windows import EventBins
from jeat_graph_sehn.training.data_sets import EventSegment
from jeat_graph_sehn.training.disturbances import draw_disturbances
from jeat_graph_sehn.training.picture_samples import CutOut, draw_window
from jeat_graph_sehn.training.settings import NetSettings, TrainSettings
from jeat_graph_sehn.training.truth_at import TrueBoxes

_US = 1e6


class Sequence(NamedTuple):
    """Windows of events that follow one another.

    Attributes:
        windows: (L, 2 x bins, H, W) counts.
        corners: of the L windows' ends, each (G, 4) px.
        ignored: whether each is ignored, each (G,).
        elapsed_s: since the window before each (s); at the first of all what it spans.
    """

    windows: npt.NDArray[np.uint8]
    corners: list[FloatArray]
    ignored: list[BoolArray]
    elapsed_s: list[float]


class SequencePlan(NamedTuple):
    """When a sequence is, and how it is changed.

    Attributes:
        start_us: where its first bin begins, on the file's clock.
        rate: its clock runs so much faster than the file's.
        step_bins: bins from window to window.
        windows: how many.
    """

    start_us: float
    rate: float
    step_bins: int
    windows: int

    def file_s(self, own_us: float) -> float:
        """Return a time of the sequence (µs) on the file's clock (s)."""
        return (self.start_us + own_us / self.rate) / _US

    def ends_us(self, net: NetSettings) -> list[int]:
        """Return where the windows end on the sequence's clock (µs)."""
        bin_us = round(net.bin_s * _US)
        return [(net.bins + k * self.step_bins) * bin_us for k in range(self.windows)]


class LongSequence(NamedTuple):
    """A long sequence, of which the windows are made part by part.

    Attributes:
        events: in the cut-out and changed, from time 0 of the sequence's clock.
        truth: corners and whether they are ignored, at the end of each window.
        plan: when it is.
        side: width and height of the cut-out (px).
    """

    events: EventArray
    truth: list[tuple[FloatArray, BoolArray]]
    plan: SequencePlan
    side: tuple[int, int]

    def part(self, first: int, count: int, net: NetSettings) -> Sequence:
        """Return `count` windows from the one with number `first` on."""
        ends = self.plan.ends_us(net)[first : first + count]
        bin_us = round(net.bin_s * _US)
        begin_us = ends[0] - net.bins * bin_us
        low, high = np.searchsorted(self.events.t_us, [begin_us, ends[-1]]).tolist()
        rows = slice(low, high)
        events = EventArray.trusted(
            self.events.t_us[rows] - begin_us,
            self.events.x[rows],
            self.events.y[rows],
            self.events.polarity[rows],
        )
        own = [end - begin_us for end in ends]
        boxes = self.truth[first : first + count]
        passed = [self.plan.step_bins * net.bin_s] * len(ends)
        if first == 0:
            passed[0] = net.bins * net.bin_s
        return Sequence(
            np.stack(list(windows_of(events, self.side, net, own))),
            [corners for corners, _ in boxes],
            [ignored for _, ignored in boxes],
            passed,
        )


def draw_sequence(
    segment: EventSegment,
    rng: np.random.Generator,
    net: NetSettings,
    settings: TrainSettings,
    side: tuple[int, int] | None = None,
) -> Sequence:
    """Draw a sequence of a segment.

    Args:
        segment: the recording.
        rng: random numbers.
        net: what the network takes.
        settings: of the training.
        side: width and height of the network's input in use (px); None: those of the recording.

    Raises:
        DataError: the recording is too short, or cannot be read.
    """
    return draw_stream(segment, rng, net, settings, side).part(0, settings.steps, net)


def draw_stream(
    segment: EventSegment,
    rng: np.random.Generator,
    net: NetSettings,
    settings: TrainSettings,
    side: tuple[int, int] | None = None,
    times: int = 1,
) -> LongSequence:
    """Draw a sequence so many `times` as long as the settings' `steps`; other arguments as `draw_sequence`.

    Asked for is whoever has moved since it began, also where he stands now.
    """
    plan, events, size_px = drawn_events(segment, rng, net, settings, times)
    ends_s = [plan.file_s(end) for end in plan.ends_us(net)]
    truth = segment.truth.asked_since(plan.file_s(0.0), ends_s, settings.least_way_px)
    changes = settings.events
    shares = (changes.zoom, changes.mirror_share, changes.on_box_share)
    served = event_scale(size_px, side or size_px)
    window = draw_window(rng, size_px, settings.crop_px, truth[-1], shares, served)
    return cut_stream(events, truth, plan, window, (rng, net, settings))


def drawn_events(
    segment: EventSegment,
    rng: np.random.Generator,
    net: NetSettings,
    settings: TrainSettings,
    times: int = 1,
) -> tuple[SequencePlan, EventArray, tuple[int, int]]:
    """Draw when a sequence is; return that, its events, and width and height of their picture (px).

    Arguments as `draw_stream`.

    Raises:
        DataError: the recording is too short, or cannot be read.
    """
    with segment.open() as file:
        plan = _plan(segment, rng, net, settings, times)
        end_us = plan.start_us + plan.ends_us(net)[-1] / plan.rate
        events = file.between(int(plan.start_us), int(end_us) + 1)
        return plan, events, file.size_px or _extent(events)


def cut_sequence(
    events: EventArray,
    truth: list[TrueBoxes],
    plan: SequencePlan,
    window: CutOut,
    how: tuple[np.random.Generator, NetSettings, TrainSettings],
) -> Sequence:
    """Return the sequence of a cut-out; arguments as `cut_stream`."""
    return cut_stream(events, truth, plan, window, how).part(0, plan.windows, how[1])


def cut_stream(
    events: EventArray,
    truth: list[TrueBoxes],
    plan: SequencePlan,
    window: CutOut,
    how: tuple[np.random.Generator, NetSettings, TrainSettings],
) -> LongSequence:
    """Return what is seen in a cut-out.

    Args:
        events: of the recording.
        truth: at the end of each window.
        plan: when it is.
        window: the cut-out.
        how: random numbers, the network's settings and those of the training.
    """
    rng, net, settings = how
    own = _changed(_seen_in(events, window), plan, window, rng, settings, plan.ends_us(net)[-1])
    return LongSequence(own, [window.boxes(one) for one in truth], plan, settings.crop_px)


def windows_of(
    events: EventArray, side: tuple[int, int], net: NetSettings, ends: list[int]
) -> list[npt.NDArray[np.uint8]]:
    """Return the windows (2 x bins, H, W) that end at the given times (µs), whole multiples of a bin.

    Args:
        events: from time 0.
        side: width and height (px).
        net: length and number of the bins.
        ends: ascending.
    """
    bins = EventBins(side, net.bins, net.bin_s)
    found = []
    edges = np.searchsorted(events.t_us, np.arange(0, ends[-1] + 1, bins.bin_us))
    for number in range(len(edges) - 1):
        rows = slice(int(edges[number]), int(edges[number + 1]))
        bins.advance(
            EventArray.trusted(events.t_us[rows], events.x[rows], events.y[rows], events.polarity[rows])
        )
        if bins.end_us in ends:
            found.append(bins.stack())
    return found


def _plan(
    segment: EventSegment,
    rng: np.random.Generator,
    net: NetSettings,
    settings: TrainSettings,
    times: int,
) -> SequencePlan:
    """Draw when; the steps as long as the recording lets them be."""
    count = times * settings.steps
    rate = float(np.exp(rng.uniform(-1.0, 1.0) * np.log(settings.events.time_scale)))
    step = int(rng.integers(settings.least_step_bins, settings.most_step_bins + 1))
    place = rng.random()
    bin_us = round(net.bin_s * _US)
    first_us = max(segment.truth.begin_us(net.bins * bin_us / rate), 0.0)
    last_us = segment.truth.times[-1] * _US
    while True:
        length_us = (net.bins + (count - 1) * step) * bin_us / rate
        spare = last_us - first_us - length_us
        if spare >= 0.0:
            start_us = first_us + place * spare
            later_s = segment.truth.to_label_s((start_us + length_us) / _US)
            return SequencePlan(start_us + later_s * _US, rate, step, count)
        if step > settings.least_step_bins:
            step -= 1
        elif rate < settings.events.time_scale:
            rate = settings.events.time_scale
        else:
            raise DataError(
                f"is too short for a sequence: {(last_us - first_us) / _US:.3g} s with truth, and "
                f"{length_us / _US:.3g} s are needed; make longer segments, "
                "or shorter sequences (--set steps=4, stream_steps=2)",
                segment.path,
            )


def _seen_in(events: EventArray, window: CutOut) -> EventArray:
    """Leave out what is certainly not in the cut-out: most of it, and quickly."""
    kept = np.ones(len(events), dtype=bool)
    for place, shift, side in zip((events.x, events.y), (window.left, window.top), window.side, strict=True):
        low, high = -shift / window.scale - 1.0, (side - shift) / window.scale + 1.0
        kept &= (place >= max(math.floor(low), 0)) & (place <= max(math.ceil(high), 0))
    rows = np.flatnonzero(kept)
    return EventArray.trusted(events.t_us[rows], events.x[rows], events.y[rows], events.polarity[rows])


def _changed(
    events: EventArray,
    plan: SequencePlan,
    window: CutOut,
    rng: np.random.Generator,
    settings: TrainSettings,
    length_us: int,
) -> EventArray:
    """Move events into the cut-out and onto the sequence's clock, drop some, and add some from nowhere."""
    changes, (width, height) = settings.events, window.side
    t_us = ((events.t_us - plan.start_us) * plan.rate).astype(np.int64)
    kept = rng.random(len(events), dtype=np.float32) >= rng.uniform(0.0, changes.drop_share)
    x = np.floor((events.x + 0.5) * window.scale + window.left).astype(np.int64)
    y = np.floor((events.y + 0.5) * window.scale + window.top).astype(np.int64)
    if window.mirrored:
        x = width - 1 - x
    kept &= (x >= 0) & (x < width) & (y >= 0) & (y < height)
    more = int(rng.poisson(rng.uniform(0.0, changes.noise_hz_px) * width * height * length_us / _US))
    nowhere = [rng.integers(0, most, more) for most in (length_us, width, height, 2)]
    seen = [t_us[kept], x[kept], y[kept], events.polarity[kept]]
    columns = [_joined(a, b) for a, b in zip(seen, nowhere, strict=True)]
    # Nothing is drawn where nothing is asked for: the same settings then show the same as ever.
    if changes.hot_pixels or changes.lamps:
        beside = draw_disturbances(rng, window.side, length_us, changes)
        columns = [_joined(a, b) for a, b in zip(columns, beside, strict=True)]
    if changes.swap_share and rng.random() < changes.swap_share:
        columns[3] = 1 - columns[3]
    t, x, y, polarity = columns
    order = np.argsort(t, kind="stable")
    return EventArray.trusted(
        t[order],
        x[order].astype(np.uint16),
        y[order].astype(np.uint16),
        polarity[order].astype(np.uint8),
    )


def _joined(a: npt.NDArray[np.integer], b: IntArray) -> IntArray:
    return np.concatenate([a.astype(np.int64), b])


def _extent(events: EventArray) -> tuple[int, int]:
    """Return the smallest picture that holds all events (px)."""
    if not len(events):
        return 1, 1
    return int(events.x.max()) + 1, int(events.y.max()) + 1
