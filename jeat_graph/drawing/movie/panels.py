"""Draws a run at given times: backgrounds side by side, each with tracks and truth on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.drawing.movie.backgrounds import FilmBackground
from jeat_graph.drawing.movie.captions import Captions
from jeat_graph.drawing.movie.joins import Joins
from jeat_graph.drawing.movie.marks import (
    Canvas,
    draw_causal,
    draw_counters,
    draw_names,
    draw_smoothed,
    draw_totals,
)
from jeat_graph.drawing.movie.moments import TracksAt, TruthAt, back_in
from jeat_graph.drawing.movie.totals import Counter
from jeat_graph.drawing.palette import IGNORED_BOX, TEXT, TRUE_BOX
from jeat_graph.io.media.video import RgbImage

_MARGIN_PX = 10.0


@dataclass(frozen=True, eq=False)
class Movie:
    """What a movie of a run is drawn from.

    Attributes:
        times: (T,) ascending (s).
        backgrounds: at least one, drawn from left to right.
        field_px: width and height of the picture that the tracks' coordinates belong to.
        panel_px: width and height at which each background is drawn, both even.
        causal: tracks, or None.
        smoothed: tracks, or None.
        truth: true boxes, or None.
        ways: from the picture of each background to the one that the tracks' coordinates belong to; None
            where it is the same, and for all where nothing is said.
        labels: which tracks have their number beside them: `all`, `thin` (as far as there is room, large
            boxes first) or `none`.
        captions: what stands beside the tracks; None: their numbers.
        counters: lines and zones.
        joins: where causal tracks were joined to one identity, or None.
    """

    times: FloatArray
    backgrounds: Sequence[FilmBackground]
    field_px: tuple[float, float]
    panel_px: tuple[int, int]
    causal: TracksAt | None = None
    smoothed: TracksAt | None = None
    truth: TruthAt | None = None
    labels: str = "thin"
    ways: Sequence[PictureMap | None] = ()
    captions: Captions | None = None
    counters: Sequence[Counter] = ()
    joins: Joins | None = None

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the whole."""
        return self.panel_px[0] * len(self.backgrounds), self.panel_px[1]

    def picture(self, k: int) -> RgbImage:
        """Draw time number `k`: (H, W, 3) uint8."""
        ways = self.ways or [None] * len(self.backgrounds)
        panels = [
            self._panel(background, way, k) for background, way in zip(self.backgrounds, ways, strict=True)
        ]
        return panels[0] if len(panels) == 1 else np.concatenate(panels, axis=1)

    def strip(self, count: int) -> RgbImage:
        """Draw `count` times, evenly spread from first to last, one below the other: (H, W, 3) uint8."""
        chosen = np.unique(np.linspace(0, len(self.times) - 1, count).round().astype(int))
        return np.concatenate([self.picture(k) for k in chosen.tolist()])

    def _panel(self, background: FilmBackground, way: PictureMap | None, k: int) -> RgbImage:
        import cv2

        t = float(self.times[k])
        image = background.image(t)
        if image.shape[1::-1] == self.panel_px:
            image = image.copy()
        else:
            smaller = image.shape[1] > self.panel_px[0]
            how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
            image = np.asarray(cv2.resize(image, self.panel_px, interpolation=how), dtype=np.uint8)
        width, height = self.field_px if way is None else background.size_px
        canvas = Canvas(image, (self.panel_px[0] / width, self.panel_px[1] / height))
        self._draw(canvas, way, k, t)
        edge = _MARGIN_PX * canvas.unit
        canvas.text(f"t = {t:.3f} s", (edge, image.shape[0] - edge), TEXT, 0.6)
        if background.name:
            canvas.text(background.name, (edge, 2.6 * edge), TEXT, 0.6)
        return image

    def _draw(self, canvas: Canvas, way: PictureMap | None, k: int, t: float) -> None:
        if way is None:  # lines and zones are drawn in the common picture alone
            draw_counters(canvas, self.counters)
        if self.causal is not None:
            draw_causal(canvas, back_in(self.causal.at(k), way), trails=self.smoothed is None)
        if self.smoothed is not None:
            draw_smoothed(canvas, back_in(self.smoothed.at(k), way))
        if self.joins is not None:
            self.joins.draw(canvas, t, way)
        if self.truth is not None:
            asked_for, ignored = self.truth.at(t)
            for boxes, colour in ((ignored, IGNORED_BOX), (asked_for, TRUE_BOX)):
                for box in boxes if way is None else _seen(way, boxes):
                    canvas.thin_box(box, colour)
        named = self.smoothed if self.causal is None else self.causal
        if named is not None:
            # Last, so that no line runs through them.
            draw_names(canvas, back_in(named.at(k), way), self.labels, self.captions, t)
        if way is None:
            draw_totals(canvas, self.counters, t)
        used = [
            text
            for shown, text in (
                (self.causal, "solid: causal"),
                (self.smoothed, "dashed: smoothed"),
                (self.joins or None, "broken line: joined over a gap"),
                (self.truth, "thin: truth"),
            )
            if shown is not None
        ]
        if used:
            height, width = canvas.image.shape[:2]
            canvas.text(", ".join(used), (width, height - _MARGIN_PX * canvas.unit), TEXT, 0.42)


def _seen(way: PictureMap, boxes: FloatArray) -> FloatArray:
    own, seen = way.back(boxes)
    return own[seen]
