// What the pairs of a scan change: states, noises, evidence, presence, and what is counted of gaps and clutter.
#pragma once

#include <vector>

#include "tracking/records.hpp"
#include "tracking/scan.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

// Count the gaps that end now, and whether the object was where it had been predicted.
void count_gaps(State& state, const CorrectedBoxes& scan, const AssociatedPairs& pairs);

// Learn measurement noise of the sensor and process noise of the scene from innovations.
void learn_noise(State& state, std::size_t sensor, const CorrectedBoxes& scan, const AssociatedPairs& pairs,
                 const ScanClock& clock);

// Update the states of tracks by their boxes.
void update(State& state, const CorrectedBoxes& scan, const AssociatedPairs& pairs, const ShareLogs& logs,
            Record* record);

// Write down of tracks whose boxes are given whether more are to come.
void await_more(State& state, const Scan& given, const AssociatedPairs& pairs);

// Write down what the sensor found and what it did not: evidence, the track's own P_D, presence.
void count_hits_and_misses(State& state, const Scan& given, const AssociatedPairs& pairs, const ScanClock& clock);

// Find the boxes that no track took, and keep their mean number.
void count_clutter(State& state, std::size_t sensor, const AssociatedPairs& pairs, std::vector<std::size_t>& free);

}  // namespace jeat::tracking
