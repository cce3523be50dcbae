// What a step did to the tracks, written down for the smoother: `record` of the reference.
#pragma once

#include "smoothers/step_record.hpp"
#include "tracking/scan.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

using smoothers::Record;

// The tracks as a scan finds them: before it they are predicted over `dt` (s).
void record_growth(const State& state, Record& record);
void record_predictions(const State& state, std::size_t sensor, double dt, Record& record);
void record_prediction(const Tracks& tracks, std::size_t row, smoothers::Entry& entry);

// The tracks as a scan leaves them, those that it began among them.
void record_updates(const State& state, const Scan& scan, const AssociatedPairs& pairs, Record& record);

// What all scans of the time made of the tracks.
void record_step(const State& state, Record& record);

}  // namespace jeat::tracking
