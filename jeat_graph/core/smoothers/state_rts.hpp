// Rauch-Tung-Striebel smoothing over the stored states of the filter; the formulas are in smoothers/state_rts.py.
#pragma once

#include <cmath>
#include <vector>

#include "filters/singer.hpp"

namespace jeat::smoothers {

using filters::kMatrix;
using filters::kStates;
using filters::Matrix;

// Rows of matrices are this long, so that loops over them become vectors.
inline constexpr int kRow = kStates + 1;

// Cholesky factor of a symmetric positive definite matrix, in place (lower part); its diagonal is inverted.
inline void cholesky(double* a) {
    for (int j = 0; j < kStates; ++j) {
        double d = a[j * kStates + j];
        for (int k = 0; k < j; ++k) d -= a[j * kStates + k] * a[j * kStates + k];
        const double inverse = 1.0 / std::sqrt(std::max(d, 1e-300));
        a[j * kStates + j] = inverse;
        for (int i = j + 1; i < kStates; ++i) {
            double s = a[i * kStates + j];
            for (int k = 0; k < j; ++k) s -= a[i * kStates + k] * a[j * kStates + k];
            a[i * kStates + j] = s * inverse;
        }
    }
}

// One axis of one track: smooth (mean, P) by the next record's prediction and smoothed state.
inline void rts_axis(double* mean, double* P, const Matrix& F, const double* predicted_mean,
                     const double* predicted_covariance, const double* next_mean, const double* next_covariance) {
    // Solved in a scaled state: variances of position and acceleration differ by orders of magnitude.
    double scale[kStates], L[kMatrix], Gt[kStates][kRow] = {};
    for (int i = 0; i < kStates; ++i) scale[i] = 1.0 / std::sqrt(predicted_covariance[i * kStates + i]);
    for (int i = 0; i < kStates; ++i)
        for (int j = 0; j <= i; ++j) L[i * kStates + j] = predicted_covariance[i * kStates + j] * (scale[i] * scale[j]);
    cholesky(L);
    // G' = P-^-1 F P, all of its columns at once.
    for (int i = 0; i < kStates; ++i) {
        for (int k = filters::kDriven[i][0]; k <= filters::kDriven[i][1]; ++k)
            for (int j = 0; j < kStates; ++j) Gt[i][j] += F[i * kStates + k] * P[k * kStates + j];
        for (int j = 0; j < kRow; ++j) Gt[i][j] *= scale[i];
        for (int k = 0; k < i; ++k)
            for (int j = 0; j < kRow; ++j) Gt[i][j] -= L[i * kStates + k] * Gt[k][j];
        for (int j = 0; j < kRow; ++j) Gt[i][j] *= L[i * kStates + i];
    }
    for (int i = kStates - 1; i >= 0; --i) {
        for (int k = i + 1; k < kStates; ++k)
            for (int j = 0; j < kRow; ++j) Gt[i][j] -= L[k * kStates + i] * Gt[k][j];
        for (int j = 0; j < kRow; ++j) Gt[i][j] *= L[i * kStates + i];
    }
    for (int i = 0; i < kStates; ++i)
        for (int j = 0; j < kRow; ++j) Gt[i][j] *= scale[i];
    double D[kStates][kRow] = {};
    for (int k = 0; k < kStates; ++k) {
        const double moved = next_mean[k] - predicted_mean[k];
        for (int i = 0; i < kStates; ++i) mean[i] += Gt[k][i] * moved;
        for (int j = 0; j < kStates; ++j) D[k][j] = next_covariance[k * kStates + j] - predicted_covariance[k * kStates + j];
    }
    for (int i = 0; i < kStates; ++i) {
        double GD[kRow] = {}, more[kRow] = {};
        for (int k = 0; k < kStates; ++k)
            for (int j = 0; j < kRow; ++j) GD[j] += Gt[k][i] * D[k][j];
        for (int k = 0; k < kStates; ++k)
            for (int j = 0; j < kRow; ++j) more[j] += GD[k] * Gt[k][j];
        for (int j = i; j < kStates; ++j) P[i * kStates + j] = P[j * kStates + i] = P[i * kStates + j] + more[j];
    }
}

}  // namespace jeat::smoothers
