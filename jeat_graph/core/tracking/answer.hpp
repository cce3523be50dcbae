// What a step leaves behind: what it gave out, and all that the next one depends on.
#pragma once

#include <cstdint>
#include <vector>

#include "smoothers/histories.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

using smoothers::Rows;

// What the last step gave out.
struct Answer {
    Rows rows;                                   // of the tracks that are reported
    std::vector<double> mean, covariance;        // states of these
    std::vector<std::int64_t> assigned, living;  // of all boxes; the tracks before any ended
    std::vector<double> real;                    // posteriors of these
    std::vector<double> nis, noise_scale;        // of all boxes
};

// All that the next step depends on, and what the last one gave.
struct Moment {
    State state;
    Answer answer;
};

}  // namespace jeat::tracking
