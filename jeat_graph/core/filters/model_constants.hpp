// The constants that `Tracker(constants=…)` may change: what they are, their units and sources say filters/model_constants.py.
#pragma once

#include <stdexcept>
#include <string>

#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>

namespace jeat::filters {

struct Bounds {
    double low, high;
};

// clang-format off
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
    JEAT_ONE(exact_assignment)
// clang-format on

struct ModelConstants {
#define JEAT_ONE(name) double name;
#define JEAT_PAIR(name) Bounds name;
    JEAT_MODEL_CONSTANTS
#undef JEAT_ONE
#undef JEAT_PAIR
};

// Take the constants from a Python object by their names.
inline ModelConstants constants_of(const nanobind::handle& source) {
    ModelConstants c;
#define JEAT_ONE(name) c.name = nanobind::cast<double>(source.attr(#name));
#define JEAT_PAIR(name)                                                              \
    {                                                                                \
        const auto pair = nanobind::cast<std::pair<double, double>>(source.attr(#name)); \
        c.name = {pair.first, pair.second};                                          \
    }
    JEAT_MODEL_CONSTANTS
#undef JEAT_ONE
#undef JEAT_PAIR
    return c;
}

}  // namespace jeat::filters
