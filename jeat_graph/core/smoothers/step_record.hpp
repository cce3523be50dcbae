// What the filter did in one step, for the smoother.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "filters/gap_survival.hpp"
#include "filters/singer.hpp"
#include "smoothers/state_rts.hpp"

namespace jeat::smoothers {

using filters::GapCounts;
using filters::kCovariance;
using filters::kMean;

// The upper triangles of both axes' covariances, which are symmetric to the last bit.
inline constexpr int kHalf = kStates * (kStates + 1) / 2;
using Halves = std::array<double, 2 * kHalf>;

inline void halve(const double* covariance, Halves& out) {
    std::size_t to = 0;
    for (int axis = 0; axis < 2; ++axis)
        for (int i = 0; i < kStates; ++i)
            for (int j = i; j < kStates; ++j) out[to++] = covariance[axis * kMatrix + i * kStates + j];
}
inline void unfold(const Halves& halves, double* out) {
    std::size_t from = 0;
    for (int axis = 0; axis < 2; ++axis)
        for (int i = 0; i < kStates; ++i)
            for (int j = i; j < kStates; ++j, ++from)
                out[axis * kMatrix + i * kStates + j] = out[axis * kMatrix + j * kStates + i] = halves[from];
}

// One update of one track.
struct Entry {
    double t, dt;         // time, and since the last update (s)
    double real = 0.0;    // posterior after the step, where this was its last update
    double later = -1.0;  // posterior by what comes later, where a detection was found and that is given
    std::int64_t used = 0;
    bool confirmed = false;  // by a detection of that time
    double missed = 0.0;     // detections that were to be expected since one did; 0 where it is of that time
    bool last_of_step = false;
    std::array<double, kMean> predicted_mean, mean;
    Halves predicted_covariance, covariance;
};

// What the filter did in one step. It is kept apart until no step can come before this one any more.
struct Record {
    double t = 0.0;
    bool is_reset = false;               // all tracks had ended before the step
    std::vector<std::int64_t> track_id;  // of the tracks after it, before any of them ended
    std::vector<std::size_t> tracks;     // how many there were after each scan
    std::vector<std::size_t> known;      // of these, how many had been born before it
    std::vector<std::size_t> sensors;    // whose scan each was
    std::vector<Entry> entries;          // scan by scan, in the order of the tracks
    std::vector<double> growth;          // of each entry's track before its step: its transition follows from that
    std::vector<std::uint8_t> kept;      // which of the tracks live on
    GapCounts gaps, gaps_after;          // before and after tracks ended

    void begin(double time) {
        t = time;
        is_reset = false;
        track_id.clear(), tracks.clear(), known.clear(), sensors.clear(), entries.clear(), growth.clear(), kept.clear();
    }
    // The entries of a scan of so many tracks; more may be born in it.
    Entry* begin_scan(std::size_t number, std::size_t sensor) {
        sensors.push_back(sensor);
        known.push_back(number);
        entries.resize(entries.size() + number);
        tracks.push_back(number);
        return entries.data() + entries.size() - number;
    }
    Entry* grow_scan(std::size_t number) {
        entries.resize(entries.size() + number - tracks.back());
        tracks.back() = number;
        return entries.data() + entries.size() - number;
    }
    Entry* last_scan() { return tracks.empty() ? nullptr : entries.data() + entries.size() - tracks.back(); }
};

}  // namespace jeat::smoothers
