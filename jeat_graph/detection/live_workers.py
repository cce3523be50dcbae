"""What looks at one camera that is on now: takes what is newest, and gives scans."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Generic

import numpy as np

from jeat_graph.data.detections import Scan
from jeat_graph.detection.automatic import PICTURES, SAMPLE_S, chosen_by
from jeat_graph.detection.binned import BinnedDetector
from jeat_graph.detection.burnt_in import find_clock
from jeat_graph.detection.camera_flow import CameraFlow
from jeat_graph.detection.detecting import (
    CLOCK_S,
    EVENTS_SENSOR,
    FRAMES_SENSOR,
    embedder_of,
    event_detector,
)
from jeat_graph.detection.embedding import Embedder, described
from jeat_graph.detection.kept_choice import keep_choice, kept_choice
from jeat_graph.detection.named import AUTO, FRAMES, MOTION, network_file
from jeat_graph.detection.picture_detector import PictureDetector
from jeat_graph.detection.request import DetectRequest
from jeat_graph.io.capture.camera import LivePicture
from jeat_graph.io.capture.event_camera import LivePiece
from jeat_graph.io.capture.reader import Item, LiveReader
from jeat_graph.io.media.decoders import RgbImage

#: Between looks at whether to end (s).
SLICE_S = 0.1
Until = Callable[[], bool]


class Worker(Generic[Item]):
    """One camera and what looks at it.

    Args:
        reader: of the camera.
        sensor: name in the scans.
    """

    def __init__(self, reader: LiveReader[Item], sensor: str) -> None:
        self.reader, self.sensor = reader, sensor
        self.beat = time.monotonic()

    def items(self, stopped: Until) -> Iterator[Item]:
        """Yield what comes until it is stopped."""
        while not stopped():
            self.beat = time.monotonic()
            item = self.reader.take(SLICE_S)
            if item is not None:
                yield item

    def scans(self, stopped: Until) -> Iterator[Scan]:
        """Yield what is found until it is stopped."""
        raise NotImplementedError


class PictureWorker(Worker[LivePicture]):
    """A camera of pictures.

    Attributes:
        detector: name of what looks, `auto` until that is known.
        size_px: width and height, once a picture has come.
    """

    def __init__(
        self, reader: LiveReader[LivePicture], request: DetectRequest, say: Callable[[str], object]
    ) -> None:
        super().__init__(reader, FRAMES_SENSOR)
        self._request, self._say = request, say
        self.detector = request.detector_frames
        self.size_px: tuple[int, int] | None = None
        self._other_size = False

    def prepare(self, stopped: Until) -> None:
        """Wait for the first picture, and choose a detector if none is named, or take the one kept."""
        camera, settings = self.reader.status.name, self._request.settings
        if self.detector == AUTO:
            kept = kept_choice(camera, settings)
            if kept is not None:
                self.detector = kept
                self._say(f"detector: {kept}, as chosen at an earlier start; --detector-frames takes others")
        frames: list[RgbImage] = []
        times: list[float] = []
        for picture in self.items(stopped):
            if not self._fits(picture):
                continue
            if not times or picture.t - times[-1] >= SAMPLE_S / PICTURES:
                frames.append(picture.frame)
                times.append(picture.t)
            if self.detector != AUTO or times[-1] - times[0] >= SAMPLE_S:
                break
        if self.detector == AUTO and frames:
            self.detector = chosen_by(
                frames,
                np.array(times),
                settings,
                self._say,
                lambda chosen: keep_choice(camera, settings, chosen),
            )

    def _fits(self, picture: LivePicture) -> bool:
        """Tell whether a picture has the size of the first one, and say it of the first that has not."""
        height, width = picture.frame.shape[:2]
        if self.size_px is None:
            self.size_px = width, height
            self._say(f"frames: {width} x {height} px, {self.reader.status.name}")
        fits = self.size_px == (width, height)
        if not fits and not self._other_size:
            self._say(
                f"warning: {self.reader.status.name}: pictures are {width} x {height} px now, not "
                f"{self.size_px[0]} x {self.size_px[1]} as at first; they are passed over"
            )
        self._other_size = not fits
        return fits

    def scans(self, stopped: Until) -> Iterator[Scan]:
        """Yield what is found until it is stopped."""
        pictures = (picture for picture in self.items(stopped) if self._fits(picture))
        embedder = embedder_of(self._request, self._say)
        yield from self._found(pictures, embedder)
        if embedder is not None and embedder.note():
            self._say(embedder.note())

    def _found(self, pictures: Iterator[LivePicture], embedder: Embedder | None) -> Iterator[Scan]:
        """Yield what the detector finds, with its embeddings."""
        if self.detector == MOTION:
            yield from self._moving(pictures, embedder)
            return
        from jeat_graph.detection.models.pictures import ModelPictureDetector

        network = network_file(self.detector, FRAMES)
        model = ModelPictureDetector(network, self.sensor, self._request.settings.model_frames)
        self._say(model.description)
        flow = CameraFlow(self._request.settings.camera)
        for picture in pictures:
            scan = self._masked(flow(picture.frame, model(picture.frame, picture.t)))
            yield described(scan, picture.frame, embedder)
        if model.note():
            self._say(model.note())

    def _masked(self, scan: Scan) -> Scan:
        masks = self._request.masks
        assert self.size_px is not None
        return masks.on(self.size_px).scan(scan) if masks else scan

    def _moving(self, pictures: Iterator[LivePicture], embedder: Embedder | None) -> Iterator[Scan]:
        """Yield what moves; the background is made of the first seconds."""
        masks = self._request.masks
        if self._request.find_clock:
            clock = _clock_in(pictures)
            if clock is not None:
                left, top, width, height = clock
                self._say(
                    f"a burnt-in clock, {width} x {height} px at {left}, {top}, is masked (--mask none: not)"
                )
                masks = masks.with_box(*clock)
        detector = PictureDetector(self.sensor, self._request.settings.frames)
        for picture in pictures:
            assert self.size_px is not None
            quiet = masks.on(self.size_px) if masks else None
            scan = detector(picture.frame if quiet is None else quiet.painted(picture.frame), picture.t)
            if scan is not None:
                yield described(scan if quiet is None else quiet.scan(scan), picture.frame, embedder)


class EventWorker(Worker[LivePiece]):
    """A camera of events."""

    def __init__(
        self, reader: LiveReader[LivePiece], request: DetectRequest, say: Callable[[str], object]
    ) -> None:
        super().__init__(reader, EVENTS_SENSOR)
        self._request, self._say = request, say
        self.size_px: tuple[int, int] | None = None

    def prepare(self, stopped: Until) -> None:
        """Wait for the first events, which say the size of the picture."""
        for piece in self.items(stopped):
            self._sized(piece)
            break

    def _sized(self, piece: LivePiece) -> None:
        if self.size_px != piece.size_px:
            self.size_px = piece.size_px
            self._say(f"events: {self.size_px[0]} x {self.size_px[1]} px, {self.reader.status.name}")

    def scans(self, stopped: Until) -> Iterator[Scan]:
        """Yield what is found until it is stopped."""
        detector: BinnedDetector | None = None
        for piece in self.items(stopped):
            if detector is None or piece.size_px != self.size_px:
                self._sized(piece)
                detector, _ = event_detector(self._request, piece.size_px, self._say)
            for scan in detector.push(piece.events):
                masks = self._request.masks
                # As in a recording: masks are of the frames where there are some.
                mine = masks and self._request.frames is None
                yield masks.on(piece.size_px).scan(scan) if mine else scan


def _clock_in(pictures: Iterator[LivePicture]) -> tuple[int, int, int, int] | None:
    """Look for a burnt-in clock in the next seconds (left, top, width, height, px)."""
    import cv2

    greys, times = [], []
    for picture in pictures:
        greys.append(np.asarray(cv2.cvtColor(picture.frame, cv2.COLOR_RGB2GRAY), dtype=np.uint8))
        times.append(picture.t)
        if times[-1] - times[0] >= CLOCK_S:
            break
    return find_clock(greys, np.array(times)) if greys else None
