// What every state that is read back must be: whatever a step, or the smoother, relies on. Throws std::invalid_argument,
// which is ValueError in Python.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "smoothers/histories.hpp"
#include "tracking/answer.hpp"
#include "tracking/value_checks.hpp"

namespace jeat::tracking {

inline void check_evidence(const std::string& name, const Evidence& e, double now) {
    for (const std::int64_t owner : e.owner)
        require(owner >= 0 && static_cast<std::size_t>(owner) < e.sensors, name + "owner", "is no sensor");
    for (const auto* column :
         {&e.hits, &e.misses, &e.stationary_hits, &e.stationary_misses, &e.recent_weight, &e.total_weight, &e.missed})
        check_counts(name + "counts", *column);
    for (std::size_t k = 0; k < e.hits.size(); ++k) {
        const double rounding = kShareRounding * (e.hits[k] + e.misses[k]);
        require(e.stationary_hits[k] <= e.hits[k] + rounding && e.stationary_misses[k] <= e.misses[k] + rounding, name,
                "has more stationary hits and misses than all");
    }
    check_flags(name + "found", e.found);
    for (const auto* column : {&e.recent, &e.peak, &e.total, &e.gained})
        check_between(name + "sums", *column, -kMostCount, kMostCount);
    check_between(name + "overlap", e.overlap, 0.0, 1.0 + kShareRounding);
    check_between(name + "detections", e.detections, 1.0, kMostCount);
    for (std::size_t k = 0; k < e.size(); ++k) {
        check_past(name + "last_s", e.last_s[k], now);
        require(e.born_s[k] <= e.last_s[k] && e.confirmed_s[k] <= e.last_s[k], name, "was seen before it began");
    }
}

inline void check_tracks(const Tracks& tracks, const State& state) {
    check_identities("tracks.track_id", tracks.track_id, state.next_id);
    check_motion("tracks", tracks.mean, tracks.covariance);
    check_sensors("tracks.used", tracks.used, state.sensors.size());
    check_between("tracks.presence", tracks.presence, 0.0, 1.0 + kShareRounding);
    for (std::size_t k = 0; k < tracks.presence.size(); k += kPresences) {
        const double sum = tracks.presence[k] + tracks.presence[k + 1] + tracks.presence[k + 2];
        require(std::abs(sum - 1.0) <= 1e-6, "tracks.presence", "does not add up to 1");
    }
    check_counts("tracks.recent_hits", tracks.recent_hits);
    check_counts("tracks.recent_misses", tracks.recent_misses);
    // Times of what has not been yet are 0, which may lie ahead of a time below 0.
    for (std::size_t k = 0; k < tracks.last_box_s.size(); ++k)
        if (tracks.last_box[k].right > tracks.last_box[k].left || tracks.last_box_s[k] != 0.0)
            check_past("tracks.last_box_s", tracks.last_box_s[k], state.t);
    for (const Sides& box : tracks.last_box)
        require(box.right >= box.left && box.bottom >= box.top, "tracks.last_box", "is inside out");
    check_flags("tracks.has_apart", tracks.has_apart);
    for (std::size_t k = 0; k < tracks.apart_s.size(); ++k)
        if (tracks.has_apart[k] || tracks.apart_s[k] != 0.0) check_past("tracks.apart_s", tracks.apart_s[k], state.t);
    check_between("tracks.apart", tracks.apart, -kMostLogSize, kMostLogSize);
    check_flags("tracks.has_innovation", tracks.has_innovation);
    check_between("tracks.innovation", tracks.innovation, -kMostLogVariance, kMostLogVariance);
    check_between("tracks.real", tracks.real, 0.0, 1.0);
    check_flags("tracks.awaited", tracks.awaited);
    check_between("tracks.sees", tracks.sees, 0.0, 1.0 + kShareRounding);
    check_evidence("tracks.", tracks.evidence, state.t);
}

inline void check_sensor(const std::string& name, const Sensor& sensor, double now) {
    for (const double count : {sensor.leftovers, sensor.false_boxes, sensor.boxes_at_edge, sensor.boxes_beyond})
        check_between(name + "counts", count, 0.0, kMostCount);
    require(!(sensor.period_s < 0.0) && !std::isinf(sensor.period_s), name + "period_s", "is no time");
    require(!std::isinf(sensor.last_scan_s), name + "last_scan_s", "is no time");
    check_past(name + "last_scan_s", sensor.last_scan_s, now);
    require(!(std::abs(sensor.even_logit) > kMostLogVariance), name + "even_logit", "is of no score");
    require(!(sensor.given_weight < 0.0) && !(sensor.given_weight > kMostLogVariance), name + "given_weight",
            "is no weight");
    require(!(sensor.given_lasting < 0.0) && !(sensor.given_lasting > 1.0), name + "given_lasting", "is no variance");
    require(!(sensor.mean_spread < kLeastSpread) && !(sensor.mean_spread > kMostSpread), name + "mean_spread",
            "is no variance");
    const RepeatCounts& counts = sensor.repetition;
    for (int bin = 0; bin < kScoreBins; ++bin) {
        const double boxes = counts.boxes[static_cast<std::size_t>(bin)],
                     repeated = counts.repeated[static_cast<std::size_t>(bin)];
        check_between(name + "boxes", boxes, 0.0, kMostCount);
        check_between(name + "repeated", repeated, 0.0, boxes * (1.0 + kShareRounding));
    }
    for (const PairSums* sums : {&counts.persistence, &counts.recurrence}) {
        for (const double count : {sums->pairs, sums->first_squared, sums->second_squared})
            check_between(name + "pairs", count, 0.0, kMostCount);
        for (const double sum : {sums->first, sums->second, sums->product})
            check_between(name + "pairs", sum, -kMostCount, kMostCount);
    }
    require(counts.scans <= kMostIdentities, name + "scans", "are too many");
    check_between(name + "last_logits", counts.last_logits, -kMostLogVariance, kMostLogVariance);
    for (const Sides& box : counts.last_boxes)
        require(box.right >= box.left && box.bottom >= box.top, name + "last_boxes", "is inside out");
    check_flags(name + "last_had_before", counts.last_had_before);
}

inline void check_accuracy(const AccuracySums& sums) {
    check_counts("accuracy.pairs", sums.pairs);
    check_between("accuracy.lasting", sums.lasting, 0.0, kMostLogVariance);
    const std::size_t S = sums.sensors();
    for (std::size_t i = 0; i < S; ++i)
        for (std::size_t j = 0; j < S; ++j) {
            const std::size_t at = i * S + j, back = j * S + i;
            require(sums.pairs[at] == sums.pairs[back] && sums.product[at] == sums.product[back], "accuracy",
                    "is not the same both ways");
            require(std::abs(sums.product[at]) <= kMostLogSize * (sums.pairs[at] + 1.0), "accuracy.product",
                    "is of no boxes");
            for (std::size_t k = 0; k < kAspectSums; ++k) {
                const double one = sums.aspect[at * kAspectSums + k], other = sums.aspect[back * kAspectSums + k];
                require(one == (changes_sign(k) ? -other : other), "accuracy.aspect", "is not the same both ways");
                require(std::abs(one) <= square(kMostLogSize) * (sums.pairs[at] + 1.0), "accuracy.aspect",
                        "is of no boxes");
            }
        }
}

inline void check_belief(const State& state) {
    const SensorBelief& belief = state.belief;
    check_unsure("belief.p_detect", belief.p_detect);
    check_unsure("belief.unseen", belief.unseen);
    check_unsure("belief.stationary_unseen", belief.stationary_unseen);
    check_unsure("belief.noise_share", std::array{belief.noise_share});
    check_between("belief.agreed_mean", belief.agreed_mean, -kMostLogVariance, kMostLogVariance);
    check_between("belief.agreed_share", belief.agreed_share, 0.0, 1.0);
    check_between("belief.agreed_std", belief.agreed_std, 0.0, kMostLogVariance);
    for (const double std : belief.agreed_std) require(std > 0.0, "belief.agreed_std", "is none");
    check_between("belief.decision_threshold", belief.decision_threshold, -kMostLogVariance, kMostLogVariance);
    check_between("belief.prior_odds", belief.prior_odds, -kMostLogVariance, kMostLogVariance);
    check_between("log_side_variance", state.log_side_variance, -kMostLogVariance, kMostLogVariance);
    const ProcessNoise& q = state.process_noise;
    check_between("process_noise", std::array{q.jerk, q.growth, q.position, q.size}, -kMostLogVariance,
                  kMostLogVariance);
    for (const double variance : {state.camera.shift, state.camera.scale})
        require(variance > 0.0, "camera", "has no variance");
    check_counts("gaps.ended", state.gaps.ended);
    for (std::size_t k = 0; k < state.gaps.ended.size(); ++k)
        check_between("gaps.ended_well", state.gaps.ended_well[k], 0.0, state.gaps.ended[k]);
    check_between("belief.score_weight", belief.score_weight, 0.0, kMostLogVariance);
    check_between("belief.stationary_prior", belief.stationary_prior, 0.0, 1.0);
    check_accuracy(state.accuracy);
    const OffsetSums& offsets = state.offsets;
    check_counts("offsets.weight", offsets.weight);
    for (std::size_t i = 0; i < offsets.sensors; ++i)
        for (std::size_t j = 0; j < offsets.sensors; ++j) {
            const std::size_t at = i * offsets.sensors + j, back = j * offsets.sensors + i;
            require(offsets.weight[at] == offsets.weight[back], "offsets.weight", "is not the same both ways");
            for (std::size_t k = 0; k < 4; ++k)
                require(offsets.total[4 * at + k] == -offsets.total[4 * back + k] &&
                            std::abs(offsets.total[4 * at + k]) <= kMostLogSize * (offsets.weight[at] + 1.0),
                        "offsets.total", "is of no boxes");
        }
}

inline void check_state(const State& state, const Answer& answer) {
    require(std::isfinite(state.t), "t", "is no time");
    require(state.width > 0.0 && state.height > 0.0, "width and height", "are none");
    require(state.next_id >= 1 && state.next_id <= kMostIdentities, "next_id", "is no identity");
    check_past("learnt_s", state.learnt_s, state.t);
    check_past("camera.picture_s", state.camera_velocity.picture_s, state.t);
    require(state.camera_velocity.until_s >= state.camera_velocity.picture_s &&
                state.camera_velocity.until_s < std::numeric_limits<double>::infinity(),
            "camera.until_s", "is no time");
    require(state.started || state.tracks.size() == 0, "tracks", "are there before the first step");
    check_tracks(state.tracks, state);
    check_evidence("ended.", state.ended, std::numeric_limits<double>::max());
    for (std::size_t k = 0; k < state.sensors.size(); ++k)
        check_sensor("sensor" + std::to_string(k) + ".", state.sensors[k], state.t);
    check_belief(state);
    check_identities("answer.living", answer.living, state.next_id);
    check_motion("answer", answer.mean, answer.covariance);
    check_between("answer.real", answer.real, 0.0, 1.0);
    for (const std::int64_t id : answer.assigned)
        require(id >= 0 && id < state.next_id, "answer.assigned", "are no tracks");
}

inline void check_rows(const std::string& name, const Rows& rows, const State& state) {
    check_sensors(name, rows.used, state.sensors.size());
    check_between(name, rows.real, 0.0, 1.0);
    for (const std::int64_t id : rows.track_id) require(id > 0 && id <= kMostIdentities, name, "are of no tracks");
    for (const double share : rows.share) require(!(share < 0.0) && !(share > 1.0), name, "hold no shares");
    for (const double t : rows.t) require(std::isfinite(t), name, "are of no time");
}

inline void check_entries(const History& history, const State& state) {
    const std::string name = "histories";
    double before = -std::numeric_limits<double>::infinity();
    require(history.missed >= -1.0 && history.missed <= kMostCount, name, "have missed less than nothing");
    require(history.last_later <= 1.0, name, "hold what is no probability");
    for (const Entry& entry : history.entries) {
        require(entry.t >= before && entry.t <= state.t && entry.dt >= 0.0, name, "are in no order of time");
        require(entry.missed >= 0.0 && entry.missed <= kMostCount, name, "have missed less than nothing");
        require(entry.real >= 0.0 && entry.real <= 1.0 && entry.later <= 1.0, name, "hold what is no probability");
        check_sensors(name, {entry.used}, state.sensors.size());
        before = entry.t;
        for (const auto* mean : {&entry.mean, &entry.predicted_mean})
            for (int axis = 0; axis < 2; ++axis)
                for (const int place : {kLogSize, kGrowth, kSizeError})
                    require(std::abs((*mean)[static_cast<std::size_t>(axis) * kStates + place]) <= kMostLogSize, name,
                            "hold what is no size");
        std::array<double, kCovariance> whole;
        for (const auto* halves : {&entry.predicted_covariance, &entry.covariance}) {
            smoothers::unfold(*halves, whole.data());
            require(is_covariance(whole.data()) && is_covariance(&whole[kMatrix]), name, "hold what is no covariance");
        }
    }
}

inline void check_histories(Histories& histories, const State& state, bool smooths) {
    const std::vector<History>& living = histories.living();
    // There are none where the tracker has been finished.
    bool fits = living.empty() || (smooths && living.size() == state.tracks.size());
    for (std::size_t i = 0; fits && i < living.size(); ++i) fits = living[i].track_id == state.tracks.track_id[i];
    require(fits, "histories.track_id", "are not those of the tracks");
    for (const History& history : living) {
        require(history.called.track_id > 0 && history.called.track_id <= kMostIdentities, "histories.given",
                "are none");
        require(!(history.called.share < 0.0) && !(history.called.share > 1.0), "histories.share", "are none");
        check_entries(history, state);
    }
    check_rows("final", histories.rows(), state);
}

}  // namespace jeat::tracking
