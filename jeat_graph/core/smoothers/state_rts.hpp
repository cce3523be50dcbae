// Rauch-Tung-Striebel smoothing over the stored states of the filter; the formulas are in smoothers/state_rts.py.
#pragma once

#include <cmath>
#include <vector>

#include "filters/singer.hpp"

namespace jeat::smoothers {

using filters::kMatrix;
using filters::kStates;
using filters::Matrix;

// Cholesky factor of a symmetric positive definite matrix, in place (lower part).
inline void cholesky(double* a) {
    for (int j = 0; j < kStates; ++j) {
        double d = a[j * kStates + j];
        for (int k = 0; k < j; ++k) d -= a[j * kStates + k] * a[j * kStates + k];
        d = std::sqrt(std::max(d, 1e-300));
        a[j * kStates + j] = d;
        for (int i = j + 1; i < kStates; ++i) {
            double s = a[i * kStates + j];
            for (int k = 0; k < j; ++k) s -= a[i * kStates + k] * a[j * kStates + k];
            a[i * kStates + j] = s / d;
        }
    }
}

// One axis of one track: smooth (mean, P) by the next record's prediction and smoothed state.
inline void rts_axis(double* mean, double* P, const Matrix& F, const double* predicted_mean,
                     const double* predicted_covariance, const double* next_mean, const double* next_covariance) {
    // Solved in a scaled state: variances of position and acceleration differ by orders of magnitude.
    double scale[kStates], L[kMatrix], G[kMatrix];
    for (int i = 0; i < kStates; ++i) scale[i] = std::sqrt(predicted_covariance[i * kStates + i]);
    for (int i = 0; i < kStates; ++i)
        for (int j = 0; j < kStates; ++j)
            L[i * kStates + j] = predicted_covariance[i * kStates + j] / (scale[i] * scale[j]);
    cholesky(L);
    for (int column = 0; column < kStates; ++column) {
        double x[kStates];
        for (int i = 0; i < kStates; ++i) {
            double s = 0.0;
            for (int k = i; k < kStates; ++k) s += F[i * kStates + k] * P[k * kStates + column];
            x[i] = s / scale[i];
        }
        for (int i = 0; i < kStates; ++i) {
            for (int k = 0; k < i; ++k) x[i] -= L[i * kStates + k] * x[k];
            x[i] /= L[i * kStates + i];
        }
        for (int i = kStates - 1; i >= 0; --i) {
            for (int k = i + 1; k < kStates; ++k) x[i] -= L[k * kStates + i] * x[k];
            x[i] /= L[i * kStates + i];
        }
        for (int i = 0; i < kStates; ++i) G[column * kStates + i] = x[i] / scale[i];
    }
    double D[kMatrix], GD[kMatrix] = {};
    for (int k = 0; k < kMatrix; ++k) D[k] = next_covariance[k] - predicted_covariance[k];
    for (int i = 0; i < kStates; ++i)
        for (int k = 0; k < kStates; ++k) {
            mean[i] += G[i * kStates + k] * (next_mean[k] - predicted_mean[k]);
            for (int j = 0; j < kStates; ++j) GD[i * kStates + j] += G[i * kStates + k] * D[k * kStates + j];
        }
    for (int i = 0; i < kStates; ++i)
        for (int j = i; j < kStates; ++j) {
            double s = 0.0;
            for (int k = 0; k < kStates; ++k) s += GD[i * kStates + k] * G[j * kStates + k];
            const double v = (P[i * kStates + j] + P[j * kStates + i]) / 2.0 + s;
            P[i * kStates + j] = P[j * kStates + i] = v;
        }
}

}  // namespace jeat::smoothers
