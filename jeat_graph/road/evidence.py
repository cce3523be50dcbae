"""What a calibration is made from: measured lengths, surveyed points, vehicles' tracks, and weak priors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class CalibrationConfig:
    """Noise of the evidence, and what is believed of a camera before any of it."""

    click_px: float = number(2.0, "px", "error of a picture point set by hand, a coordinate", open_low=True)
    length_sd_m: float = number(0.08, "m", "error of a length measured on a road", open_low=True)
    point_sd_m: float = number(0.05, "m", "error of a surveyed point, a coordinate", open_low=True)
    along_sd_rad: float = number(0.03, "rad", "how far a length `along` may point beside the road", 1e-4)
    across_sd_rad: float = number(0.06, "rad", "how far a length `across` may be from square", 1e-4)
    track_px: float = number(1.5, "px", "error of a tracked point, before the tracks tell", open_low=True)
    acceleration_sd: float = number(0.3, "m/s²", "spread of vehicles' accelerations", open_low=True)
    common_acceleration_sd: float = number(0.1, "m/s²", "acceleration that all of them share", open_low=True)
    lateral_sd: float = number(0.3, "m/s", "spread of vehicles' speeds across the road", open_low=True)
    focal_ratio: float = number(
        1.2, "1", "focal length / width of the picture that is most likely", open_low=True
    )
    focal_log_sd: float = number(0.7, "1", "spread of its logarithm", open_low=True)
    aspect_sd: float = number(0.003, "1", "how far pixels may be from square", open_low=True)
    centre_share: float = number(0.02, "1", "principal point off the middle / width", open_low=True)
    corner_distortion: float = number(0.02, "1", "radial distortion at the corner / radius", open_low=True)
    roll_sd_deg: float = number(
        3.0, "deg", "roll against the road's plane, crossfall included", open_low=True
    )
    height_m: float = number(8.0, "m", "height of a camera over a road that is most likely", open_low=True)
    height_log_sd: float = number(0.7, "1", "spread of its logarithm", open_low=True)
    lane_m: float = number(3.6, "m", "distance of lanes that is most likely", open_low=True)
    lane_log_sd: float = number(0.06, "1", "spread of its logarithm, where it tells the scale", open_low=True)
    size_log_sd: float = number(
        0.08, "1", "how far boxes of all vehicles may be off what is believed, relative", open_low=True
    )
    most_tracks: int = number(120, "tracks", "as many as are used", 1)
    nodes: int = number(14, "points", "a track is thinned to these", 4)
    edge_share: float = number(0.01, "1", "points this near the edge are cut by it / height of the picture")
    least_span_share: float = number(0.15, "1", "shortest track used / diagonal of the picture", 0.0, 1.0)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Lengths:
    """Lengths that somebody measured on the road.

    Attributes:
        start: (L, 2) one end in the picture (px).
        end: (L, 2) the other end (px).
        metres: (L,) what was measured.
        along: (L,) whether it runs along the road; otherwise across.
    """

    start: FloatArray
    end: FloatArray
    metres: FloatArray
    along: BoolArray

    def __len__(self) -> int:
        return len(self.metres)

    def take(self, rows: BoolArray | IntArray) -> Lengths:
        """Return the lengths chosen by an index or mask array."""
        return Lengths(self.start[rows], self.end[rows], self.metres[rows], self.along[rows])


@dataclass(frozen=True, eq=False)
class Points:
    """Points of the picture that somebody surveyed.

    Attributes:
        pixels: (P, 2) px.
        places: (P, 2) in m along axes of the road's plane.
    """

    pixels: FloatArray
    places: FloatArray

    def __len__(self) -> int:
        return len(self.pixels)


@dataclass(frozen=True, eq=False)
class TrackNodes:
    """Vehicles' tracks, each thinned to the same number of points.

    Attributes:
        t: (K, M) time (s).
        pixels: (K, M, 2) px.
        sides: (K, M, 4) left, top, right, bottom of the boxes (px), NaN where the picture's edge cuts one
            off, or None for tracks of points.
    """

    t: FloatArray
    pixels: FloatArray
    sides: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.t)


def thin(
    t: FloatArray,
    track_id: IntArray,
    pixels: FloatArray,
    config: CalibrationConfig,
    size: tuple[int, int],
    sides: FloatArray | None = None,
) -> TrackNodes:
    """Choose tracks that cross enough of the picture, evenly over the recording, and thin each of them.

    A node is the mean of a few neighbouring points, so that noise that changes from picture to picture is
    gone and what has memory is left.

    Args:
        t: (N,) time (s).
        track_id: (N,) identity.
        pixels: (N, 2) px.
        config: how many tracks and nodes.
        size: width and height of the picture (px).
        sides: (N, 4) left, top, right, bottom of the boxes (px), if there are boxes.
    """
    inside = np.flatnonzero(within(pixels, size, config.edge_share))
    order = inside[np.lexsort((t[inside], track_id[inside]))]
    t, track_id, pixels = t[order], track_id[order], pixels[order]
    boxes = np.zeros((len(t), 0)) if sides is None else sides[order].copy()
    if sides is not None:
        whole = within(boxes[:, :2], size, config.edge_share) & within(boxes[:, 2:], size, config.edge_share)
        boxes[~whole] = np.nan
    starts = np.flatnonzero(np.r_[True, track_id[1:] != track_id[:-1]]) if len(t) else np.zeros(0, int)
    ends = np.r_[starts[1:], len(t)]
    span = np.linalg.norm(pixels[ends - 1] - pixels[starts], axis=1) if len(t) else np.zeros(0)
    m = config.nodes
    good = np.flatnonzero((span >= config.least_span_share * np.hypot(*size)) & (ends - starts >= m))
    if len(good) > config.most_tracks:
        good = good[np.linspace(0, len(good) - 1, config.most_tracks).astype(int)]
    times, places = np.zeros((len(good), m)), np.zeros((len(good), m, 2))
    seen = np.zeros((len(good), m, boxes.shape[1]))
    for k, one in enumerate(good):
        edges = np.linspace(starts[one], ends[one], m + 1)
        for j in range(m):
            # The middle third of each piece: nodes stay apart, and the mean is over a short time.
            third = (edges[j + 1] - edges[j]) / 3.0
            a = int(edges[j] + third)
            b = max(a + 1, int(np.ceil(edges[j + 1] - third)))
            times[k, j], places[k, j] = t[a:b].mean(), pixels[a:b].mean(axis=0)
            seen[k, j] = boxes[a:b].mean(axis=0)
    return TrackNodes(times, places, None if sides is None else seen)


def within(pixels: FloatArray, size: tuple[int, int], edge_share: float) -> BoolArray:
    """Tell which pixels (N, 2) are not at the edge of a picture of `size`, where what is seen is cut off."""
    margin = edge_share * size[1]
    return np.asarray(((pixels >= margin) & (pixels <= np.array(size) - margin)).all(axis=1))
