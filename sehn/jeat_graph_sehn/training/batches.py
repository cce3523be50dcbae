"""What a step of the training is shown: the same for the same seed and step, whoever asks and when."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as AnySequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.detection.models.feeding import letterbox_scale
from jeat_graph.io.media.decoders import RgbImage
from jeat_graph_sehn.training.data_sets import EventSegment, FusedSegment, Picture
from jeat_graph_sehn.training.event_samples import LongSequence, Sequence, draw_stream
from jeat_graph_sehn.training.fused_network import AVAILABILITY, SeenPictures
from jeat_graph_sehn.training.fused_samples import FusedSequence, draw_fused
from jeat_graph_sehn.training.learning import Target
from jeat_graph_sehn.training.picture_samples import cut_out, draw_light, draw_window
from jeat_graph_sehn.training.settings import FUSED, NetSettings, TrainSettings

#: Tell the random numbers of the order from those of the changes.
_ORDER, _CHANGES = 0, 1
_BYTES_PER_MB = 1e6


class ShownBatch(NamedTuple):
    """What is shown.

    Attributes:
        steps: inputs (B, C, H, W) of the windows in their order, counts as whole numbers; of pictures one.
        targets: of each step, of each of the B.
        pictures: that go with the windows of a network of both sensors, `which` and `given` step by step.
        elapsed_s: (L, B) since the window before each (s), for a memory that goes by time.
        goes_on: (B,) whether each goes on where the batch before ended; None: none does.
    """

    steps: list[Tensor]
    targets: list[list[Target]]
    pictures: SeenPictures | None = None
    elapsed_s: Tensor | None = None
    goes_on: Tensor | None = None

    def seen(self, part: slice, device: str) -> tuple[SeenPictures | Tensor, ...]:
        """Return what goes with the windows of some steps, as the network takes it after them."""
        size = len(self.targets[0])
        rows = slice(part.start * size, part.stop * size)
        beside: tuple[SeenPictures | Tensor, ...] = ()
        if self.pictures is not None:
            kept, which = torch.unique(self.pictures.which[rows], return_inverse=True)
            shown = self.pictures.pictures[kept].to(device, memory_format=torch.channels_last)
            beside = (SeenPictures(shown, which.to(device), self.pictures.given[rows].to(device)),)
        if self.elapsed_s is not None:
            beside = (*beside, self.elapsed_s[part].reshape(-1).to(device))
        return beside


class Batches:
    """Makes batches by their number, the next one while the last one is learned from.

    Args:
        members: pictures, or recordings of events.
        net: what the network takes.
        settings: of the training.
        side: width and height that whole pictures are brought to in use (px); None: as they are.
    """

    def __init__(
        self,
        members: AnySequence[Picture | EventSegment],
        net: NetSettings,
        settings: TrainSettings,
        side: tuple[int, int] | None = None,
    ) -> None:
        self._members, self._net, self._settings, self._side = members, net, settings, side
        by_group: dict[str | int, list[int]] = {}
        for k, member in enumerate(members):
            by_group.setdefault(member.group if settings.by_segment else k, []).append(k)
        self._groups = list(by_group.values())
        self._pool = ThreadPoolExecutor(1)
        self._ahead: tuple[int, Future[ShownBatch]] | None = None
        self._kept: dict[tuple[int, int], RgbImage] = {}
        self._streams: dict[int, LongSequence] = {}
        self._room_bytes = settings.kept_mb * _BYTES_PER_MB

    def close(self) -> None:
        """End the thread that works ahead."""
        self._pool.shutdown(cancel_futures=True)

    @property
    def per_epoch(self) -> float:
        """Steps in which everything was seen once: each picture, or as much time as there is of events."""
        if not isinstance(self._members[0], EventSegment):
            return len(self._members) / self._settings.batch
        seconds = sum(float(np.ptp(m.truth.times)) for m in self._members if isinstance(m, EventSegment))
        mean_bins = (self._settings.least_step_bins + self._settings.most_step_bins) / 2.0
        length = (self._net.bins + (self._settings.steps - 1) * mean_bins) * self._net.bin_s
        return max(seconds / length, len(self._members)) / self._settings.batch

    def get(self, step: int) -> ShownBatch:
        """Return the batch of a step, and begin the next one."""
        ready = (
            self._ahead[1] if self._ahead and self._ahead[0] == step else self._pool.submit(self._make, step)
        )
        self._ahead = (step + 1, self._pool.submit(self._make, step + 1))
        return ready.result()

    def _make(self, step: int) -> ShownBatch:
        size = self._settings.batch
        if self._net.kind == FUSED:
            return _joined([self._fused(step * size + k) for k in range(size)], self._net)
        if isinstance(self._members[0], EventSegment):
            return self._sequences(step)
        parts = [self._cut_out(step * size + k) for k in range(size)]
        return ShownBatch([torch.from_numpy(np.stack([p[0] for p in parts]))], [[p[1] for p in parts]])

    def _sequences(self, step: int) -> ShownBatch:
        """Make a batch of windows of events: parts of streams, then sequences that start over."""
        settings, net = self._settings, self._net
        size = settings.batch
        begun = [stream_begin(step, k, settings) for k in range(size)]
        numbers = [first * size + k for k, first in enumerate(begun)]
        self._streams = {number: one for number, one in self._streams.items() if number in numbers}
        parts = []
        for k, (number, first) in enumerate(zip(numbers, begun, strict=True)):
            if not is_streamed(k, settings):
                parts.append(self._stream(number, 1).part(0, settings.steps, net))
                continue
            if number not in self._streams:
                self._streams[number] = self._stream(number, settings.stream_steps)
            parts.append(self._streams[number].part((step - first) * settings.steps, settings.steps, net))
        windows = np.stack([one.windows for one in parts], axis=1)
        return ShownBatch(
            [torch.from_numpy(one) for one in windows],
            [list(of_step) for of_step in zip(*(_targets(one) for one in parts), strict=True)],
            elapsed_s=_elapsed(parts, net),
            goes_on=torch.tensor([first < step for first in begun]) if settings.stream_share else None,
        )

    def _stream(self, number: int, times: int) -> LongSequence:
        index, rng = self._drawn(number)
        member = self._members[index]
        assert isinstance(member, EventSegment)
        return draw_stream(member, rng, self._net, self._settings, self._side, times)

    def _drawn(self, number: int) -> tuple[int, np.random.Generator]:
        """Return the member of a cut-out or sequence, and its random numbers."""
        seed, count = self._settings.seed, len(self._groups)
        order = np.random.default_rng([seed, _ORDER, number // count]).permutation(count)
        rng = np.random.default_rng([seed, _CHANGES, number])
        group = self._groups[int(order[number % count])]
        return group[int(rng.integers(len(group))) if len(group) > 1 else 0], rng

    def _fused(self, number: int) -> FusedSequence:
        index, rng = self._drawn(number)
        member = self._members[index]
        assert isinstance(member, FusedSegment)

        def picture(frame: int) -> RgbImage:
            return self._picture((index, frame), lambda: member.picture(frame))

        return draw_fused(member, rng, self._net, self._settings, picture, self._side)

    def _cut_out(self, number: int) -> tuple[npt.NDArray[np.float32], Target]:
        index, rng = self._drawn(number)
        member = self._members[index]
        assert isinstance(member, Picture)
        changes = self._settings.pictures
        frame = self._picture((index, 0), member.load)
        shares = (changes.zoom, changes.mirror_share, changes.on_box_share)
        size_px = (frame.shape[1], frame.shape[0])
        served = letterbox_scale(size_px, self._side or size_px)
        window = draw_window(rng, size_px, self._settings.crop_px, member.truth, shares, served)
        light = draw_light(rng, changes)
        # Nothing is drawn where no share is asked for: the same settings then show the same as ever.
        cluttered = changes.clutter_share > 0.0 and rng.random() < changes.clutter_share
        shown = cut_out(frame, window, rng, light, member.truth if cluttered else None)
        return shown, _target(*window.boxes(member.truth))

    def _picture(self, key: tuple[int, int], load: Callable[[], RgbImage]) -> RgbImage:
        """Return a picture; those that were read are kept as long as there is room: reading takes longest."""
        if key in self._kept:
            return self._kept[key]
        frame = load()
        if frame.nbytes <= self._room_bytes:
            self._room_bytes -= frame.nbytes
            self._kept[key] = frame
        return frame


def is_streamed(place: int, settings: TrainSettings) -> bool:
    """Return whether a batch's sequence at a place goes on from step to step: the first ones do."""
    return place < round(settings.stream_share * settings.batch)


def stream_begin(step: int, place: int, settings: TrainSettings) -> int:
    """Return at which step the sequence began that a batch has at a place.

    Streams begin one after the other, so that in each step some are young and some are old.
    """
    if not is_streamed(place, settings):
        return step
    length, count = settings.stream_steps, round(settings.stream_share * settings.batch)
    shift = place * length // count
    return max((step + shift) // length * length - shift, 0)


def _elapsed(parts: AnySequence[Sequence], net: NetSettings) -> Tensor | None:
    """Return times (L, B) since the window before each (s), if the network takes them."""
    if not net.by_time:
        return None
    return torch.tensor([one.elapsed_s for one in parts], dtype=torch.float32).T


def _joined(drawn: AnySequence[FusedSequence], net: NetSettings) -> ShownBatch:
    """Put sequences side by side: step by step, as the network takes them."""
    windows = np.stack([one.events.windows for one in drawn], axis=1)
    first = np.cumsum([0, *(len(one.pictures) for one in drawn)])
    which = np.stack([one.which + k for one, k in zip(drawn, first[:-1], strict=True)], axis=1)
    seen = SeenPictures(
        torch.from_numpy(np.concatenate([one.pictures for one in drawn])),
        torch.from_numpy(which.reshape(-1)),
        torch.from_numpy(np.stack([one.given for one in drawn], axis=1).reshape(-1, AVAILABILITY)),
    )
    targets = [list(of_step) for of_step in zip(*(_targets(one.events) for one in drawn), strict=True)]
    passed = _elapsed([one.events for one in drawn], net)
    return ShownBatch([torch.from_numpy(step) for step in windows], targets, seen, passed)


def _targets(drawn: Sequence) -> list[Target]:
    return [_target(*pair) for pair in zip(drawn.corners, drawn.ignored, strict=True)]


def _target(corners: FloatArray, ignored: BoolArray) -> Target:
    boxes = torch.from_numpy(corners.astype(np.float32))
    flags = torch.from_numpy(ignored)
    return Target(boxes[~flags], boxes[flags])
