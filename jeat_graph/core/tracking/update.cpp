#include "tracking/update.hpp"

#include <algorithm>
#include <cstdint>

#include "filters/noise_learning.hpp"
#include "tracking/life.hpp"

namespace jeat::tracking {

void count_gaps(State& state, const CorrectedBoxes& scan, const AssociatedPairs& pairs) {
    const Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    for (const auto& [i, j, gain] : pairs.made) {
        const double gap = tracks.evidence.missed[i];
        if (!(tracks.real[i] > c.report) || !(gap > 0.0) || !pairs.confirms[j]) continue;
        state.gaps.count_end(gap, intersection_over_union(pairs.expected[i].box, scan.boxes[j]) >= c.gap_overlap);
    }
}

// Boxes at the edge of the picture teach nothing, and the next box of such a track has none before it.
void learn_noise(State& state, std::size_t sensor, const CorrectedBoxes& scan, const AssociatedPairs& pairs,
                 const ScanClock& clock) {
    Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    InnovationSums sums;
    SpreadSums spreads;
    for (std::size_t m = 0; m < pairs.made.size(); ++m) {
        const std::size_t i = pairs.made[m].row;
        if (scan.edges[pairs.made[m].column].any()) {
            tracks.has_innovation[i] = 0;
            continue;
        }
        const std::size_t j = pairs.made[m].column;
        const SidesExpected& expected = pairs.expected_of(m);
        const Innovation e = normalised_innovation(pairs.innovation[m], expected, c);
        double* const before = tracks.innovation.data() + i * 4;
        if (tracks.evidence.detections[i] > c.noise_hits && tracks.real[i] > c.report) {
            sums.add(e, before, tracks.has_innovation[i], c);
            if (!scan.spreads.empty()) spreads.add(scan.spreads[j], scan.boxes[j], expected.size);
        }
        std::copy(e.begin(), e.end(), before);
        tracks.has_innovation[i] = 1;
    }
    double& log_variance = state.log_side_variance[sensor];
    spreads.learn(sums.share(clock.period_s, c), log_variance, state.sensors[sensor].mean_spread, c);
    filters::learn_noise(sums, clock.period_s, log_variance, state.process_noise, c);
}

void update(State& state, const CorrectedBoxes& scan, const AssociatedPairs& pairs, const ShareLogs& logs,
            Record* record) {
    Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    smoothers::Entry* const entries = record ? record->last_scan() : nullptr;
    for (std::size_t m = 0; m < pairs.made.size(); ++m) {
        const std::size_t i = pairs.made[m].row;
        double *const mean = tracks.mean_of(i), *const covariance = tracks.covariance_of(i);
        const auto& y = pairs.innovation[m];
        const Edges cut = unmeasured_sides(y, scan.edges[pairs.made[m].column]);
        const SidesExpected expected = cut.any() ? with_cut(pairs.expected_of(m), cut, c) : pairs.expected_of(m);
        std::array<double, 4> left_over = y;
        // To the smoother a side that shows again is part of the prediction: the states before did not know of it.
        if (uncover_sides(mean, covariance, left_over, expected, cut, logs, c) && record)
            record_prediction(tracks, i, entries[i]);
        filters::update(mean, covariance, y, left_over, expected, cut, logs, c);
    }
}

void await_more(State& state, const Scan& given, const AssociatedPairs& pairs) {
    if (given.owners.empty()) return;
    for (const auto& [i, j, gain] : pairs.made) state.tracks.awaited[i] = given.awaited[j];
}

void count_hits_and_misses(State& state, const Scan& given, const AssociatedPairs& pairs, const ScanClock& clock) {
    Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    const std::size_t n = tracks.size(), S = state.sensors.size(), k = given.sensor;
    const double keep = exp_of(-clock.weight * c.correlation_time_s / c.track_p_detect_memory_s);
    for (std::size_t i = 0; i < n; ++i) {
        double* const presence = tracks.presence_of(i);
        double &hits = tracks.recent_hits[i * S + k], &misses = tracks.recent_misses[i * S + k];
        hits *= keep;
        misses *= keep;
        const bool stationary = is_stationary(tracks.mean_of(i), c);
        const double p_detect = pairs.p_detect[i];
        tracks.evidence.expect_hit(i, p_detect, tracks.sees[i * S + k], clock);
        if (pairs.pair_of[i] == pairs.made.size()) {
            const double visible = presence[kVisible];
            // What stands may be missed because the sensor does not see it then.
            miss_presence(presence, stationary ? p_detect * (1.0 - state.belief.stationary_unseen[k]) : p_detect);
            tracks.evidence.count_miss(i, k, visible, stationary, clock.weight);
            misses += clock.weight * visible;
        } else {
            const association::Pair& pair = pairs.made[pairs.pair_of[i]];
            see_presence(presence);
            tracks.evidence.count_hit(i, k, given.logits[pair.column], pair.gain, stationary,
                                      pairs.confirms[pair.column], clock, c);
            hits += clock.weight;
            tracks.used[i] |= std::int64_t{1} << k;
        }
    }
}

void count_clutter(State& state, std::size_t sensor, const AssociatedPairs& pairs, std::vector<std::size_t>& free) {
    free.clear();
    for (std::size_t j = 0; j < pairs.track_of.size(); ++j)
        if (pairs.track_of[j] == state.tracks.size()) free.push_back(j);
    const double keep = state.constants.clutter_memory;
    double& mean = state.sensors[sensor].leftovers;
    mean = keep * mean + (1.0 - keep) * static_cast<double>(free.size());
}

}  // namespace jeat::tracking
