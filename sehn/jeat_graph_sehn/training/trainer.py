"""The training itself: step by step, with averaged weights, and so that a killed one goes on where it was."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor

from jeat_graph.data.errors import DataError
from jeat_graph_sehn.training.batches import Batches, ShownBatch
from jeat_graph_sehn.training.checkpoint import read_checkpoint, write_checkpoint
from jeat_graph_sehn.training.data_sets import Split
from jeat_graph_sehn.training.fused_network import FusedNet
from jeat_graph_sehn.training.judging import judge
from jeat_graph_sehn.training.lasting import Lasting
from jeat_graph_sehn.training.learning import cost_of
from jeat_graph_sehn.training.making import new_network
from jeat_graph_sehn.training.network import DetectionNet, VehicleNet, cell_places
from jeat_graph_sehn.training.settings import BFLOAT16, HOLD_BOXES, HOLD_FIRST, NetSettings, TrainSettings

_CHECKPOINT_S = 60.0
#: Of each cost a sum, and how many steps they are of.
_SUMS = 5
_S_PER_MIN = 60.0


class LogRow(NamedTuple):
    """What the log says of a moment of the training.

    Attributes:
        step: steps so far.
        progress: share of the training.
        learning_rate: now.
        loss: mean since the last row, with its parts:
        loss_scores: of the scores,
        loss_boxes: of the boxes, before their weight,
        loss_spreads: of how far off their sides are said to be.
        ap50: of the averaged weights on what is judged (%).
        ap: mean over thresholds .50 to .95 (%).
    """

    step: int
    progress: float
    learning_rate: float
    loss: float
    loss_scores: float
    loss_boxes: float
    loss_spreads: float
    ap50: float
    ap: float


@dataclass(frozen=True)
class TrainingJob:
    """What is trained, and where it stands.

    Attributes:
        net: what the network looks like.
        settings: how it learns.
        split: what it is shown, and judged by.
        side: width and height that judged pictures are brought to (px).
        device: such as `cpu`.
        checkpoint: where the state is kept.
        identity: what a checkpoint must be of, to be continued.
        start: networks that the first weights are taken from. Their normalisations are settled, and stay so.
    """

    net: NetSettings
    settings: TrainSettings
    split: Split[Any]
    side: tuple[int, int]
    device: str
    checkpoint: Path
    identity: str
    start: tuple[Path, ...] = ()


class Trainer:
    """Trains a network; begins where its checkpoint stands, if there is one.

    Args:
        job: what to do.

    Attributes:
        net: that learns.
        average: averaged weights, which are judged and kept.
        log: rows so far.
        step: steps so far.
        total: steps of the whole training, unless it goes by minutes.

    Raises:
        DataError: the checkpoint is of another training, or damaged.
    """

    def __init__(self, job: TrainingJob) -> None:
        self._job = job
        settings = job.settings
        torch.manual_seed(settings.seed)
        # Channels last: convolutions of few channels are a fifth quicker so on processors.
        net = new_network(job.net, job.start)
        if isinstance(net, FusedNet) and settings.fused.hold_pictures:
            net.hold_pictures()
        if isinstance(net, DetectionNet) and settings.hold == HOLD_FIRST:
            net.hold_first()
        if settings.hold == HOLD_BOXES:
            net.requires_grad_(False)
            net.head.hold_boxes()
        self.net = net.to(job.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.average = copy.deepcopy(self.net).requires_grad_(False)
        self._optimiser = torch.optim.AdamW(
            _groups(self.net, settings), lr=settings.learning_rate, betas=(0.9, 0.99)
        )
        self._places, self._strides = (part.to(job.device) for part in cell_places(settings.crop_px))
        self.step, self.log = 0, list[LogRow]()
        self._batches = Batches(job.split.learned, job.net, settings, job.side)
        self.total = max(math.ceil(settings.epochs * self._batches.per_epoch), 1)
        self._spent_s = 0.0
        self._unsettled = 1.0 - settings.settled_share
        self._sums = [0.0] * _SUMS
        #: What is remembered at the end of the last step, of streams that go on.
        self._remembered: tuple[Tensor, ...] = ()
        if job.checkpoint.is_file():
            self._restore(read_checkpoint(job.checkpoint, job.identity, job.device))

    def run(
        self,
        on_progress: Callable[[float, str], object] = lambda *_: None,
        on_look: Callable[[int, int], object] = lambda *_: None,
    ) -> None:
        """Train to the end.

        Args:
            on_progress: called after each step with the share that is done, and a few words.
            on_look: called while it is judged on the way, as of `judge`.

        Raises:
            DataError: data that cannot be read, or a loss that is no number any more.
        """
        batches = self._batches
        begun = time.monotonic() - self._spent_s
        saved = time.monotonic()
        try:
            while (progress := self.progress) < 1.0:
                self.net.learn(settled=bool(self._job.start) or progress >= self._unsettled)
                self._learn(batches.get(self.step), self._rate(progress))
                self._spent_s = time.monotonic() - begun
                after = self.progress
                every = self._job.settings.judge_every
                judged = after >= 1.0 or math.floor(after / every) > math.floor(progress / every)
                if judged:
                    self._write_row(after, on_look)
                if judged or time.monotonic() - saved > _CHECKPOINT_S:
                    self._spent_s = time.monotonic() - begun
                    write_checkpoint(self._job.checkpoint, self._job.identity, self._state())
                    saved = time.monotonic()
                on_progress(min(after, 1.0), self._words())
        finally:
            batches.close()

    @property
    def progress(self) -> float:
        """Share of the training that is done."""
        minutes = self._job.settings.minutes
        return self.step / self.total if minutes is None else self._spent_s / (minutes * _S_PER_MIN)

    def _rate(self, progress: float) -> float:
        """Learning rate: a straight rise, then half a cosine."""
        s = self._job.settings
        if progress < s.warm_up_share:
            return s.learning_rate * max(progress / s.warm_up_share, s.final_share)
        share = (progress - s.warm_up_share) / (1.0 - s.warm_up_share)
        wave = 0.5 * (1.0 + math.cos(math.pi * min(share, 1.0)))
        return s.learning_rate * (s.final_share + (1.0 - s.final_share) * wave)

    def _learn(self, batch: ShownBatch, rate: float) -> None:
        settings, device = self._job.settings, self._job.device
        for group in self._optimiser.param_groups:
            group["lr"] = rate * group["times"]
        self._optimiser.zero_grad(set_to_none=True)
        state = self._state_before(batch)
        count = len(batch.steps)
        for first in range(0, count, settings.back):
            part = slice(first, first + settings.back)
            length = len(batch.steps[part])
            shown = torch.cat(batch.steps[part]).to(device, memory_format=torch.channels_last)
            targets = [
                type(t)(t.boxes.to(device), t.ignored.to(device))
                for asked in batch.targets[part]
                for t in asked
            ]
            with torch.autocast(device, torch.bfloat16, enabled=settings.precision == BFLOAT16):
                rows, state = self.net(shown, state, length, *batch.seen(part, device))
            state = tuple(one.detach().float() for one in state)
            cost = cost_of(rows.float(), targets, self._places, self._strides, settings.box_weight)
            if not bool(torch.isfinite(cost.total)):
                raise DataError(
                    f"the loss is no number any more at step {self.step}: train with a lower learning rate "
                    "(--set learning_rate=…)"
                )
            share = length / count
            (cost.total * share).backward()  # type: ignore[no-untyped-call]
            for k, value in enumerate(cost):
                self._sums[k] += float(value.detach()) * share
        self._remembered = state if batch.goes_on is not None else ()
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), settings.clip)
        self._optimiser.step()
        self.step += 1
        self._sums[-1] += 1.0
        self._follow()

    def _state_before(self, batch: ShownBatch) -> tuple[Tensor, ...]:
        """Return what is remembered at the beginning of a batch: nothing, but of streams that go on."""
        empty = self.net.empty_state(len(batch.targets[0]), self._job.settings.crop_px)
        if batch.goes_on is None or not self._remembered:
            return empty
        goes_on = batch.goes_on.to(self._job.device)[:, None, None, None]
        return tuple(
            torch.where(goes_on, now, none) for now, none in zip(self._remembered, empty, strict=True)
        )

    @torch.no_grad()
    def _follow(self) -> None:
        """Let the averaged weights follow; at first quickly, or the first weights would stay in them."""
        keep = min(1.0 - 1.0 / self._job.settings.average_steps, (1.0 + self.step) / (10.0 + self.step))
        for mean, now in zip(self.average.state_dict().values(), self.net.state_dict().values(), strict=True):
            if mean.dtype.is_floating_point:
                mean.lerp_(now, 1.0 - keep)
            else:
                mean.copy_(now)

    def _write_row(self, progress: float, on_look: Callable[[int, int], object]) -> None:
        job, steps = self._job, max(self._sums[-1], 1.0)
        most = job.settings.judged
        found = judge(self.average, job.split.judged, job.side, job.settings, most, on_look)["all"]
        loss, scores, boxes, spreads = (value / steps for value in self._sums[:-1])
        # With `minutes` the share is of time, which is never twice the same.
        done = min(progress, 1.0)
        losses = (loss, scores, boxes, spreads)
        self.log.append(LogRow(self.step, done, self._rate(done), *losses, found.ap50, found.ap))
        self._sums = [0.0] * _SUMS

    def _words(self) -> str:
        return f"AP50 {self.log[-1].ap50:.1f}" if self.log else ""

    def words(self) -> str:
        """Say how far it is: steps, the loss since the last look, and what that look found."""
        goal = f" of {self.total}" if self._job.settings.minutes is None else ""
        steps = self._sums[-1]
        loss = self._sums[0] / steps if steps else self.log[-1].loss if self.log else math.nan
        found = f", {self._words()}" if self.log else ""
        return f"step {self.step}{goal}, loss {loss:.3g}{found}"

    def _state(self) -> dict[str, Any]:
        return {
            "step": self.step,
            "spent_s": self._spent_s,
            "sums": list(self._sums),
            "log": [list(row) for row in self.log],
            "net": self.net.state_dict(),
            "average": self.average.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "remembered": list(self._remembered),
        }

    def _restore(self, state: dict[str, Any]) -> None:
        try:
            self.net.load_state_dict(state["net"])
            self.average.load_state_dict(state["average"])
            self._optimiser.load_state_dict(state["optimiser"])
            self._remembered = tuple(state["remembered"])
            self.step, self._spent_s = int(state["step"]), float(state["spent_s"])
            self._sums = [float(value) for value in state["sums"]]
            self.log = [LogRow(int(row[0]), *(float(v) for v in row[1:])) for row in state["log"]]
        except (KeyError, TypeError, ValueError, RuntimeError):
            raise DataError("is damaged; remove it to start over", self._job.checkpoint) from None


def _groups(net: VehicleNet, settings: TrainSettings) -> Sequence[dict[str, Any]]:
    """Weights of convolutions are held small; biases, normalisations and how long a memory lasts are free.

    AdamW moves a weight by the learning rate in a step, whatever the gradient; time constants and gates have
    farther to go than weights, so theirs is a multiple of it.
    """
    lasts = {id(p) for part in net.modules() if isinstance(part, Lasting) for p in part.parameters()}
    learned = [p for p in net.parameters() if p.requires_grad]
    others = [p for p in learned if id(p) not in lasts]
    groups: list[dict[str, Any]] = [
        {"params": [p for p in others if p.ndim > 1], "weight_decay": settings.weight_decay, "times": 1.0},
        {"params": [p for p in others if p.ndim <= 1], "weight_decay": 0.0, "times": 1.0},
    ]
    memory = [p for p in learned if id(p) in lasts]
    if memory:
        groups.append({"params": memory, "weight_decay": 0.0, "times": settings.memory_rate})
    return groups
