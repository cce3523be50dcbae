#include "tracking/records.hpp"

#include <algorithm>

namespace jeat::tracking {

namespace {

void begin_entry(const State& state, std::size_t row, double dt, smoothers::Entry& entry) {
    entry.t = state.t;
    entry.dt = dt;
    record_prediction(state.tracks, row, entry);
}

}  // namespace

void record_growth(const State& state, Record& record) {
    for (std::size_t i = 0; i < state.tracks.size(); ++i) record.growth.push_back(mean_growth(state.tracks.mean_of(i)));
}

void record_predictions(const State& state, std::size_t sensor, double dt, Record& record) {
    const std::size_t n = state.tracks.size();
    smoothers::Entry* const entries = record.begin_scan(n, sensor);
    for (std::size_t i = 0; i < n; ++i) begin_entry(state, i, dt, entries[i]);
}

void record_prediction(const Tracks& tracks, std::size_t row, smoothers::Entry& entry) {
    std::copy_n(tracks.mean_of(row), kMean, entry.predicted_mean.begin());
    smoothers::halve(tracks.covariance_of(row), entry.predicted_covariance);
}

void record_updates(const State& state, const Scan& scan, const AssociatedPairs& pairs, Record& record) {
    const Tracks& tracks = state.tracks;
    const std::size_t before = record.tracks.back();
    smoothers::Entry* const entries = record.grow_scan(tracks.size());
    record.growth.resize(record.entries.size(), 0.0);
    for (std::size_t i = before; i < tracks.size(); ++i) begin_entry(state, i, 0.0, entries[i]);
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        std::copy_n(tracks.mean_of(i), kMean, entries[i].mean.begin());
        smoothers::halve(tracks.covariance_of(i), entries[i].covariance);
    }
    for (std::size_t j = 0; j < scan.later.size(); ++j) entries[pairs.track_of[j]].later = scan.later[j];
}

void record_step(const State& state, Record& record) {
    const Tracks& tracks = state.tracks;
    record.gaps = state.gaps;
    record.track_id = tracks.track_id;
    smoothers::Entry* const entries = record.last_scan();
    for (std::size_t i = 0; entries && i < tracks.size(); ++i) {
        entries[i].real = tracks.real[i];
        entries[i].used = tracks.used[i];
        entries[i].confirmed = tracks.evidence.confirmed_s[i] == state.t;
        entries[i].missed = entries[i].confirmed ? 0.0 : tracks.evidence.missed[i];
        entries[i].last_of_step = true;
    }
}

}  // namespace jeat::tracking
