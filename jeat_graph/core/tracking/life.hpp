// The life of tracks: births, sensors compared, what each is, what it teaches, ends; the definition is
// jeat_graph/tracking/reference_life.py.
#pragma once

#include <cstdint>
#include <vector>

#include "tracking/records.hpp"
#include "tracking/scan.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

// Begin a track at every box that is left (`free`): what it is, the posterior tells. In `pairs` it becomes the box's.
void begin_tracks(State& state, const Scan& given, const CorrectedBoxes& scan, const std::vector<std::size_t>& free,
                  const ScanClock& clock, AssociatedPairs& pairs);

// Count what a sensor's boxes differ by from the others' last ones on the same real tracks; keep them.
void compare_sensors(State& state, const Scan& given, const AssociatedPairs& pairs);

// Keep of each track that was found now the least overlap ever with a better one.
void compare_overlaps(State& state);

// Compute the posterior of every track.
void judge(State& state);

// Keep the mean number of a sensor's boxes a scan that are of nothing real.
void count_false_boxes(State& state, const Scan& given);

// Learn what the sensors are worth from tracks that live and from those that ended.
void learn(State& state, double t);

// Which tracks are reported: real, and their gap, if any, likely to end well.
void report(const State& state, std::vector<std::uint8_t>& reported);

// End the tracks that are false, gone, outside, or unseen for too long; their evidence stays.
void end_tracks(State& state, Record* record);

// End all tracks and go on from another time, as if none had passed; what was learnt stays.
void reset(State& state, double t);

// A track's own P_D by a sensor.
double own_p_detect(const State& state, std::size_t row, std::size_t sensor);

// Whether a track stands, as far as is known.
inline bool is_stationary(const double* mean, const ModelConstants& c) {
    const double area = exp_of(mean[kLogSize] + mean[kStates + kLogSize]);
    return square(mean[kVelocity]) + square(mean[kStates + kVelocity]) < square(c.stationary_speed) * area;
}

// For how long no sensor has found a track (s).
inline double unseen_for(const State& state, std::size_t row) { return state.t - state.tracks.evidence.last_s[row]; }

}  // namespace jeat::tracking
