// Rauch-Tung-Striebel smoothing over the stored states of the filter; the formulas are in smoothers/state_rts.py.
#pragma once

#include "filters/singer.hpp"

namespace jeat::smoothers {

using filters::kMatrix;
using filters::kRow;
using filters::kStates;
using filters::Matrix;

// Smooth one track's (mean, P) of both axes by the next record's prediction and smoothed state.
void rts(double* means, double* covariances, const Matrix& F, const double* predicted_means,
         const double* predicted_covariances, const double* next_means, const double* next_covariances);

}  // namespace jeat::smoothers
