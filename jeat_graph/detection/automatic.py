"""Chooses what finds vehicles in pictures where nobody says: by a look at the first seconds.

Known networks that are on this machine, and the package's own `sehn`, look at some of the pictures. Of the
former only those boxes count that are more likely real than not (`even_score`). A box is *sound* where
something moves in it, or where the network is sure. A network is trusted if most of its boxes are sound and
it sees some of what moves; of those the one that finds most is taken. Otherwise `motion` is. Who tracks wants
classes, so a network that knows none has to find half as much again, and of its boxes only those count in
which something moves: on a gantry it would win by ghosts. Nothing is fetched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.detection.frame_source import frames_of
from jeat_graph.detection.known_networks import KNOWN
from jeat_graph.detection.models.pictures import ModelPictureDetector
from jeat_graph.detection.named import AUTO, FRAMES, MOTION, networks
from jeat_graph.detection.network_cache import cache_folder, cached
from jeat_graph.detection.opencv_threads import one_thread
from jeat_graph.detection.picture_detector import PictureDetector
from jeat_graph.detection.request import DetectRequest
from jeat_graph.detection.settings import DetectionSettings, PictureSettings
from jeat_graph.io.media.video import FrameSource, RgbImage

#: The network of the package that is tried: it knows highways.
HIGHWAYS = "sehn"
#: How much of a recording is looked at (s), pictures for what moves there, and those that networks look at.
SAMPLE_S = 3.0
PICTURES, _SAMPLED = 25, 6
#: A box is sound if this share of it moves, or from this score on.
_MOVING, _SURE = 0.3, 0.5
#: A network is trusted if this share of its boxes is sound, it has so many a picture, and sees this share of
#: the area that moves.
_LEAST_SOUND, _LEAST_BOXES, _LEAST_SEEN = 0.6, 0.3, 0.1
#: Of networks that find nearly as many, the better one on COCO is taken.
_NEARLY = 0.75
#: What a box is counted for that has no class, beside one that has.
_WITHOUT_CLASS = 2.0 / 3.0


class Impression(NamedTuple):
    """What a detector makes of the first pictures.

    Attributes:
        name: of the detector.
        boxes: a picture.
        sound: share of its boxes in which something moves, or of which it is sure.
        seen: share of what moves, by area, that lies in its boxes; 1 where nothing moves.
        accuracy: AP on COCO (per cent), 0 where it is not of COCO.
        moving: share of its boxes in which something moves.
        classes: whether it tells classes.
    """

    name: str
    boxes: float
    sound: float
    seen: float
    accuracy: float = 0.0
    moving: float = 1.0
    classes: bool = True

    @property
    def finds(self) -> float:
        """How many things it finds a picture, as they are counted for its choice."""
        if self.classes:
            return self.boxes * self.sound
        return self.boxes * min(self.sound, self.moving) * _WITHOUT_CLASS

    @property
    def trusted(self) -> bool:
        """Whether its boxes are mostly sound, and of what moves there."""
        return self.boxes >= _LEAST_BOXES and self.sound >= _LEAST_SOUND and self.seen >= _LEAST_SEEN

    def __str__(self) -> str:
        return (
            f"{self.name} {self.boxes:.1f} boxes a picture, {100 * self.sound:.0f} % sound, sees "
            f"{100 * self.seen:.0f} % of what moves{'' if self.classes else ', tells no classes'}"
        )


def resolved(request: DetectRequest, say: Callable[[str], object] = lambda _: None) -> DetectRequest:
    """Return a request of which the detector of frames is known, and say how it was chosen.

    Args:
        request: what to do; where its detector of frames is not `auto`, it comes back as it is.
        say: called with a line that says what was chosen, and why.

    Raises:
        ConfigError: classes are asked for that nothing here knows.
        DataError: the frames cannot be read.
    """
    if request.detector_frames != AUTO:
        return request
    if request.frames is None or request.detector_fused is not None:
        return replace(request, detector_frames=MOTION)
    with ExitStack() as stack:
        stack.enter_context(one_thread())
        source = stack.enter_context(frames_of(request))
        return replace(request, detector_frames=chosen_by(*_first(source), request.settings, say))


def chosen_by(
    frames: Sequence[RgbImage],
    times_s: FloatArray,
    settings: DetectionSettings,
    say: Callable[[str], object] = lambda _: None,
    convinced: Callable[[str], object] = lambda _: None,
) -> str:
    """Return the name of the detector to take, by pictures of some seconds, and say how it was chosen.

    Args:
        frames: pictures (H, W, 3).
        times_s: (F,) their times (s), ascending.
        settings: of the detectors.
        say: called with a line that says what was chosen, and why.
        convinced: called with the name if there was something to choose by.

    Raises:
        ConfigError: classes are asked for that nothing here knows.
    """
    moving = _moving(frames, times_s, settings.frames)
    sampled = np.unique(np.linspace(0, len(frames) - 1, min(_SAMPLED, len(frames))).round().astype(int))
    pictures = [(frames[k], moving[k]) for k in sampled.tolist()]
    found = []
    for name, model, accuracy in _candidates(settings, say):
        try:
            found.append(_impression(name, model, accuracy, pictures))
        except DataError as error:  # a network that does not work here is none
            say(str(error))
    anything_moves = any(len(boxes) for boxes in moving)
    chosen = choose_among(found, anything_moves)
    if chosen == MOTION and settings.model_frames.classes:
        raise ConfigError(
            "--class: no detector here that can be trusted knows classes; --detector-frames NAME"
        )
    tried = "; ".join(str(one) for one in found) or "no network of road users is on this machine"
    if anything_moves or any(one.trusted for one in found):
        convinced(chosen)
    say(f"detector: {chosen}, by the first {SAMPLE_S:g} s ({tried}); --detector-frames NAME takes another")
    if chosen == MOTION:
        say("what moves is found, be it a vehicle or not, and what stands is not: a network is better")
    return chosen


def choose_among(found: Sequence[Impression], anything_moves: bool) -> str:
    """Return the name of the detector to take.

    Args:
        found: what the networks made of the pictures.
        anything_moves: whether anything moved there.
    """
    trusted = [one for one in found if one.trusted]
    if not trusted:
        # An empty road contradicts nobody: a network that somebody has put there will see what comes.
        silent = [one for one in found if one.accuracy and not one.boxes]
        if anything_moves or not silent:
            return MOTION
        return max(silent, key=lambda one: one.accuracy).name
    most = max(one.finds for one in trusted)
    near = [one for one in trusted if one.finds >= _NEARLY * most]
    return max(near, key=lambda one: (one.accuracy, one.boxes)).name


def _first(source: FrameSource) -> tuple[list[RgbImage], FloatArray]:
    """Return pictures of the first seconds and their times (s)."""
    count = int(np.searchsorted(source.times_s, source.times_s[0] + SAMPLE_S, side="right"))
    chosen = np.unique(np.linspace(0, count - 1, min(PICTURES, count)).round().astype(int))
    return [source.frame(int(k)) for k in chosen], source.times_s[chosen]


def _moving(frames: Sequence[RgbImage], times_s: FloatArray, settings: PictureSettings) -> list[FloatArray]:
    """Return boxes (M, 4) of what moves in each picture; none where the camera itself moves."""
    none = np.zeros((0, 4))
    if len(frames) < 3:
        return [none for _ in frames]
    detector = PictureDetector(FRAMES, settings)
    detector.prime(frames)
    scans = [detector(frame, float(t)) for frame, t in zip(frames, times_s, strict=True)]
    return [none if scan is None else scan.boxes for scan in scans]


def names_here() -> list[str]:
    """Return the names of the detectors that `auto` may choose on this machine now."""
    known = [network.name for network in KNOWN.values() if (cache_folder() / network.file).is_file()]
    return [MOTION, *known, *([HIGHWAYS] if HIGHWAYS in networks(FRAMES) else [])]


def _candidates(
    settings: DetectionSettings, say: Callable[[str], object]
) -> Iterator[tuple[str, ModelPictureDetector, float]]:
    """Yield the networks that are on this machine, and their AP on COCO (0: not of COCO)."""
    files: list[tuple[str, Path | None, float]] = []
    for network in KNOWN.values():
        try:
            files.append((network.name, cached(network), network.average_precision))
        except DataError as error:
            say(str(error))
    files.append((HIGHWAYS, networks(FRAMES).get(HIGHWAYS), 0.0))
    for name, path, accuracy in files:
        if path is None:
            continue
        try:
            yield name, ModelPictureDetector(path, FRAMES, settings.model_frames), accuracy
        except DataError as error:
            say(str(error))
        except ConfigError:  # classes that it does not know
            continue


def _impression(
    name: str,
    model: ModelPictureDetector,
    accuracy: float,
    pictures: Sequence[tuple[RgbImage, FloatArray]],
) -> Impression:
    boxes = sound = moves = 0
    seen = moved = 0.0
    for frame, moving in pictures:
        scan = model(frame, 0.0)
        likely = scan.scores >= (model.even_score or 0.0)
        found, scores = scan.boxes[likely], scan.scores[likely]
        common = _common(found, moving)
        areas, mass = found[:, 2:].prod(axis=1), moving[:, 2:].prod(axis=1)
        boxes += len(found)
        stirring = common.sum(axis=1) >= _MOVING * areas
        moves += int(stirring.sum())
        sound += int((stirring | (scores >= _SURE)).sum())
        seen += float(np.minimum(common.sum(axis=0), mass).sum())
        moved += float(mass.sum())
    return Impression(
        name,
        boxes / max(len(pictures), 1),
        sound / boxes if boxes else 0.0,
        seen / moved if moved else 1.0,
        accuracy,
        moves / boxes if boxes else 0.0,
        model.tells_classes,
    )


def _common(a: FloatArray, b: FloatArray) -> FloatArray:
    """Area (A, B) that boxes (left, top, width, height, px) have in common."""
    if not len(a) or not len(b):
        return np.zeros((len(a), len(b)))
    iou = pairwise_iou(a, b)
    total = a[:, 2:].prod(axis=1)[:, None] + b[:, 2:].prod(axis=1)[None]
    return np.asarray(iou * total / (1.0 + iou))
