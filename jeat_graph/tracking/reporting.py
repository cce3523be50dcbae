"""The causal table of one moment: which tracks are reported, and as what."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.association.boxes import track_boxes, visible_fraction
from jeat_graph.config.kernel_form import Model
from jeat_graph.config.schema import ImageConfig, OutputConfig
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters.cut_boxes import WHOLE
from jeat_graph.filters.fit import MEAN
from jeat_graph.filters.gaps import longest_right_gap
from jeat_graph.tracking.classes import ClassTally
from jeat_graph.tracking.state import SceneState, TrackArrays

# A sensor of less than this share of the greatest trust, or that sees so much less likely, is not waited for.
_TRUSTED = 0.5
# Rounding may leave a little less of a box.
_WHOLE = 1.0 - 1e-9
# A scan that is so many periods after the last has not come.
_OVERDUE = 1.5
# A sensor without a scan for so long does not look (s).
_LOOKS_S = 1.0


def longest_gaps_s(scene: SceneState, model: Model, t: float) -> tuple[float, float]:
    """Times since its last update up to which a track is reported (s): the usual, and where more is right.

    The second holds for what is whole in the picture: what becomes of those that leave it, nobody sees.

    Args:
        scene: what is learnt of the sensors, and of tracks that nobody saw for a while.
        model: sensors and settings.
        t: now (s).
    """
    usual = _usual_gap_s(scene, model, t)
    if model.settings.output.gap_memory <= 0.0:
        return usual, usual
    return usual, float(longest_right_gap(scene.gap_share, usual))


@njit(cache=True)
def waited_for(trust: FloatArray, blind: FloatArray) -> BoolArray:
    """Which sensors are waited for: those that are believed at least half as far as the best one.

    Args:
        trust: (S,) how far the others bear each out.
        blind: (S,) probability that it is blind as a whole.
    """
    believed = trust * (1.0 - blind)
    return believed >= _TRUSTED * np.max(believed)


def _usual_gap_s(scene: SceneState, model: Model, t: float) -> float:
    """Time since its last update up to which a track is reported whatever became of others (s).

    In scans of the sensor that needs most time: one that finds one vehicle in two has to be given more of
    them than one that finds all (P_D⁻², and as much again because the P_D of tracks that were found is larger
    than that of vehicles). Sensors that the others do not bear out, or that are blind, are not waited for.
    Until that sensor's next scan is due nothing has been missed, so the time counts from its last.

    What two sensors see has vanished soon after neither finds it; the gaps of one alone nobody fills. So with
    `output.scans_of_several` one alone is given the longest time there is.

    Args:
        scene: what is learnt of the sensors.
        model: sensors and settings.
        t: now (s).
    """
    output = model.settings.output
    scans, most = output.max_gap_scans, float(output.max_gap_s)
    if scans == 0.0:
        return most
    waited = waited_for(scene.trust, scene.blind)
    if output.scans_of_several:
        sees = (scene.last_look >= t - _LOOKS_S) & waited
        if np.count_nonzero(sees) < 2:
            return most
    wait = float(
        _longest_wait(scene.p_detect, waited, model.sensors.period_s, t - scene.last_look, scans, most)
    )
    return min(wait, most) if output.scans_of_several else wait


@njit(cache=True)
def _longest_wait(
    p_detect: FloatArray,
    waited: BoolArray,
    period_s: FloatArray,
    since_s: FloatArray,
    scans: float,
    most: float,
) -> float:
    """Return the longest time (s) of the sensors that are waited for, each from its last scan on.

    Args:
        p_detect: (S,) probability of detecting a vehicle.
        waited: (S,) which are waited for.
        period_s: (S,) time between two scans.
        since_s: (S,) time since the last.
        scans: so many P_D⁻⁴ scans of a sensor are waited for,
        most: but no more than this time (s).
    """
    longest = 0.0
    for s in range(len(waited)):
        if waited[s]:
            squared = p_detect[s] * p_detect[s]
            due = since_s[s] if since_s[s] < _OVERDUE * period_s[s] else 0.0
            longest = max(longest, min(scans * period_s[s] / (squared * squared), most) + due)
    return longest


def as_table(
    columns: tuple[
        FloatArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray
    ],
    sensors: tuple[str, ...],
    classes: ClassTally | None,
) -> Trajectories:
    """Put together what `report` returned, the names of the sensors, and the classes where there are any."""
    names, share = (None, None) if classes is None else classes.columns(columns[1])
    return Trajectories(*columns[:-1], sensors, names, share, columns[-1])


@njit(cache=True)
def report(
    tracks: TrackArrays,
    num_tracks: int,
    t: float,
    max_gaps_s: tuple[float, float],
    image: ImageConfig,
    output: OutputConfig,
    by_existence: bool,
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray]:
    """Collect the confirmed tracks that are alive now: `columns_of` the `reported_rows`."""
    boxes = track_boxes(tracks.mean[:num_tracks], tracks.size_mean[:num_tracks])
    rows = reported_rows(tracks, boxes, t, max_gaps_s, image, output, by_existence)
    return columns_of(tracks, rows, boxes[rows], t, image, output)


@njit(cache=True)
def reported_rows(
    tracks: TrackArrays,
    boxes: FloatArray,
    t: float,
    max_gaps_s: tuple[float, float],
    image: ImageConfig,
    output: OutputConfig,
    by_existence: bool,
) -> IntArray:
    """Choose the tracks that are reported: confirmed and alive now.

    Args:
        tracks: state of all tracks.
        boxes: (n, 4) of the living ones (px).
        t: time of the state (s).
        max_gaps_s: times since its last update up to which a track is reported (`longest_gaps_s`).
        image: the kernels' form of that section; two sections are handed over faster than all.
        output: the same.
        by_existence: whether tracks live by their probability of existence.

    Returns:
        (R,) their rows; of each of their boxes something is left after clipping.
    """
    rows = np.empty(len(boxes), dtype=np.int64)
    count = 0
    confirmed, worthy, existence, fit = tracks.confirmed, tracks.worthy, tracks.existence, tracks.fit
    for i in range(len(boxes)):
        gap = t - tracks.t_update[i]
        late = gap > max_gaps_s[0] and not tracks.standing[i]
        if late and (gap > max_gaps_s[1] or not is_whole(boxes[i], image)):
            continue
        if not is_believed(confirmed[i], worthy[i], existence[i], fit[i, MEAN], output, by_existence):
            continue
        if shows(boxes[i], tracks.used[i] != 0, image, output):
            rows[count] = i
            count += 1
    return rows[:count]


@njit(cache=True)
def is_believed(
    confirmed: bool, worthy: bool, existence: float, fit: float, output: OutputConfig, by_existence: bool
) -> bool:
    """Whether a track is taken for a vehicle, and its box for a fitting one, surely enough to be reported.

    Args:
        confirmed: whether it has been.
        worthy: whether what has such scores is to be believed.
        existence: its probability.
        fit: probability that its box fits, by its scores.
        output: the kernels' form of that section.
        by_existence: whether tracks live by their probability of existence.
    """
    alive = existence >= output.min_existence or not by_existence
    return confirmed and worthy and alive and fit >= output.min_fit


@njit(cache=True)
def shows(box: FloatArray, detected: bool, image: ImageConfig, output: OutputConfig) -> bool:
    """Whether enough of a box (4,) lies in the picture, or any of what was just detected and may be cut."""
    if not output.clip:
        return True
    visible = visible_fraction(box, image.width, image.height)
    return visible > 0.0 and (visible >= output.min_visible or (image.edge_px > 0.0 and detected))


@njit(cache=True)
def is_whole(box: FloatArray, image: ImageConfig) -> bool:
    """Whether all of a box (4,) lies in the picture."""
    return visible_fraction(box, image.width, image.height) >= _WHOLE


@njit(cache=True)
def remain(boxes: FloatArray, image: ImageConfig, output: OutputConfig) -> BoolArray:
    """Of which boxes (R, 4) something is left after clipping: (R,); of all where nothing is clipped."""
    left = np.ones(len(boxes), dtype=np.bool_)
    if output.clip:
        for k in range(len(boxes)):
            left[k] = not visible_fraction(boxes[k], image.width, image.height) <= 0.0
    return left


@njit(cache=True)
def written_scale(cut: int, output: OutputConfig) -> float:
    """Return the factor on a position's variance; a size that the edge hides is not noise to be narrowed."""
    return output.position_scale if cut == WHOLE else max(output.position_scale, 1.0)


@njit(cache=True)
def columns_of(
    tracks: TrackArrays,
    rows: IntArray,
    boxes: FloatArray,
    t: float,
    image: ImageConfig,
    output: OutputConfig,
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray]:
    """Write some tracks as columns of a table.

    Args:
        tracks: state of all tracks, at time `t`.
        rows: (R,) which of them, ascending.
        boxes: (R, 4) theirs (px); something of each has to be left after clipping.
        t: that time (s).
        image: the kernels' form of that section.
        output: the same.

    Returns:
        Columns of `Trajectories`: t (R,), track_id (R,), boxes (R, 4), existence (R,), mean (R, 6),
        var (R, 6), used (R,), size_var (R, 2).
    """
    width, height = image.width, image.height
    out_boxes = np.empty((len(rows), 4))
    mean = np.empty((len(rows), 6))
    var = np.empty((len(rows), 6))
    size_var = np.empty((len(rows), 2))
    for r in range(len(rows)):
        i = rows[r]
        for axis in range(2):
            low = boxes[r, axis]
            high = low + boxes[r, 2 + axis]
            if output.clip:
                low = max(low, 0.0)
                high = min(high, width if axis == 0 else height)
            out_boxes[r, axis] = low
            out_boxes[r, 2 + axis] = high - low
            # Of e^s where ln e^s = s is what is estimated: to first order e^2s times the variance of s.
            size_var[r, axis] = boxes[r, 2 + axis] * boxes[r, 2 + axis] * tracks.size_cov[i, axis, 0, 0]
            for d in range(3):
                mean[r, 2 * d + axis] = tracks.mean[i, axis, d]
                var[r, 2 * d + axis] = tracks.cov[i, axis, d, d]
            lasting = output.lasting_error * boxes[r, 3]
            var[r, axis] = written_scale(tracks.cut[i, axis], output) * var[r, axis] + lasting * lasting
    return (
        np.full(len(rows), t),
        tracks.track_id[rows],
        out_boxes,
        tracks.existence[rows],
        mean,
        var,
        tracks.used[rows],
        size_var,
    )
