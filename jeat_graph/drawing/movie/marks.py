"""Draws boxes, ellipses, trails and names of tracks into a picture with OpenCV."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.drawing.movie.captions import Captions
from jeat_graph.drawing.movie.lettering import Letters, Place, darken, letters, paint, room_for
from jeat_graph.drawing.movie.moments import Marks
from jeat_graph.drawing.movie.totals import COUNTER_RGB, Counter
from jeat_graph.drawing.palette import RIM, Rgb, track_rgb
from jeat_graph.io.media.video import RgbImage

SIGMAS = 2.0
#: Size of a track's number, of OpenCV's font in a picture 720 px high.
NAME_SIZE = 0.42
#: The same of what a line has counted.
COUNTER_SIZE = 0.6
#: Between a line and what it has counted, and of the dark ground around a text, in a picture 720 px high.
_CLEAR_PX, _GROUND_PX = 12.0, 3.0
_SHIFT = 4  # OpenCV takes coordinates in sixteenths of a pixel
#: Lightness of the smoothed tracks' colours.
PALE = 0.82
_DASH_PX, _GAP_PX = 6.0, 4.0
_FAR_PX = 30_000.0  # beyond it OpenCV's fixed-point coordinates would overflow


class Canvas:
    """A picture that is drawn into, in coordinates of the tracks.

    Args:
        image: (H, W, 3) uint8, drawn into.
        scale: pixels of the picture for one of the tracks' coordinates, x and y.

    Attributes:
        image: as given.
        scale: as given, (2,).
        unit: thickness of lines and size of text go with it.
    """

    def __init__(self, image: RgbImage, scale: tuple[float, float]) -> None:
        self.image = image
        self.scale = self._scale = np.array(scale)
        self.unit = max(float(image.shape[0]) / 720.0, 0.75)  # thickness of lines and size of text go with it

    def solid_box(self, box: FloatArray, colour: Rgb, thickness: float) -> None:
        """Draw a box (4,) with an unbroken line on a dark rim."""
        corners = self._corners(box)
        for tint, width in ((RIM, self._width(thickness) + 2), (colour, self._width(thickness))):
            self._polyline(corners, tint, width, closed=True)

    def thin_box(self, box: FloatArray, colour: Rgb) -> None:
        """Draw a box (4,) with the thinnest line."""
        self._polyline(self._corners(box), colour, 1, closed=True)

    def outline(self, corners: FloatArray, colour: Rgb, thickness: float, *, closed: bool) -> None:
        """Draw a line through corners (C, 2) px on a dark rim."""
        points = np.asarray(corners) * self._scale
        for tint, width in ((RIM, self._width(thickness) + 2), (colour, self._width(thickness))):
            self._polyline(points, tint, width, closed=closed)

    def dashed_box(self, box: FloatArray, colour: Rgb, thickness: float) -> None:
        """Draw a box (4,) with a broken line."""
        self._dashed(self._corners(box), colour, thickness, closed=True)

    def dashed_line(self, points: FloatArray, colour: Rgb, thickness: float) -> None:
        """Draw a broken line through points (C, 2) px."""
        self._dashed(np.asarray(points) * self._scale, colour, thickness, closed=False)

    def ellipse(self, centre: FloatArray, sigma: FloatArray, colour: Rgb) -> None:
        """Draw the ellipse of 2σ around a centre (2,) px; nothing where σ (2,) is not known."""
        import cv2

        if not np.isfinite(sigma).all():
            return
        middle = self._fixed(np.asarray(centre)[None] * self._scale)[0]
        axes = self._fixed(np.maximum(SIGMAS * sigma * self._scale, 0.5)[None])[0]
        place = (int(middle[0]), int(middle[1]))
        size = (int(axes[0]), int(axes[1]))
        cv2.ellipse(self.image, place, size, 0, 0, 360, colour, 1, lineType=cv2.LINE_AA, shift=_SHIFT)

    def trail(self, points: FloatArray, colour: Rgb, thickness: float) -> None:
        """Draw a line through points (L, 2)."""
        if len(points) > 1:
            self._polyline(np.asarray(points) * self._scale, colour, self._width(thickness), closed=False)

    def names(self, boxes: FloatArray, texts: Sequence[str], colours: Sequence[Rgb], *, thin: bool) -> None:
        """Write a text above each box (K, 4), within the picture; the largest boxes first.

        Args:
            boxes: left, top, width, height.
            texts: K texts.
            colours: K colours.
            thin: leave out those that would lie on one that stands already.
        """
        taken: list[Place] = []
        for k in map(int, np.argsort(-boxes[:, 2] * boxes[:, 3], kind="stable")):
            left, top = boxes[k, :2] * self._scale
            painted = self._letters(texts[k], NAME_SIZE)
            place = room_for(painted, (float(left), float(top) - 4.0 * self.unit), self._size_px)
            if thin and any(place.meets(other) for other in taken):
                continue
            taken.append(place)
            paint(self.image, painted, place, colours[k])

    def text(self, text: str, place: tuple[float, float], colour: Rgb, size: float) -> None:
        """Write a text on a dark ground, with its lower left corner at a pixel, moved into the picture."""
        painted = self._letters(text, size)
        room = room_for(painted, place, self._size_px)
        darken(self.image, room, round(_GROUND_PX * self.unit))
        paint(self.image, painted, room, colour)

    def _letters(self, text: str, size: float) -> Letters:
        return letters(text, size * self.unit, max(round(self.unit), 1))

    @property
    def _size_px(self) -> tuple[int, int]:
        return self.image.shape[1], self.image.shape[0]

    def _width(self, thickness: float) -> int:
        return max(round(thickness * self.unit), 1)

    def _corners(self, box: FloatArray) -> FloatArray:
        left, top, width, height = box
        x, y = (left, left + width), (top, top + height)
        points = np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])
        return np.asarray(points * self._scale)

    def _fixed(self, points: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
        near = np.clip(points, -_FAR_PX, _FAR_PX)
        return np.rint(near * (1 << _SHIFT)).astype(np.int32)

    def _dashed(self, corners: FloatArray, colour: Rgb, thickness: float, *, closed: bool) -> None:
        import cv2

        pieces = dashes(corners, _DASH_PX * self.unit, _GAP_PX * self.unit, closed=closed)
        if len(pieces):
            lines = list(self._fixed(pieces.reshape(-1, 2)).reshape(-1, 2, 2))
            cv2.polylines(
                self.image, lines, False, colour, self._width(thickness), lineType=cv2.LINE_AA, shift=_SHIFT
            )

    def _polyline(self, points: FloatArray, colour: Rgb, width: int, *, closed: bool) -> None:
        import cv2

        cv2.polylines(
            self.image, [self._fixed(points)], closed, colour, width, lineType=cv2.LINE_AA, shift=_SHIFT
        )


def dashes(corners: FloatArray, dash: float, gap: float, *, closed: bool = True) -> FloatArray:
    """Cut the outline of a polygon, or a line, into dashes; each side begins and ends with one.

    Args:
        corners: (C, 2) px.
        dash: wanted length of a dash (px).
        gap: wanted length of the gaps (px).
        closed: whether the last corner leads to the first.

    Returns:
        (D, 2, 2) first and last point of each dash.
    """
    out = []
    ends = np.roll(corners, -1, axis=0)
    for start, end in list(zip(corners, ends, strict=True))[: None if closed else -1]:
        length = float(np.hypot(*(end - start)))
        count = min(max(int((length + gap) // (dash + gap)), 1), 1000)
        # What is left over goes into the gaps.
        begin = np.arange(count) * ((length - dash) / max(count - 1, 1))
        if length <= dash or count == 1:
            out.append(np.array([[start, end]]))
            continue
        direction = (end - start) / length
        first = start + begin[:, None] * direction
        out.append(np.stack([first, first + dash * direction], axis=1))
    return np.concatenate(out)


def draw_causal(canvas: Canvas, marks: Marks, *, trails: bool) -> None:
    """Draw causal tracks: unbroken boxes, ellipses and trails."""
    for k, track_id in enumerate(marks.track_id.tolist()):
        colour = track_rgb(track_id)
        if trails:
            canvas.trail(marks.trails[k], colour, 1.5)
        canvas.ellipse(marks.centre[k], marks.sigma[k], colour)
        canvas.solid_box(marks.boxes[k], colour, 1.6)


def draw_smoothed(canvas: Canvas, marks: Marks) -> None:
    """Draw smoothed tracks: broken, paler boxes, ellipses and trails."""
    for k, track_id in enumerate(marks.track_id.tolist()):
        colour = track_rgb(track_id, PALE)
        canvas.trail(marks.trails[k], colour, 1.5)
        canvas.ellipse(marks.centre[k], marks.sigma[k], colour)
        canvas.dashed_box(marks.boxes[k], colour, 1.6)


def draw_names(canvas: Canvas, marks: Marks, labels: str, captions: Captions | None, t: float) -> None:
    """Write what stands beside the tracks: `all`, `thin` (as far as there is room) or `none`.

    Args:
        canvas: where to.
        marks: the tracks.
        labels: how many of them.
        captions: what; None: their numbers.
        t: the time (s).
    """
    if labels == "none" or not len(marks.track_id):
        return
    ids = marks.track_id.tolist()
    colours = [track_rgb(track_id, PALE) for track_id in ids]
    texts = [str(one) if captions is None else captions.of(one, t) for one in ids]
    canvas.names(marks.boxes, texts, colours, thin=labels == "thin")


def draw_counters(canvas: Canvas, counters: Sequence[Counter]) -> None:
    """Draw lines and zones."""
    for counter in counters:
        canvas.outline(counter.corners, COUNTER_RGB, 1.8, closed=counter.closed)


def draw_totals(canvas: Canvas, counters: Sequence[Counter], t: float) -> None:
    """Write how many have crossed each line and zone so far (t: s)."""
    for counter in counters:
        x, y = (counter.corners.mean(axis=0) * canvas.scale).tolist()
        clear = _CLEAR_PX * canvas.unit  # of the line itself
        canvas.text(counter.text(t), (x + clear, y - clear), COUNTER_RGB, COUNTER_SIZE)
