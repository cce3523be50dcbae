// Rows of a table of tracks, in columns; smoothers/rows.py has them for the reference.
#pragma once

#include <cstdint>
#include <vector>

#include "filters/singer.hpp"

namespace jeat::smoothers {

using filters::ModelConstants;

// What a track is called in the rows that are given out.
struct Called {
    std::int64_t track_id = 0;  // the identity that was given out for it
    std::int64_t label = -1;    // number of its class, below 0 where there is none
    double share = 0.0;         // of the votes that speak for the class
};

// Rows of a table, in columns.
struct Rows {
    std::vector<double> t, mean, variance, real, share;
    std::vector<std::int64_t> track_id, used, label;

    std::size_t size() const { return track_id.size(); }
    void clear() {
        t.clear(), mean.clear(), variance.clear(), real.clear(), share.clear();
        track_id.clear(), used.clear(), label.clear();
    }
    void add(double at, const Called& called, const double* state, const double* covariance, double probability,
             std::int64_t sensors, const ModelConstants& c) {
        t.push_back(at);
        track_id.push_back(called.track_id);
        label.push_back(called.label);
        share.push_back(called.share);
        real.push_back(probability);
        used.push_back(sensors);
        // Told is the box as detectors have it, and how far that may be from the object.
        const std::size_t first = mean.size();
        mean.resize(first + 2 * filters::kMotion);
        variance.resize(first + 2 * filters::kMotion);
        filters::report_motion(state, covariance, c, mean.data() + first, variance.data() + first);
    }
};

}  // namespace jeat::smoothers
