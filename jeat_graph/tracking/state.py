"""State of all tracks at once: a structure of preallocated arrays, one row a track, the oldest first."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.config.kernel_form import SensorArrays
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.lent import lent
from jeat_graph.filters.box_offsets import NUM_SUMS
from jeat_graph.filters.gaps import LENGTHS, PRIOR_GAPS, PRIOR_SHARE
from jeat_graph.filters.manoeuvre import prior_weights
from jeat_graph.tracking.claims import CLAIMS, PLACES

# What lasts usually has scores of about .9; that is held to be known from five seconds of a track.
_USUAL_ODDS, _USUAL_WEIGHT = 2.2, 5.0
# A precision that was measured is believed as it is: a and b of `filters.worth`.
_AS_MEASURED = 0.0, 1.0
# The share of what comes again in vain is held to be known from ten.
_USUAL_VAIN_WEIGHT = 10.0
#: How hard the tracks of a scene usually manoeuvre is the mean of so many seconds of a track.
USUAL_JERK_S = 30.0
_FIRST_INNOVATIONS_S = 1.5  # of a track: from so many it is held to be known that they are as expected


@lent
class TrackArrays(NamedTuple):
    """Arrays of capacity C for tracks and S sensors; rows beyond the number of living tracks are unused.

    Attributes:
        mean: (C, 2, 3 + B) per axis [p, v, a] of the box centre (px, px/s, px/s²), and the correlated
            errors of B sensors (`filters/coloured_noise.py`).
        cov: (C, 2, 3 + B, 3 + B) covariance per axis; the axes are independent.
        size_mean: (C, 2, 2) ln width and ln height, each with its rate (1/s).
        size_cov: (C, 2, 2, 2) covariance of each.
        cut: (C, 2) what the edges of the picture cut of the last detection (`filters.cut_boxes`).
        rest_point: (C, 2) where the track is if it stands still (px).
        rest_var: (C, 2) variances of that point (px²).
        rest_since: (C,) since when it may have stood there (s).
        standing_log_odds: (C,) log odds of standing against moving.
        standing: (C,) whether the track counts as standing.
        scale: (C, S) noise scale s of paper eq. 5.
        p_detect: (C, S) running estimate of each sensor's probability of detecting this track.
        hidden: (C, S) probability that the track, if it exists, is hidden from each sensor for now.
        existence: (C,) probability that the track is a vehicle.
        confirmed: (C,) whether it has been confirmed.
        track_id: (C,) identity, ascending.
        hits: (C,) number of detections taken.
        t_birth: (C,) time of the first detection (s).
        born_at: (C, 2) place of its centre then (px).
        t_update: (C,) time of the last one (s).
        used: (C,) bit s is set where sensor s's detection was taken in the last step.
        seen_by: (C,) bit s is set where sensor s counts as having seen it (`weigh_witness`).
        witness: (C, S) ln of how much each sensor's detections of it and its misses speak for the track.
        score_odds: (C,) mean log odds of the precisions of its detections.
        jerk_mean: (C, K, 2, 3 + B) its motion under K densities of jerk (`filters/manoeuvre.py`).
        jerk_cov: (C, K, 2, 3 + B, 3 + B) covariance of each.
        jerk_weight: (C, K) probability of each density.
        jerk_factor: (C,) factor on the density of the jerk that follows from them.
        size_trial_mean: (C, J, 2, 2) its size under J densities of the rate (`filters/resizing.py`).
        size_trial_cov: (C, J, 2, 2, 2) covariance of each.
        size_weight: (C, J) probability of each density.
        size_factor: (C,) factor on the density of the rate of ln size that follows from them.
        lasting: (C,) whether it has lasted (`filters.worth`).
        last_box: (C, S, 5) each sensor's last whole box, as it saw it: time (s), centre (px), ln width and ln
            height.
        seen_apart: (C, S) when each sensor last gave it a box while no other track overlapped it (s).
        worth: (C,) probability that what has such scores lasts, where one sensor alone has seen it; else 1.
        worthy: (C,) whether it may be reported: things of such scores last often enough to be believed of one
            sensor alone, and it has moved where only sensors that see nothing stand have seen it.
        fit: (C, 2) how likely its box fits, by the scores of its detections (`filters.fit`).
        t_missed: (C,) when it was missed last while all but the gap spoke for reporting it (s); before that
            minus infinity.
    """

    mean: FloatArray
    cov: FloatArray
    size_mean: FloatArray
    size_cov: FloatArray
    cut: IntArray
    rest_point: FloatArray
    rest_var: FloatArray
    rest_since: FloatArray
    standing_log_odds: FloatArray
    standing: npt.NDArray[np.bool_]
    scale: FloatArray
    p_detect: FloatArray
    hidden: FloatArray
    existence: FloatArray
    confirmed: npt.NDArray[np.bool_]
    track_id: IntArray
    hits: IntArray
    t_birth: FloatArray
    born_at: FloatArray
    t_update: FloatArray
    used: IntArray
    seen_by: IntArray
    witness: FloatArray
    score_odds: FloatArray
    jerk_mean: FloatArray
    jerk_cov: FloatArray
    jerk_weight: FloatArray
    jerk_factor: FloatArray
    size_trial_mean: FloatArray
    size_trial_cov: FloatArray
    size_weight: FloatArray
    size_factor: FloatArray
    lasting: npt.NDArray[np.bool_]
    last_box: FloatArray
    seen_apart: FloatArray
    worth: FloatArray
    worthy: npt.NDArray[np.bool_]
    fit: FloatArray
    t_missed: FloatArray


@lent
class SceneState(NamedTuple):
    """What is learnt of the scene as a whole.

    Three questions are asked of a sensor, and each has its words here. Do the others bear it out (`claims`,
    `agreed`, `trust`)? Does what it finds last (`lasting`, `worth`), or does it come again and still come to
    nothing (`vain`, `fruitless`)? Can it see at the moment (`blind`), has it ever (`unproven`), and where
    does it look (`field`)?

    Attributes:
        clutter: (S,) expected false boxes in a scan of each sensor.
        p_detect: (S,) each sensor's mean probability of detecting a confirmed track: light and darkness.
        undetected: (1,) expected number of vehicles in the scene that have no track yet.
        last_look: (S,) time of each sensor's last scan (s); minus infinity before the first.
        claims: (S, G) records of `CLAIMS`, how far others bear out each sensor's detections, by strip of the
            picture (`stages.looking.place_of`); one strip where every sensor is taken to look at all of it.
        agreed_seen: (S,) how much of them another sensor bears out, over all strips (s).
        agreed_odds: (S,) mean log odds of the scores of these.
        agreed_without: (S, S) detections of the first on tracks that a sensor besides the two has seen (s).
        borne_out: (S,) the share of its claims that is, to the power that counts, in (0, 1].
        trust: (S,) what all that says of the sensor: factor on its evidence, in (0, 1].
        fruitless: (S,) recent mean number, a scan, of each sensor's detections on tracks that ended without
            having been confirmed, and of those that no track took where there was such a track; all on tracks
            that no other sensor saw.
        looked: (S,) scans full of confirmed tracks that `p_detect` rests on.
        blind: (S,) probability that each sensor is blind as a whole for now.
        unproven: (S,) probability that it has never found a vehicle.
        first_look: (S,) time of each sensor's first scan (s); infinity before it.
        lasting_odds: (S,) mean log odds of the scores of what has lasted.
        lasting_seen: (S,) what that mean rests on, in seconds of a track.
        vain: (S,) share of each sensor's detections that came again on tracks that did not last.
        vain_seen: (S,) what that share rests on, in seconds of a track.
        gained: (S,) recent evidence of the hits on each sensor's confirmed tracks, a scan, before its trust.
        lost: (S,) that of the misses of them, which speaks against them.
        worth_mean: (S, 2) what its scores say of what lasts (`filters.worth`): a, b.
        worth_cov: (S, 2, 2) covariance of the two.
        pair_sums: (S, S, 2, 35) what pairs of boxes of a sensor and a later one said (`filters.box_offsets`).
        offsets: (S, 2, 6) what each sensor is off by along each axis: share of the side, px, ln side, px per
            px of the place along x and y.
        pair_factors: (S, S, 2, 2) factors on the variances that are assumed of their differences.
        innovation: (S,) recent mean of half the normalised innovation squared of confirmed tracks, at the
            usual density of jerk; followed where a density is chosen.
        innovation_seen: (S,) what that mean rests on, in seconds of a track.
        usual_jerk: (K,) recent mean weight of each density of jerk over the confirmed tracks.
        size_innovation: (S,) recent mean of the normalised innovation squared of a side's ln length, at the
            usual density of its rate; followed where a density is chosen.
        size_seen: (S,) what that mean rests on, in seconds of a track.
        usual_resizing: (J,) recent mean weight of each density of that rate over the confirmed tracks.
        field: (S, 2) how far each sensor's boxes reach to the left and to the right (px), from +inf, -inf.
        field_witnesses: (S,) over how many vehicles they were.
        gap_share: (L,) of the tracks that nobody saw for so long, those found again as expected
            (`filters.gaps`).
        gap_seen: (L,) on how many each share rests.
    """

    clutter: FloatArray
    p_detect: FloatArray
    undetected: FloatArray
    last_look: FloatArray
    claims: RecordArray
    agreed_seen: FloatArray
    agreed_odds: FloatArray
    agreed_without: FloatArray
    borne_out: FloatArray
    trust: FloatArray
    fruitless: FloatArray
    looked: FloatArray
    blind: FloatArray
    unproven: FloatArray
    first_look: FloatArray
    lasting_odds: FloatArray
    lasting_seen: FloatArray
    vain: FloatArray
    vain_seen: FloatArray
    gained: FloatArray
    lost: FloatArray
    worth_mean: FloatArray
    worth_cov: FloatArray
    pair_sums: FloatArray
    offsets: FloatArray
    pair_factors: FloatArray
    innovation: FloatArray
    innovation_seen: FloatArray
    usual_jerk: FloatArray
    size_innovation: FloatArray
    size_seen: FloatArray
    usual_resizing: FloatArray
    field: FloatArray
    field_witnesses: FloatArray
    gap_share: FloatArray
    gap_seen: FloatArray


def start_scene(sensors: SensorArrays, config: Config) -> SceneState:
    """Return what is held of a scene of S sensors before the first scan."""
    num_sensors = len(sensors.p_detect)
    # Of a sensor that is the only one, nothing can be told but by itself.
    doubt = config.lifecycle.first_doubt if num_sensors > 1 else 0.0
    places = PLACES if config.lifecycle.field_doubt > 0.0 and num_sensors > 1 else 1
    return SceneState(
        clutter=sensors.clutter_per_scan.copy(),
        p_detect=sensors.p_detect.copy(),
        undetected=np.array([config.birth.initial]),
        last_look=np.full(num_sensors, -np.inf),
        claims=np.zeros((num_sensors, places), dtype=CLAIMS),
        agreed_seen=np.zeros(num_sensors),
        agreed_odds=np.zeros(num_sensors),
        agreed_without=np.zeros((num_sensors, num_sensors)),
        borne_out=sensors.prior_trust.copy(),
        trust=sensors.prior_trust.copy(),
        fruitless=np.zeros(num_sensors),
        looked=np.zeros(num_sensors),
        blind=np.full(num_sensors, config.lifecycle.usual_blindness),
        unproven=np.full(num_sensors, doubt),
        first_look=np.full(num_sensors, np.inf),
        lasting_odds=np.full(num_sensors, _USUAL_ODDS),
        lasting_seen=np.full(num_sensors, _USUAL_WEIGHT),
        vain=np.full(num_sensors, config.lifecycle.usual_vain),
        vain_seen=np.full(num_sensors, _USUAL_VAIN_WEIGHT),
        gained=np.zeros(num_sensors),
        lost=np.zeros(num_sensors),
        worth_mean=_first_worth(config),
        worth_cov=np.tile(config.lifecycle.worth_std**2 * np.eye(2), (num_sensors, 1, 1)),
        pair_sums=np.zeros((num_sensors, num_sensors, 2, NUM_SUMS)),
        offsets=np.zeros((num_sensors, 2, 6)),
        pair_factors=np.ones((num_sensors, num_sensors, 2, 2)),
        innovation=np.ones(num_sensors),
        innovation_seen=np.full(num_sensors, _FIRST_INNOVATIONS_S),
        usual_jerk=prior_weights(*config.motion.first_odds)[: config.motion.densities],
        size_innovation=np.ones(num_sensors),
        size_seen=np.full(num_sensors, _FIRST_INNOVATIONS_S),
        usual_resizing=prior_weights(*config.size.first_odds)[: config.size.densities],
        field=np.tile([np.inf, -np.inf], (num_sensors, 1)),
        field_witnesses=np.zeros(num_sensors),
        gap_share=np.full(LENGTHS, PRIOR_SHARE),
        gap_seen=np.full(LENGTHS, PRIOR_GAPS),
    )


def _first_worth(config: Config) -> FloatArray:
    """What precisions say of what lasts (S, 2), before that is learnt: themselves, where measured."""
    lifecycle = config.lifecycle
    half = lifecycle.worth_half
    assumed = math.log(half / (1.0 - half)), lifecycle.worth_slope
    sensors = [config.sensors[name] for name in config.sensor_names]
    return np.array([_AS_MEASURED if s.knows_scores else assumed for s in sensors], dtype=np.float64)
