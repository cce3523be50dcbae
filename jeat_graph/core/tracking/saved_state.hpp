// The state as arrays by name, and back: for files. A visitor walks over all members in one order, so what is written
// is what is read; a member that it does not name does not compile.
#pragma once

#include <string>
#include <string_view>

#include "tracking/saving.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

template <class Visitor, class Table>
void visit_table(Visitor& v, const std::string& prefix, Table& table, std::size_t rows) {
    table.columns([&](const char* name, auto& column, std::size_t width) {
        // Of times is known elsewhere what they may be; they are never multiplied.
        v.column(prefix + name, column, rows, width,
                 std::string_view(name).ends_with("_s") ? Values::any : Values::finite);
    });
}

template <class Visitor> void visit_pairs(Visitor& v, const std::string& prefix, PairSums& sums) {
    auto& [pairs, first, second, first_squared, second_squared, product] = sums;
    v.numbers(prefix + "pairs", &pairs, 1);
    v.numbers(prefix + "first", &first, 1);
    v.numbers(prefix + "second", &second, 1);
    v.numbers(prefix + "first_squared", &first_squared, 1);
    v.numbers(prefix + "second_squared", &second_squared, 1);
    v.numbers(prefix + "product", &product, 1);
}

template <class Visitor> void visit_sensor(Visitor& v, const std::string& prefix, Sensor& sensor) {
    auto& [leftovers, false_boxes, boxes_at_edge, boxes_beyond, period_s, last_scan_s, repetition, even_logit,
           given_weight, given_lasting, mean_spread] = sensor;
    v.numbers(prefix + "leftovers", &leftovers, 1);
    v.numbers(prefix + "false_boxes", &false_boxes, 1);
    v.numbers(prefix + "boxes_at_edge", &boxes_at_edge, 1);
    v.numbers(prefix + "boxes_beyond", &boxes_beyond, 1);
    v.numbers(prefix + "period_s", &period_s, 1, Values::any);
    v.numbers(prefix + "last_scan_s", &last_scan_s, 1, Values::any);
    v.numbers(prefix + "even_logit", &even_logit, 1, Values::any);
    v.numbers(prefix + "given_weight", &given_weight, 1, Values::any);
    v.numbers(prefix + "given_lasting", &given_lasting, 1, Values::any);
    v.numbers(prefix + "mean_spread", &mean_spread, 1, Values::any);
    auto& [boxes, repeated, persistence, recurrence, scans, last_boxes, last_logits, last_had_before, has_last] =
        repetition;
    std::size_t rows = last_boxes.size();
    v.whole(prefix + "rows", rows);
    v.numbers(prefix + "boxes", boxes.data(), boxes.size());
    v.numbers(prefix + "repeated", repeated.data(), repeated.size());
    visit_pairs(v, prefix + "persistence.", persistence);
    visit_pairs(v, prefix + "recurrence.", recurrence);
    v.whole(prefix + "scans", scans);
    v.column(prefix + "last_boxes", last_boxes, rows, 1);
    v.column(prefix + "last_logits", last_logits, rows, 1);
    v.column(prefix + "last_had_before", last_had_before, rows, 1);
    v.whole(prefix + "has_last", has_last);
}

template <class Visitor> void visit_state(Visitor& v, State& state) {
    auto& [constants, tracks, t, started, next_id, width, height, picture_known, process_noise, camera, camera_velocity,
           camera_path, gaps, belief, offsets, accuracy, log_side_variance, sensors, ended, learnt_s] = state;
    (void)constants;  // the caller's
    std::size_t S = sensors.size(), rows = tracks.size(), ended_rows = ended.size();
    v.whole("sensors", S);
    StateReader::require(S < 64, "sensors", "are too many");
    sensors.resize(S);
    tracks.evidence.sensors = ended.sensors = offsets.sensors = S;
    for (std::size_t k = 0; k < S; ++k) visit_sensor(v, "sensor" + std::to_string(k) + ".", sensors[k]);
    v.whole("tracks", rows);
    visit_table(v, "tracks.", tracks, rows);
    v.whole("ended", ended_rows);
    visit_table(v, "ended.", ended, ended_rows);
    v.numbers("t", &t, 1, Values::any);
    v.whole("started", started);
    v.whole("next_id", next_id);
    v.numbers("width", &width, 1);
    v.numbers("height", &height, 1);
    v.whole("picture_known", picture_known);
    auto& [jerk, growth, position, size] = process_noise;
    v.numbers("process_noise.jerk", &jerk, 1);
    v.numbers("process_noise.growth", &growth, 1);
    v.numbers("process_noise.position", &position, 1);
    v.numbers("process_noise.size", &size, 1);
    auto& [shift, scale, last] = camera;
    v.numbers("camera.shift", &shift, 1);
    v.numbers("camera.scale", &scale, 1);
    v.numbers("camera.last", last.data(), last.size());
    auto& [rate, picture_s, until_s] = camera_velocity;
    v.numbers("camera.centre", rate.centre.data(), rate.centre.size());
    v.numbers("camera.rate", rate.theta.data(), rate.theta.size());
    v.numbers("camera.picture_s", &picture_s, 1, Values::any);
    v.numbers("camera.until_s", &until_s, 1, Values::any);
    auto& [moved, velocity] = camera_path;
    v.numbers("camera.moved", moved.data(), moved.size());
    v.numbers("camera.velocity", velocity.data(), velocity.size());
    auto& [gaps_ended, ended_well] = gaps;
    v.numbers("gaps.ended", gaps_ended.data(), gaps_ended.size());
    v.numbers("gaps.ended_well", ended_well.data(), ended_well.size());
    auto& [p_detect, unseen, stationary_unseen, decision_threshold, prior_odds, agreed_mean, agreed_std, agreed_share,
           score_weight, stationary_prior, noise_share] = belief;
    v.column("belief.agreed_mean", agreed_mean, S, 1);
    v.column("belief.agreed_std", agreed_std, S, 1);
    v.column("belief.agreed_share", agreed_share, S, 1);
    v.column("belief.score_weight", score_weight, S, 1);
    v.column("belief.stationary_prior", stationary_prior, S, 1);
    v.column("belief.p_detect", p_detect, S, 1);
    v.column("belief.unseen", unseen, S, 1);
    v.column("belief.stationary_unseen", stationary_unseen, S, 1);
    v.column("belief.decision_threshold", decision_threshold, S, 1);
    v.column("belief.prior_odds", prior_odds, S, 1);
    v.numbers("belief.noise_share", &noise_share, 1);
    auto& [offset_sensors, weight, total] = offsets;
    (void)offset_sensors;
    v.column("offsets.weight", weight, S * S, 1);
    v.column("offsets.total", total, S * S, 4);
    auto& [pairs, product, aspect, lasting] = accuracy;
    v.column("accuracy.pairs", pairs, S * S, 1);
    v.column("accuracy.product", product, S * S, 1);
    v.column("accuracy.aspect", aspect, S * S, kAspectSums);
    v.column("accuracy.lasting", lasting, S, 1);
    v.column("log_side_variance", log_side_variance, S, 1);
    v.numbers("learnt_s", &learnt_s, 1, Values::any);
}

}  // namespace jeat::tracking
