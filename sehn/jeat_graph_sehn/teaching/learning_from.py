"""A network learns from a lesson: fine-tuned with some of what it knew before, judged, kept or refused."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.config.section_tree import build
from jeat_graph.data.errors import ConfigError
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.version import __version__
from jeat_graph_sehn.teaching.drawn_truth import DrawnTruth
from jeat_graph_sehn.teaching.gain import Held, TeachingOutcome, compared
from jeat_graph_sehn.teaching.labels import TrackLabels
from jeat_graph_sehn.teaching.lesson import Lesson
from jeat_graph_sehn.teaching.recordings import EventRecording, StoredPicture, store_frames
from jeat_graph_sehn.teaching.stills import MOST_PICTURES, stills_of
from jeat_graph_sehn.training.batches import Batches
from jeat_graph_sehn.training.data_sets import (
    EventSegment,
    Picture,
    Split,
    read_event_segments,
    read_pictures,
    split_by_segment,
)
from jeat_graph_sehn.training.export import write_onnx
from jeat_graph_sehn.training.judging import Precision, judge
from jeat_graph_sehn.training.labelled_sets import LabelledSegment
from jeat_graph_sehn.training.making import card_of, looks_twice, new_network, settings_of
from jeat_graph_sehn.training.network import VehicleNet
from jeat_graph_sehn.training.resizing import input_side
from jeat_graph_sehn.training.settings import FRAMES, FUSED, NetSettings, TrainSettings
from jeat_graph_sehn.training.trainer import Trainer, TrainingJob
from jeat_graph_sehn.training.truth_at import TruthByTime

#: Name of what is taught, among data sets.
TAUGHT = "taught"
#: What differs from how the network was trained: it is only to be changed a little.
FINE_TUNING: dict[str, Any] = {
    "learning_rate": 3e-4,
    "average_steps": 100.0,
    "warm_up_share": 0.1,
    "minutes": None,
    "precision": "float32",
    "judge_every": 1.0,
    "judged": 1,
    "far_px": None,
    "by_segment": False,
}
#: The held-back part is judged in so many pieces, whose differences tell how sure a gain is.
PIECES = 8
#: Old worlds are judged by at most so many windows or pictures.
OLD_LOOKS = 200


@dataclass(frozen=True)
class TeachRequest:
    """What is taught to whom.

    Attributes:
        lesson: labels.
        start: the network's file.
        out: the taught network's file.
        events: the events, or
        video: the pictures, of the sensor that learns.
        cache: folder for what is made on the way.
        old: data sets of what the network has learned before; may be none.
        about: what the card says of the recording.
        overrides: changes to the settings of the training.
        steps: of the training.
        old_share: share of what is shown that is of old worlds.
        seed: of the draws.
        looks: windows or pictures, at most, in which each of the held-back pieces is judged.
    """

    lesson: Lesson
    start: Path
    out: Path
    cache: Path
    events: EventRecording | None = None
    video: Path | None = None
    old: tuple[Path, ...] = ()
    about: dict[str, Any] = field(default_factory=dict)
    overrides: dict[str, Any] = field(default_factory=dict)
    steps: int = 300
    old_share: float = 0.3
    seed: int = 0
    looks: int = 50


class Taught(NamedTuple):
    """What came out; nothing is written yet.

    Attributes:
        net: the taught network.
        outcome: before and after.
        card: what its file will say.
    """

    net: VehicleNet
    outcome: TeachingOutcome
    card: dict[str, Any]


def check_teachable(path: Path, kind: str) -> NetSettings:
    """Return what a network looks like, if it can learn.

    Raises:
        ConfigError: it is of another kind, of both sensors, or of 8-bit numbers.
        DataError: `train` did not make it.
    """
    net = settings_of(path)
    if net.kind == FUSED:
        raise ConfigError(f"--detector: {path.name} is of both sensors; `teach` is for networks of one")
    if net.kind != kind:
        raise ConfigError(f"--detector: {path.name} is of {net.kind}, and the recording is of {kind}")
    if "int8" in card_of(path):
        raise ConfigError(
            f"--detector: {path.name} has 8-bit numbers, which cannot learn: teach the network that it was "
            "made of, then quantise that (train --int8)"
        )
    return net


def settings_for(card: dict[str, Any], overrides: dict[str, Any], seed: int) -> TrainSettings:
    """Return how a network goes on learning: as it was trained, but gently.

    Args:
        card: of the network.
        overrides: changes by the user.
        seed: of the draws.

    Raises:
        ConfigError: a change that is not valid.
    """
    known = {one.name for one in dataclasses.fields(TrainSettings)}
    tree = {key: value for key, value in dict(card.get("settings", {})).items() if key in known}
    tree |= FINE_TUNING | {"seed": seed}
    for key, value in overrides.items():
        tree[key] = {**tree[key], **value} if isinstance(value, dict) and key in tree else value
    built: TrainSettings = build(TrainSettings, tree, "")
    return built


def teach(
    request: TeachRequest,
    say: Callable[[str], object] = lambda _: None,
    on_progress: Callable[[float, str], object] = lambda *_: None,
) -> Taught:
    """Fine-tune a network on a lesson, and judge it before and after; a killed one goes on where it was.

    Args:
        request: what to do.
        say: called with what was found out.
        on_progress: called after each step with the share that is done, and a few words.

    Raises:
        ConfigError: a network that cannot learn, or settings that are not valid.
        DataError: something cannot be read.
        OtherRunError: the checkpoint beside `out` is of other teaching.
    """
    kind = FRAMES if request.video is not None else "events"
    net, card = check_teachable(request.start, kind), card_of(request.start)
    settings = settings_for(card, request.overrides, request.seed)
    settings = dataclasses.replace(settings, second_look=looks_twice(request.start))
    side = input_side(request.start)
    own, held = _learned(request), _held(request)
    old = _old(request)
    members = mixed(own, old.learned, request.old_share)
    split = Split[Any](members, held[:1], "")
    settings = dataclasses.replace(settings, epochs=_epochs(members, net, settings, request.steps))
    about = {
        "version": __version__,
        "kind": kind,
        "net": asdict(net),
        "settings": asdict(settings),
        "side": list(side),
        "start": [{"name": request.start.name, "sha256": sha256_of(request.start)}],
        "taught": {**request.about, "labels": [labels.digest() for labels in request.lesson.parts]},
        "old": [_described(path) for path in request.old],
        "old_share": request.old_share,
    }
    start = new_network(net, (request.start,))
    say("judges the network as it is")
    before = _judged(start, held, side, settings, request.looks)
    old_before = _old_ap(start, old, side, settings)
    say(f"AP50 {before.all:.1f} on what is held back; {request.steps} steps of training")
    identity = json.dumps(about, sort_keys=True)
    checkpoint = request.out.with_suffix(".checkpoint")
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    job = TrainingJob(net, settings, split, side, "cpu", checkpoint, identity, (request.start,))
    trainer = Trainer(job)
    if trainer.step:
        say(f"goes on from step {trainer.step} of {checkpoint}")
    trainer.run(on_progress)
    say("judges the taught network")
    after = _judged(trainer.average, held, side, settings, request.looks)
    outcome = compared(before, after, old_before, _old_ap(trainer.average, old, side, settings))
    figures = {name: _figure(value) for name, value in outcome._asdict().items()}
    return Taught(trainer.average, outcome, {**about, "steps": trainer.step, "outcome": figures})


def write_taught(taught: Taught, request: TeachRequest) -> None:
    """Write a taught network.

    Raises:
        ConfigError: the package `onnx` is not installed.
    """
    twice = looks_twice(request.start)
    write_onnx(taught.net, input_side(request.start), taught.card, request.out, second_look=twice)


def mixed(own: Sequence[Any], old: Sequence[Any], old_share: float) -> list[Any]:
    """Return members so often that those of old worlds are drawn in the share asked for.

    Args:
        own: of the own road; at least one.
        old: of old worlds; may be none.
        old_share: below 1.
    """
    if not old or old_share <= 0.0:
        return list(own)
    # How often an old one is there for each time that an own one is.
    ratio = old_share / (1.0 - old_share) * len(own) / len(old)
    return list(own) * max(round(1.0 / ratio), 1) + list(old) * max(round(ratio), 1)


def _learned(request: TeachRequest) -> list[EventSegment] | list[Picture]:
    labels = request.lesson.parts.learned
    if request.video is not None:
        return _pictures(request, labels, TAUGHT)
    return [_segment(request, DrawnTruth(labels, request.seed), TAUGHT)]


def _held(request: TeachRequest) -> list[Any]:
    """Return the held-back part in pieces, each a data set by itself."""
    labels, (begin, end) = request.lesson.parts.judged, request.lesson.division.judged
    edges = np.linspace(begin, end, PIECES + 1)
    found: list[Any] = []
    for k in range(PIECES):
        piece = labels.between(float(edges[k]), float(edges[k + 1]))
        if not len(piece.truth.frame_times()):
            continue
        name = f"held back {k}"
        if request.video is not None:
            found += _pictures(request, piece, name, request.looks)
        else:
            found.append(_segment(request, TruthByTime(piece.truth), name))
    return found


def _segment(request: TeachRequest, truth: TruthByTime, name: str) -> EventSegment:
    assert request.events is not None
    path = request.events.path
    return LabelledSegment(name, name, path, truth, size_px=request.events.size_px)


def _pictures(
    request: TeachRequest, labels: TrackLabels, name: str, most: int = MOST_PICTURES
) -> list[Picture]:
    assert request.video is not None
    stills = stills_of(labels, request.video, most)
    paths = store_frames(request.video, stills.numbers, request.cache / "pictures")
    truth = DrawnTruth(labels, request.seed) if name == TAUGHT else stills.truth
    return [
        Picture(name, name, StoredPicture(path), truth.at(t))
        for path, t in zip(paths, stills.times.tolist(), strict=True)
    ]


def _described(path: Path) -> dict[str, str]:
    """Return what identifies a data set: its name, and the checksum of its manifest."""
    manifest = path / "manifest.json"
    return {"name": path.name, **({"sha256": sha256_of(manifest)} if manifest.is_file() else {})}


def _old(request: TeachRequest) -> Split[Any]:
    """Return what of old worlds is learned from, and what is judged."""
    read: Any = read_pictures if request.video is not None else read_event_segments
    members = [member for path in request.old for member in read(path)]
    return split_by_segment(members, request.old) if members else Split([], [], "")


def _epochs(members: Sequence[Any], net: NetSettings, settings: TrainSettings, steps: int) -> float:
    """Return in how many epochs a training has so many steps; half a step less, for it is rounded up."""
    batches = Batches(members, net, settings)
    batches.close()
    return (steps - 0.5) / batches.per_epoch


def _judged(
    net: VehicleNet, held: Sequence[Any], side: tuple[int, int], settings: TrainSettings, looks: int
) -> Held:
    found = judge(net, held, side, settings, PIECES * looks)
    names = list(dict.fromkeys(member.source for member in held))
    pieces: list[Precision] = [found[name] for name in names if name in found]
    boxes = np.array([float(one.boxes) for one in pieces])
    return Held(found["all"].ap50, np.array([one.ap50 for one in pieces]), boxes)


def _old_ap(net: VehicleNet, old: Split[Any], side: tuple[int, int], settings: TrainSettings) -> float:
    return judge(net, old.judged, side, settings, OLD_LOOKS)["all"].ap50 if old.judged else math.nan


def _figure(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 2)
