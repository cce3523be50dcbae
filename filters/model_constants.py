"""The constants of the model that may be changed (`Tracker(constants=…)`), with units and sources.

What only bounds a computation, or follows from another definition, stands where it is used, in the C++ twin
of a module too.

Lengths are in sizes of the object (√(width · height)) unless another unit stands there, so that the constants
hold for any picture. "Prior" marks what only begins the learning of `noise_learning`, `object_probability`,
`score_calibration` and `gap_survival`; "measured" was chosen on recordings of real detectors, one number for
all of them.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ModelConstants:
    """Constants of the reference model; frozen and hashable.

    Attributes:
        velocity_time_s: correlation time of the velocity (s); objects that nobody sees come to rest at last.
        acceleration_time_s: correlation time of the acceleration (s) (Singer 1970).
        growth_time_s: correlation time of the rate of ln size (s).
        error_time_s: correlation time of the part of a detector's error that lasts (s). Measured.
        error_share: its variance, in that of the error that is new in every box. Measured.
        jerk: root spectral density of what drives the acceleration (sizes/s^2.5). Prior.
        growth_noise: that of what drives the rate of ln size (1/s^1.5). Prior.
        position_walk: that of the position's random walk (sizes/√s). Prior.
        size_walk: that of the random walk of ln size (1/√s). Prior.
        most_perspective: largest growth of ln size in a step that perspective is computed for.
        perspective_jerk: jerk that perspective adds beyond that of constant velocity, times (growth rate)^2.5
            (sizes/s^2.5 at 1/s): a point that nears the camera has image coordinates ~ 1/Z, so what drives it
            in space grows with that power.
        fastest_growth: largest growth rate that perspective is computed for (1/s).
        velocity_std, acceleration_std, growth_std: at a birth (sizes/s, sizes/s², 1/s).
        side_std: standard deviation of a measured side (sizes). Prior.
        side_std_bounds: least and largest learnt value of it (measured): boxes that repeat are not therefore
            right. Without a floor parked cars, of which a detector repeats the same box, teach that
            boxes are exact.
        pixel_std: part of it that does not shrink with the object (px): boxes in whole pixels.
        spread_bounds: least and largest standard deviation of a side that a detector's own spread counts for
            (sizes): beyond, a side is exact, or measures nothing.
        spread_rate: step of the running mean of their squares, a scan.
        degrees_of_freedom: of Student's t of the sides; heavy tails as measured.
        cut_share: prior probability that one given side is cut by an occluder.
        uncovered_share: prior probability that one given side was cut so far, and now shows further out.
        most_uncovered: how far out at most (sizes of the part that was known).
        cut_gate: largest squared Mahalanobis distance of the other three sides (χ² of 3, .9998).
        edge_px: a side that is no further from the edge of the picture lies there (px).
        edge_std: standard deviation of a side that the edge has cut (sizes): 1/√(2π), of which the density at
            0 is one over the size.
        edge_birth: how far a track may reach beyond the edge that it begins at (sizes).
        offset_count: pairs of boxes that the prior of two sensors' mean difference counts for.
        offset_clip: difference from the mean (sizes, or ln size) from which on a pair counts for less.
        offset_age_s: boxes of two sensors that are further apart in time are not compared (s).
        lasting_after_s: two differences of a track that are further apart have in common what lasts (s).
        lasting_within_s: and no further apart than this.
        lasting_clip: largest difference that counts (sizes, or ln size).
        lasting_count: pairs of differences that the prior of no such error counts for.
        aspect_pairs: pairs of differences over which an object's aspect is one measurement.
        aspect_prior: standard deviation of (V_s − V_o)/(V_s + V_o) about what P_D says of it.
        aspect_clip: largest sum of two boxes' ln(w/h) that counts.
        lasting_boxes: boxes in the filter's memory, over which such an error is not averaged out.
        compared_std: least standard deviation of a side of a sensor that others are compared with (sizes): of
            the common frame.
        gate: largest squared Mahalanobis distance of four sides: so far out that clutter is always likelier.
        clutter_size_area: area in (ln width, ln height) over which the sizes of leftover boxes spread.
        clutter_memory: share of the running mean of leftovers that a scan keeps.
        clutter_prior: leftovers a scan added to that mean.
        first_leftovers: that mean before the first scan.
        clutter_precision: share of leftovers that are real all the same.
        score_floor: likelihood of any score under any hypothesis, added: scores may be anything at times.
        innovation_clip: largest normalised innovation that teaches noise.
        nis_cap, nis_target: a square above the cap counts as the cap, and their mean is led to the target: of
            errors of Student's t above, what is learnt is then the standard deviation.
        noise_rate, process_rate, walk_rate: steps of the stochastic approximation of the log variances, a
        scan.
        noise_tracks: tracks from which on a scan counts in full.
        noise_period_s: period from which on a scan counts in full (s); faster ones repeat their errors.
        noise_hits: detections of a track before its innovations teach.
        jerk_bounds, growth_bounds, walk_bounds: least and largest learnt values, in their units above.
        correlation_time_s: hits, and misses, closer together are one witness (s). Measured on real detectors.
        first_period_s: period of a sensor of which there was one scan (s).
        p_detect, p_detect_strength: mean and strength of the Beta prior of one object's P_D. Prior.
        p_detect_bounds: of the sensor's learnt mean. Were it less, what clutter gives a track by chance would
            pass for an object that is seldom seen.
        track_p_detect_bounds: of a track's own mean, in association.
        track_p_detect_memory_s: memory of a track's own hits and misses (s).
        p_detect_count: objects that the prior of the sensor's mean counts for.
        scan_count: scans from which on an object counts no more for that mean.
        chance_hit: probability of a hit on what a sensor cannot see.
        unseen_share: share of real objects that a sensor never sees. Prior.
        unseen_bounds: of the learnt share: "the one never sees it" and "the other invents it" explain the
            same data, so the share is bounded; few objects of a sort teach that there are none, so it does
            not fall below its prior.
        stationary_speed: speed below which an object is taken to stand (sizes/s).
        stationary_unseen_share: share of real objects that a sensor does not see while they stand. Prior.
        event_stationary_unseen_share: the same of one that is told to be an event camera. Prior; measured on
            simulated roads.
        stationary_unseen_bounds: of the learnt share.
        shared_false: share of persistent false objects that another sensor reports, too.
        noise_share: prior odds of noise that is seen once, as a probability. Prior.
        noise_bounds: of the learnt share.
        agreed_std: standard deviation of a sensor's scores of tracks that others find too (logits). Prior.
        sensor_count: objects that the priors of shares count for.
        weight_hits, weight_bounds: a track's weight in a sensor's prior odds: detections over the first,
        bounded.
        most_gain: largest gain in log likelihood that one detection has against noise.
        duplicate_weight: of ln(1 − overlap) in the log odds.
        duplicate_log_odds: evidence of scores at which that weight is halved.
        peak_share: share of the peak, the rest being the mean, in a track's score (logits).
        peak_decay_s, mean_memory_s, smoothing_s: of the peak, of the mean, of what the peak is taken of (s).
        unknown_score: score of a box that has none.
        repeat_overlap: IoU from which on a box comes again at its place.
        repeat_share: prior share of the best boxes that come again.
        repeat_trusted: share of the best boxes below which the counts say less and less: all moves far from
            one scan to the next.
        no_meaning_share: prior probability that a sensor's scores say nothing of what its boxes are of.
        no_meaning_std: then the scores of boxes that come again have a correlation of this (atanh).
        repeat_count: boxes that this prior counts for, in each score bin.
        best_share: of the boxes, by score, that are the yardstick.
        threshold_offset, threshold_slope: θ_s = offset + slope · z, z the logit below which fewer
            than half as many come again as of the best. Measured.
        threshold_bounds: of z.
        visible_to_hidden, hidden_to_visible, visible_to_gone, hidden_to_gone: rates of the chain of presence
        (1/s).
        full_scan_s: a sensor whose scans are closer together than this expects less of each (s).
        gap_prior: a gap of u expected detections ends well with exp(−u / this). Prior.
        gap_prior_count: gaps that the prior counts for.
        gap_prior_least: shortest u of the prior.
        gap_overlap: IoU with the predicted box from which on a gap ended well.
        sure: posterior at the end of a track from which on it tells what the track was before.
        turning_s: that counts for exp(−τ / this) at τ before the track was first likelier real than not (s).
            Measured: of rows that this gives, as many are right as are wrong at 0.25 to 0.4 s before.
        longest_gap_s: a track that nobody has seen for so long ends (s).
        camera_shift_std, camera_scale_std: of common shift (sizes) and scale between two scans. Prior.
        camera_shift_bounds, camera_scale_bounds: of the learnt values.
        camera_memory: share of these variances that a scan keeps.
        camera_time_s: what lasts longer of the camera's motion is the tracks' own (s).
        confirming: a box that is less likely an object by itself does not tell that its track is still there:
            what overlaps a better box is mostly a second one. Measured.
        report: least posterior, times the survival of its gap, of a track that is reported.
        inside_share: least share of a box within the picture of a track that is reported while nobody sees
        it. rival, rival_age_s: least posterior, and longest time since its last detection (s), of a track
            that a birth may be a second box of.
        doubtful_gap_s: a track that is less likely real than not ends after so long unseen (s).
        false_posterior, false_gap_s: one of a smaller posterior ends after so long (s).
        least_presence: a track that is visible or hidden with less ends.
        outside_share, outside_gap_s: one with less of its box within the picture ends after so long (s).
        learn_period_s: time between two updates of the sensors' parameters (s).
        remembered_tracks: ended tracks from which sensors' parameters are learnt.
        most_on_one_spot, spot_overlap, most_touching: of `association.heaps`; far above what detectors give
            that suppress what they find twice, and far below what a step could not bear.
        exact_assignment: tracks, or boxes, of one group up to which its assignment is the best one.
    """

    velocity_time_s: float = 20.0
    acceleration_time_s: float = 0.5
    growth_time_s: float = 1.0
    error_time_s: float = 0.5
    error_share: float = 0.5
    jerk: float = 2.0
    growth_noise: float = 0.5
    position_walk: float = 0.05
    size_walk: float = 0.05
    most_perspective: float = 0.4
    perspective_jerk: float = 2.0
    fastest_growth: float = 4.0
    velocity_std: float = 3.0
    acceleration_std: float = 0.5
    growth_std: float = 0.3

    side_std: float = 0.09
    side_std_bounds: tuple[float, float] = (0.06, 0.4)
    pixel_std: float = 0.5
    spread_bounds: tuple[float, float] = (0.01, 1.0)
    spread_rate: float = 0.05
    degrees_of_freedom: float = 6.0
    cut_share: float = 0.02
    cut_gate: float = 20.0
    uncovered_share: float = 0.0002
    most_uncovered: float = 4.0

    edge_px: float = 3.0
    edge_std: float = 0.4
    edge_birth: float = 0.5
    offset_count: float = 10.0
    offset_clip: float = 0.2
    offset_age_s: float = 0.011
    lasting_after_s: float = 0.5
    lasting_within_s: float = 5.0
    lasting_clip: float = 0.3
    lasting_count: float = 20.0
    aspect_pairs: float = 4.0
    aspect_prior: float = 0.5
    aspect_clip: float = 5.0
    lasting_boxes: float = 4.0
    compared_std: float = 0.1

    gate: float = 150.0
    clutter_size_area: float = 2.0
    clutter_memory: float = 0.98
    clutter_prior: float = 0.5
    first_leftovers: float = 1.0
    clutter_precision: float = 0.3
    score_floor: float = 0.02

    innovation_clip: float = 3.0
    nis_cap: float = 4.0
    nis_target: float = 0.8
    noise_rate: float = 0.02
    process_rate: float = 0.03
    walk_rate: float = 0.1
    noise_tracks: float = 8.0
    noise_period_s: float = 0.05
    noise_hits: int = 3
    jerk_bounds: tuple[float, float] = (0.3, 60.0)
    growth_bounds: tuple[float, float] = (0.1, 20.0)
    walk_bounds: tuple[float, float] = (0.003, 1.0)

    correlation_time_s: float = 0.3
    first_period_s: float = 0.05
    p_detect: float = 0.7
    p_detect_strength: float = 3.0
    p_detect_bounds: tuple[float, float] = (0.1, 0.98)
    track_p_detect_bounds: tuple[float, float] = (0.02, 0.98)
    track_p_detect_memory_s: float = 1.5
    p_detect_count: float = 6.0
    scan_count: float = 5.0
    chance_hit: float = 0.02
    unseen_share: float = 0.2
    unseen_bounds: tuple[float, float] = (0.2, 0.9)
    stationary_speed: float = 0.3
    stationary_unseen_share: float = 0.05
    event_stationary_unseen_share: float = 0.5
    stationary_unseen_bounds: tuple[float, float] = (0.02, 0.8)
    shared_false: float = 0.3
    noise_share: float = 0.5
    noise_bounds: tuple[float, float] = (0.05, 0.95)
    agreed_std: float = 1.0
    sensor_count: float = 5.0
    weight_hits: float = 4.0
    weight_bounds: tuple[float, float] = (0.25, 5.0)
    most_gain: float = 4.0
    duplicate_weight: float = 6.0
    duplicate_log_odds: float = 0.5

    peak_share: float = 0.5
    peak_decay_s: float = 2.0
    mean_memory_s: float = 3.0
    smoothing_s: float = 0.05
    unknown_score: float = 0.8
    repeat_overlap: float = 0.4
    repeat_share: float = 0.8
    repeat_trusted: float = 0.3
    no_meaning_share: float = 0.1
    no_meaning_std: float = 0.05
    repeat_count: float = 4.0
    best_share: float = 0.3
    threshold_offset: float = 0.4
    threshold_slope: float = 0.85
    threshold_bounds: tuple[float, float] = (-1.0, 3.0)

    visible_to_hidden: float = 0.3
    hidden_to_visible: float = 2.0
    visible_to_gone: float = 0.1
    hidden_to_gone: float = 0.3
    full_scan_s: float = 0.02
    gap_prior: float = 4.5
    gap_prior_count: float = 4.0
    gap_prior_least: float = 0.3
    gap_overlap: float = 0.5
    sure: float = 0.9
    turning_s: float = 0.4
    longest_gap_s: float = 3.0

    camera_shift_std: float = 0.05
    camera_scale_std: float = 0.02
    camera_shift_bounds: tuple[float, float] = (1e-3, 0.2**0.5)
    camera_scale_bounds: tuple[float, float] = (1e-4, 0.1)
    camera_memory: float = 0.97
    camera_time_s: float = 0.3

    confirming: float = 0.15
    report: float = 0.5
    inside_share: float = 0.8
    rival: float = 0.3
    rival_age_s: float = 0.3
    doubtful_gap_s: float = 1.0
    false_posterior: float = 0.05
    false_gap_s: float = 0.1
    least_presence: float = 0.02
    outside_share: float = 0.1
    outside_gap_s: float = 0.2
    learn_period_s: float = 0.5
    remembered_tracks: int = 400

    most_on_one_spot: int = 32
    spot_overlap: float = 0.5
    most_touching: int = 128
    exact_assignment: int = 512
