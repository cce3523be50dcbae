// Rauch-Tung-Striebel smoothing over the stored states of the filter; the formulas are in smoothers/state_rts.py.
#pragma once

#include <cmath>
#include <vector>

#include "filters/singer.hpp"
#include "wide.hpp"

namespace jeat::smoothers {

using filters::kMatrix;
using filters::kRow;
using filters::kStates;
using filters::Matrix;

// Cholesky factors of two symmetric positive definite matrices, side by side and in place (lower parts); the diagonals
// are inverted.
inline void cholesky(double (*a)[2]) {
    for (int j = 0; j < kStates; ++j) {
        double inverse[2];
        for (int axis = 0; axis < 2; ++axis) {
            double d = a[j * kStates + j][axis];
            for (int k = 0; k < j; ++k) d -= a[j * kStates + k][axis] * a[j * kStates + k][axis];
            inverse[axis] = 1.0 / std::sqrt(std::max(d, 1e-300));
            a[j * kStates + j][axis] = inverse[axis];
        }
        for (int i = j + 1; i < kStates; ++i)
            for (int axis = 0; axis < 2; ++axis) {
                double s = a[i * kStates + j][axis];
                for (int k = 0; k < j; ++k) s -= a[i * kStates + k][axis] * a[j * kStates + k][axis];
                a[i * kStates + j][axis] = s * inverse[axis];
            }
    }
}

// Smooth one track's (mean, P) of both axes by the next record's prediction and smoothed state.
JEAT_GRAPH_WIDE void rts(double* means, double* covariances, const Matrix& F, const double* predicted_means,
                         const double* predicted_covariances, const double* next_means, const double* next_covariances) {
    // Solved in a scaled state: variances of position and acceleration differ by orders of magnitude.
    double scale[2][kStates], L[kMatrix][2];
    for (int axis = 0; axis < 2; ++axis) {
        const double* const predicted = predicted_covariances + axis * kMatrix;
        for (int i = 0; i < kStates; ++i) scale[axis][i] = 1.0 / std::sqrt(predicted[i * kStates + i]);
        for (int i = 0; i < kStates; ++i)
            for (int j = 0; j <= i; ++j)
                L[i * kStates + j][axis] = predicted[i * kStates + j] * (scale[axis][i] * scale[axis][j]);
    }
    cholesky(L);
    for (int axis = 0; axis < 2; ++axis) {
        double *const mean = means + axis * kStates, *const P = covariances + axis * kMatrix;
        const double* const predicted_mean = predicted_means + axis * kStates;
        const double* const predicted = predicted_covariances + axis * kMatrix;
        const double* const next_mean = next_means + axis * kStates;
        const double* const next = next_covariances + axis * kMatrix;
        double Gt[kStates][kRow] = {};
        // G' = P-^-1 F P, all of its columns at once.
        for (int i = 0; i < kStates; ++i) {
            for (int k = filters::kDriven[i][0]; k <= filters::kDriven[i][1]; ++k)
                for (int j = 0; j < kStates; ++j) Gt[i][j] += F[i * kStates + k] * P[k * kStates + j];
            for (int j = 0; j < kRow; ++j) Gt[i][j] *= scale[axis][i];
            for (int k = 0; k < i; ++k)
                for (int j = 0; j < kRow; ++j) Gt[i][j] -= L[i * kStates + k][axis] * Gt[k][j];
            for (int j = 0; j < kRow; ++j) Gt[i][j] *= L[i * kStates + i][axis];
        }
        for (int i = kStates - 1; i >= 0; --i) {
            for (int k = i + 1; k < kStates; ++k)
                for (int j = 0; j < kRow; ++j) Gt[i][j] -= L[k * kStates + i][axis] * Gt[k][j];
            for (int j = 0; j < kRow; ++j) Gt[i][j] *= L[i * kStates + i][axis];
        }
        for (int i = 0; i < kStates; ++i)
            for (int j = 0; j < kRow; ++j) Gt[i][j] *= scale[axis][i];
        double D[kStates][kRow] = {};
        for (int k = 0; k < kStates; ++k) {
            const double moved = next_mean[k] - predicted_mean[k];
            for (int i = 0; i < kStates; ++i) mean[i] += Gt[k][i] * moved;
            for (int j = 0; j < kStates; ++j) D[k][j] = next[k * kStates + j] - predicted[k * kStates + j];
        }
        for (int i = 0; i < kStates; ++i) {
            double GD[kRow] = {}, more[kRow] = {};
            for (int k = 0; k < kStates; ++k)
                for (int j = 0; j < kRow; ++j) GD[j] += Gt[k][i] * D[k][j];
            for (int k = 0; k < kStates; ++k)
                for (int j = 0; j < kRow; ++j) more[j] += GD[k] * Gt[k][j];
            for (int j = i; j < kStates; ++j)
                P[i * kStates + j] = P[j * kStates + i] = P[i * kStates + j] + more[j];
        }
    }
}

}  // namespace jeat::smoothers
