// Written by .ci/core_constants.py from the constants of Python, which say what each is.
#pragma once

#include <array>

// clang-format off

namespace jeat::filters {

// filters.singer
inline constexpr int kPosition = 0;
inline constexpr int kVelocity = 1;
inline constexpr int kAcceleration = 2;
inline constexpr int kLogSize = 3;
inline constexpr int kGrowth = 4;
inline constexpr int kPositionError = 5;
inline constexpr int kSizeError = 6;
inline constexpr int kStates = 7;
inline constexpr int kMotion = 5;
inline constexpr double kTicksPerS = 1000000.0;
inline constexpr double kLeastPerspective = 1e-06;
// filters.sensor_accuracy
inline constexpr int kSweeps = 50;
inline constexpr double kLeastShare = 1e-12;
inline constexpr std::array<double, 4> kToSides{0.5, 0.5, 0.125, 0.125};
// filters.visibility
inline constexpr int kVisible = 0;
inline constexpr int kHidden = 1;
inline constexpr int kGone = 2;
inline constexpr int kPresences = 3;
// filters.box_sides
inline constexpr double kLeastArea = 1e-09;
inline constexpr double kLog2Pi = 1.8378770664093453;
inline constexpr double kLeastProbability = 0.02;
inline constexpr double kLeastWeight = 0.001;
inline constexpr double kOutwards = -20.0;
inline constexpr double kMostDistance = 200.0;
inline constexpr double kUnmeasured = 100.0;
// filters.sensor_offsets
inline constexpr double kLeastPrecision = 1e-12;
// filters.picture_motion
inline constexpr double kSpansKnown = 2.0;
// filters.camera_motion
inline constexpr double kPairingGate = 12.0;
inline constexpr double kPairingDeviations = 9.0;
inline constexpr double kPairingMost = 0.16;
inline constexpr double kReweighting = 3.0;
inline constexpr int kReweightings = 4;
inline constexpr int kLeastTracks = 2;
inline constexpr int kLeastWitnesses = 3;
inline constexpr int kLeastTenths = 7;
// filters.gap_survival
inline constexpr std::array<double, 10> kGapBinEnds{0.0, 0.6, 1.2, 2.25, 3.75, 6.0, 10.5, 16.5, 27.0, 45.0};
// filters.score_calibration
inline constexpr double kFirstLogit = -4.5;
inline constexpr double kLogitStep = 0.25;
inline constexpr int kScoreBins = 47;
inline constexpr double kBandwidth = 0.35;
inline constexpr double kBestCount = 5.0;
inline constexpr double kLeastBoxes = 1e-09;
inline constexpr double kLeastVariance = 1e-06;
inline constexpr double kMostCorrelation = 0.999;
// filters.object_probability
inline constexpr double kLeastApart = 0.001;
inline constexpr double kLeastSum = 1e-09;
inline constexpr double kMostLogOdds = 30.0;
inline constexpr int kRounds = 2;
inline constexpr double kLeastMisses = 0.2;
inline constexpr double kLeastScans = 1.0;

}  // namespace jeat::filters

namespace jeat::association {

// association.likelihood_ratio
inline constexpr double kLeastPDetect = 0.01;
inline constexpr double kMostPDetect = 0.99;
inline constexpr double kLeastPosterior = 0.02;
// tracking.reference
inline constexpr double kLeastGain = 1e-09;

}  // namespace jeat::association

namespace jeat::smoothers {

// smoothers.histories
inline constexpr double kGolden = 0.6180339887498949;
inline constexpr int kLowBits = 65535;

}  // namespace jeat::smoothers

namespace jeat::tracking {

// tracking.engine
inline constexpr double kLongestSilenceS = 300.0;
// tracking.reference
inline constexpr double kPeriodMemory = 0.9;
inline constexpr int kCameraDetections = 2;
inline constexpr double kCameraAgeS = 0.5;
// tracking.reference_life
inline constexpr double kSameTimeS = 1e-06;
inline constexpr double kLongestAgoS = 1000000000.0;

}  // namespace jeat::tracking

// Those that a tracker may be given other values of: filters/model_constants.py.
#define JEAT_MODEL_CONSTANTS \
    JEAT_ONE(velocity_time_s) \
    JEAT_ONE(acceleration_time_s) \
    JEAT_ONE(growth_time_s) \
    JEAT_ONE(error_time_s) \
    JEAT_ONE(error_share) \
    JEAT_ONE(jerk) \
    JEAT_ONE(growth_noise) \
    JEAT_ONE(position_walk) \
    JEAT_ONE(size_walk) \
    JEAT_ONE(most_perspective) \
    JEAT_ONE(perspective_jerk) \
    JEAT_ONE(fastest_growth) \
    JEAT_ONE(velocity_std) \
    JEAT_ONE(acceleration_std) \
    JEAT_ONE(growth_std) \
    JEAT_ONE(side_std) \
    JEAT_PAIR(side_std_bounds) \
    JEAT_ONE(pixel_std) \
    JEAT_PAIR(spread_bounds) \
    JEAT_ONE(spread_rate) \
    JEAT_ONE(degrees_of_freedom) \
    JEAT_ONE(cut_share) \
    JEAT_ONE(cut_gate) \
    JEAT_ONE(uncovered_share) \
    JEAT_ONE(most_uncovered) \
    JEAT_ONE(edge_px) \
    JEAT_ONE(edge_std) \
    JEAT_ONE(edge_birth) \
    JEAT_ONE(offset_count) \
    JEAT_ONE(offset_clip) \
    JEAT_ONE(offset_age_s) \
    JEAT_ONE(lasting_after_s) \
    JEAT_ONE(lasting_within_s) \
    JEAT_ONE(lasting_clip) \
    JEAT_ONE(lasting_count) \
    JEAT_ONE(aspect_pairs) \
    JEAT_ONE(aspect_prior) \
    JEAT_ONE(aspect_clip) \
    JEAT_ONE(lasting_boxes) \
    JEAT_ONE(compared_std) \
    JEAT_ONE(gate) \
    JEAT_ONE(clutter_size_area) \
    JEAT_ONE(clutter_memory) \
    JEAT_ONE(clutter_prior) \
    JEAT_ONE(first_leftovers) \
    JEAT_ONE(clutter_precision) \
    JEAT_ONE(score_floor) \
    JEAT_ONE(innovation_clip) \
    JEAT_ONE(nis_cap) \
    JEAT_ONE(nis_target) \
    JEAT_ONE(noise_rate) \
    JEAT_ONE(process_rate) \
    JEAT_ONE(walk_rate) \
    JEAT_ONE(noise_tracks) \
    JEAT_ONE(noise_period_s) \
    JEAT_ONE(noise_hits) \
    JEAT_PAIR(jerk_bounds) \
    JEAT_PAIR(growth_bounds) \
    JEAT_PAIR(walk_bounds) \
    JEAT_ONE(correlation_time_s) \
    JEAT_ONE(first_period_s) \
    JEAT_ONE(p_detect) \
    JEAT_ONE(p_detect_strength) \
    JEAT_PAIR(p_detect_bounds) \
    JEAT_PAIR(track_p_detect_bounds) \
    JEAT_ONE(track_p_detect_memory_s) \
    JEAT_ONE(p_detect_count) \
    JEAT_ONE(scan_count) \
    JEAT_ONE(chance_hit) \
    JEAT_ONE(unseen_share) \
    JEAT_PAIR(unseen_bounds) \
    JEAT_ONE(stationary_speed) \
    JEAT_ONE(stationary_unseen_share) \
    JEAT_ONE(event_stationary_unseen_share) \
    JEAT_PAIR(stationary_unseen_bounds) \
    JEAT_ONE(shared_false) \
    JEAT_ONE(noise_share) \
    JEAT_PAIR(noise_bounds) \
    JEAT_ONE(agreed_std) \
    JEAT_ONE(sensor_count) \
    JEAT_ONE(weight_hits) \
    JEAT_PAIR(weight_bounds) \
    JEAT_ONE(most_gain) \
    JEAT_ONE(duplicate_weight) \
    JEAT_ONE(duplicate_log_odds) \
    JEAT_ONE(peak_share) \
    JEAT_ONE(peak_decay_s) \
    JEAT_ONE(mean_memory_s) \
    JEAT_ONE(smoothing_s) \
    JEAT_ONE(unknown_score) \
    JEAT_ONE(repeat_overlap) \
    JEAT_ONE(repeat_share) \
    JEAT_ONE(repeat_trusted) \
    JEAT_ONE(no_meaning_share) \
    JEAT_ONE(no_meaning_std) \
    JEAT_ONE(repeat_count) \
    JEAT_ONE(best_share) \
    JEAT_ONE(threshold_offset) \
    JEAT_ONE(threshold_slope) \
    JEAT_PAIR(threshold_bounds) \
    JEAT_ONE(visible_to_hidden) \
    JEAT_ONE(hidden_to_visible) \
    JEAT_ONE(visible_to_gone) \
    JEAT_ONE(hidden_to_gone) \
    JEAT_ONE(full_scan_s) \
    JEAT_ONE(gap_prior) \
    JEAT_ONE(gap_prior_count) \
    JEAT_ONE(gap_prior_least) \
    JEAT_ONE(gap_overlap) \
    JEAT_ONE(sure) \
    JEAT_ONE(turning_s) \
    JEAT_ONE(longest_gap_s) \
    JEAT_ONE(camera_shift_std) \
    JEAT_ONE(camera_scale_std) \
    JEAT_PAIR(camera_shift_bounds) \
    JEAT_PAIR(camera_scale_bounds) \
    JEAT_ONE(camera_memory) \
    JEAT_ONE(camera_time_s) \
    JEAT_ONE(confirming) \
    JEAT_ONE(report) \
    JEAT_ONE(inside_share) \
    JEAT_ONE(rival) \
    JEAT_ONE(rival_age_s) \
    JEAT_ONE(doubtful_gap_s) \
    JEAT_ONE(false_posterior) \
    JEAT_ONE(false_gap_s) \
    JEAT_ONE(least_presence) \
    JEAT_ONE(outside_share) \
    JEAT_ONE(outside_gap_s) \
    JEAT_ONE(learn_period_s) \
    JEAT_ONE(remembered_tracks) \
    JEAT_ONE(most_on_one_spot) \
    JEAT_ONE(spot_overlap) \
    JEAT_ONE(most_touching) \
    JEAT_ONE(exact_assignment)
// clang-format on
