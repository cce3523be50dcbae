"""From folders of data to a network in a file: what `jeat-graph train` does."""

from __future__ import annotations

import json
import math
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
import yaml

from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.version import __version__
from jeat_graph_sehn.training.coco_pictures import read_coco_pictures
from jeat_graph_sehn.training.data_sets import (
    EventSegment,
    Picture,
    Split,
    read_event_segments,
    read_fused_segments,
    read_pictures,
    split_by_segment,
)
from jeat_graph_sehn.training.export import write_onnx
from jeat_graph_sehn.training.judging import Precision, judge
from jeat_graph_sehn.training.labelled_sets import (
    described_labels,
    forget_converted,
    holds_labels,
    read_labelled_segments,
)
from jeat_graph_sehn.training.log_files import draw_log, write_log
from jeat_graph_sehn.training.making import looks_twice, settings_of
from jeat_graph_sehn.training.quantising import MOST_LOOKS, write_int8
from jeat_graph_sehn.training.resizing import input_side, resized
from jeat_graph_sehn.training.settings import (
    COARSEST,
    EVENTS,
    FRAMES,
    FUSED,
    HOLD_BOXES,
    HOLD_FIRST,
    NetSettings,
    TrainSettings,
    padded,
)
from jeat_graph_sehn.training.telling import StepsToGo, Telling
from jeat_graph_sehn.training.trainer import Trainer, TrainingJob

_JSON = ".json"
_MANIFEST, _SETTINGS = "manifest.json", "settings.yaml"
_ALL = 1_000_000


@dataclass(frozen=True)
class TrainRequest:
    """What is to be trained.

    Attributes:
        data: data sets to learn from: folders as `simulate` writes them, for pictures also COCO files.
        out: the ONNX file; log, plot and checkpoint stand beside it.
        net: what the network looks like.
        settings: how it learns.
        tested: data sets to judge the finished network by; nothing is learned from them.
        pictures: where the names in COCO files begin, if not beside them.
        side: width and height of the network's input (px); None: the first picture's, rounded up.
        device: `auto`, `cpu` or `cuda`.
        start: networks that `train` made, which the first weights are taken from.
        force: write also what learned nothing.
    """

    data: tuple[Path, ...]
    out: Path
    net: NetSettings = field(default_factory=NetSettings)
    settings: TrainSettings = field(default_factory=TrainSettings)
    tested: tuple[Path, ...] = ()
    pictures: Path | None = None
    side: tuple[int, int] | None = None
    device: str = "auto"
    start: tuple[Path, ...] = ()
    force: bool = False


@dataclass(frozen=True)
class Trained:
    """What came out.

    Attributes:
        files: written, the network first; none where nothing was learned: then the checkpoint is still there.
        card: what stands in the network's file.
    """

    files: tuple[Path, ...]
    card: dict[str, Any]


def train(
    request: TrainRequest,
    say: Callable[[str], object] = lambda _: None,
    on_progress: Callable[[float, str], object] = lambda *_: None,
) -> Trained:
    """Train a network and write it; a training that was killed goes on where it was.

    With `epochs`, the same request gives the same bytes on the same machine, killed in between or not.

    Args:
        request: what to do.
        say: called with what was found out.
        on_progress: called after each step with the share that is done, and a few words.

    Raises:
        ConfigError: no GPU where one is asked for.
        DataError: data that cannot be read, or do not fit.
        OtherRunError: the checkpoint beside `out` is of another training.
    """
    telling = Telling(say)
    log, plot = request.out.with_suffix(".csv"), request.out.with_suffix(".png")
    checkpoint = request.out.with_suffix(".checkpoint")
    device = _device(request.device)
    _check_kind(request)
    _check_fused(request)
    members = _read(request, request.data, on_read=telling.tell)
    split = _asking_far(request, split_by_segment(members, request.data))
    side = request.side or _side(members[0])
    _check_side(side, request.settings.second_look)
    unit = "pictures" if request.net.kind == FRAMES else "recordings"
    say(f"{len(split.learned)} {unit} to learn from, {len(split.judged)} to judge by; {split.note}")
    tests = _read(request, request.tested, on_read=telling.tell) if request.tested else []
    shown = {str(path.resolve()) for path in request.data} & {str(path.resolve()) for path in request.tested}
    if shown:
        raise DataError("is learned from; it cannot be the test as well", sorted(shown)[0])
    about = {
        "version": __version__,
        "kind": request.net.kind,
        "net": asdict(request.net),
        "settings": asdict(request.settings),
        "side": list(side),
        "data": [_described(path) for path in request.data],
    }
    if request.start:
        about["start"] = [_described(path) for path in request.start]
    identity = json.dumps(about, sort_keys=True)
    request.out.parent.mkdir(parents=True, exist_ok=True)
    trainer = Trainer(
        TrainingJob(request.net, request.settings, split, side, device, checkpoint, identity, request.start)
    )
    if trainer.step:
        say(f"goes on from step {trainer.step} of {checkpoint}")
    count = sum(p.numel() for p in trainer.net.parameters())
    say(f"network of {count} parameters, input {side[0]} x {side[1]} px, on {device}")
    say(_plan(request.settings, trainer.total, request.net))
    telling = Telling(say)
    to_go = StepsToGo(telling, trainer.progress)

    def step_done(share: float, words: str) -> None:
        to_go.tell(share, trainer.words())
        on_progress(share, words)

    def looked_on_the_way(done: int, of: int) -> None:
        to_go.tell(trainer.progress, f"{trainer.words()}, judging {done} of {of} {unit}")

    def looked(done: int, of: int) -> None:
        telling.tell(f"judging {done} of {of} {unit}")

    trainer.run(step_done, looked_on_the_way)
    card = {**about, "parameters": count, "steps": trainer.step, "split": split.note}
    say(f"judging by {len(split.judged)} {unit}")
    card["judged"] = _table(judge(trainer.average, split.judged, side, request.settings, _ALL, looked))
    if card["judged"]["all"]["AP50"] == 0.0 and not request.force:
        return Trained((), card)
    if tests:
        say(f"judging by {len(tests)} {unit} of {', '.join(path.name for path in request.tested)}")
        card["tested_on"] = [_described(path) for path in request.tested]
        card["tested"] = _table(judge(trainer.average, tests, side, request.settings, _ALL, looked))
    write_log(trainer.log, log)
    draw_log(trainer.log, plot)
    write_onnx(trainer.average, side, card, request.out, second_look=request.settings.second_look)
    checkpoint.unlink(missing_ok=True)
    forget_converted(_cache(request))
    return Trained((request.out, log, plot), card)


def bring_to_int8(source: Path, request: TrainRequest, say: Callable[[str], object] = lambda _: None) -> int:
    """Write a network of 8-bit numbers, by what it sees of the data that a request learns from.

    Args:
        source: a network that `train` made.
        request: data and the file to write, and the input's size if it shall be another; nothing is learned.
        say: called with what is done.

    Returns:
        How many pictures or windows it has looked at.

    Raises:
        ConfigError: a package is missing, or the network is of another kind than the request.
        DataError: data or network that cannot be read.
    """
    kind = settings_of(source).kind
    if kind != request.net.kind:
        raise ConfigError(f"--int8: the network is of {kind}, not of {request.net.kind}")
    side = request.side or input_side(source)
    twice = request.settings.second_look or (request.side is None and looks_twice(source))
    _check_side(side, twice)
    split = split_by_segment(_read(request, request.data, on_read=Telling(say).tell), request.data)
    about = [_described(path) for path in request.data]
    unit = "pictures" if kind == FRAMES else "recordings"
    say(f"looks at {MOST_LOOKS} {unit} at most, of {len(split.learned)}, then writes")
    with tempfile.TemporaryDirectory() as folder:
        sized = resized(source, side, Path(folder) / source.name, twice)
        looks = write_int8(sized, split.learned, about, request.out)
    forget_converted(_cache(request))
    return looks


def _check_kind(request: TrainRequest) -> None:
    """Refuse what has no meaning for a network of its kind, or without one to start from."""
    if request.net.kind != EVENTS and request.settings.stream_share > 0.0:
        raise ConfigError("stream_share: only networks of events learn from streams")
    hold = request.settings.hold
    if hold == HOLD_FIRST and (request.net.kind == FUSED or not request.start):
        raise ConfigError("hold=first: give the network of one sensor whose layers shall stay (--start)")
    if hold == HOLD_BOXES and not request.start:
        raise ConfigError("hold=boxes: give the network whose boxes shall stay as they are (--start)")
    if hold == HOLD_BOXES and not request.net.spreads:
        raise ConfigError("hold=boxes: with net.spreads=false nothing is left to learn")


def _check_fused(request: TrainRequest) -> None:
    """Refuse to hold what nothing was put into, and what has no meaning for a network of both sensors."""
    if request.net.kind != FUSED:
        return
    if request.settings.pictures.clutter_share > 0.0:
        raise ConfigError(
            "pictures.clutter_share: shapes are drawn for networks of pictures alone; no event shows them"
        )
    if not request.settings.fused.hold_pictures:
        return
    if not any(settings_of(path).kind in (FRAMES, FUSED) for path in request.start):
        raise ConfigError(
            "fused.hold_pictures: give the network of pictures, or of both, that it shall stay (--start)"
        )


def _check_side(side: tuple[int, int], second_look: bool) -> None:
    """Refuse an input that cannot be divided as the network does."""
    least = COARSEST * (2 if second_look else 1)
    if any(one % least for one in side):
        raise ConfigError(f"--size: {side[0]}x{side[1]} must be whole multiples of {least} px")


def _asking_far(request: TrainRequest, split: Split[Any]) -> Split[Any]:
    """Let what is learned ask for far vehicles, if it shall; what is judged stays as the truth has it."""
    far_px = request.settings.far_px
    if far_px is None:
        return split
    groups = {member.group for member in split.learned}
    asking = [member for member in _read(request, request.data, far_px) if member.group in groups]
    return replace(split, learned=asking)


def _plan(settings: TrainSettings, steps: int, net: NetSettings) -> str:
    """Say what will be done."""
    shown = "cut-outs" if net.kind == FRAMES else f"sequences of {settings.steps} windows"
    width, height = settings.crop_px
    size = f"{settings.batch} {shown} of {width} x {height} px a step"
    if settings.minutes is not None:
        return f"trains for {settings.minutes:g} min, {size}"
    looks = math.ceil(1.0 / settings.judge_every)
    return f"trains for {steps} steps ({settings.epochs:g} epochs), {size}; judged {looks} times on the way"


def _cache(request: TrainRequest) -> Path:
    """Return the folder for recordings that are converted for the time of the training."""
    return request.out.with_suffix(".events")


def _read(
    request: TrainRequest,
    paths: Sequence[Path],
    far_px: float | None = None,
    on_read: Callable[[str], object] = lambda _: None,
) -> Any:
    """Return pictures or recordings of all data sets.

    Raises:
        ConfigError: something is asked of labels that they do not say.
        DataError: a data set is not what it should be, or two have one name.
    """
    found: list[Any] = []
    for path in paths:
        if request.net.kind == FUSED:
            found += read_fused_segments(path, far_px, on_read)
        elif request.net.kind != FRAMES and holds_labels(path):
            if far_px is not None:
                raise ConfigError("far_px: labels say nothing of far vehicles; simulated data do")
            found += read_labelled_segments(path, request.settings.labels, _cache(request), on_read)
        elif request.net.kind != FRAMES:
            found += read_event_segments(path, far_px, on_read)
        elif path.suffix.lower() == _JSON:
            found += read_coco_pictures(path, request.pictures, on_read)
        else:
            found += read_pictures(path, far_px, on_read)
    names = Counter(path.stem if path.suffix.lower() == _JSON else path.name for path in paths)
    name, times = names.most_common(1)[0]
    if times > 1:
        raise DataError(
            f"{times} data sets are called {name}; their results could not be distinguished", name
        )
    return found


def _side(member: Picture | EventSegment) -> tuple[int, int]:
    """Return the width and height (px) that hold the first picture."""
    if isinstance(member, Picture):
        height, width = member.load().shape[:2]
        return padded((width, height))
    with member.open() as file:
        if file.size_px is None:
            raise DataError("does not say the size of its picture; give it with --size WxH", member.path)
        return padded(file.size_px)


def _device(asked: str) -> str:
    if asked == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    if asked == "cuda" and not torch.cuda.is_available():
        raise ConfigError("--device cuda: PyTorch finds no GPU here")
    return asked


def _described(path: Path) -> dict[str, Any]:
    """Return what a data set is: its name, its checksum, and seed and world of a simulated one."""
    if path.is_file():
        return {"name": path.name, "sha256": sha256_of(path)}
    found: dict[str, Any] = {"name": path.name}
    if not (path / _MANIFEST).is_file() and holds_labels(path):
        found["sha256 of labels"] = described_labels(path)
    for name in (_MANIFEST, _SETTINGS):
        if (path / name).is_file():
            found[f"sha256 of {name}"] = sha256_of(path / name)
    if (path / _SETTINGS).is_file():
        try:
            tree = load_yaml((path / _SETTINGS).read_text(encoding="utf-8"))
            source = tree["source"]
            found |= {key: source[key] for key in ("source", "seed", "world", "frames") if key in source}
        except (yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError):
            raise DataError("cannot be read", path / _SETTINGS) from None
    return found


def _table(found: dict[str, Precision]) -> dict[str, dict[str, float | int | None]]:
    """Return precisions as the card has them: to a hundredth of a per cent, null where there are no boxes."""
    return {
        name: {
            "AP50": round(one.ap50, 2) if one.boxes else None,
            "AP": round(one.ap, 2) if one.boxes else None,
            "boxes": one.boxes,
        }
        for name, one in found.items()
    }
