#include "smoothers/state_rts.hpp"

#include <algorithm>
#include <cmath>

#include "wide.hpp"

namespace jeat::smoothers {

namespace {

// Cholesky factors of two symmetric positive definite matrices, side by side and in place (lower parts); the diagonals
// are inverted.
JEAT_GRAPH_PART void cholesky(double (*a)[2]) {
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

// Both axes' predicted covariances as their Cholesky factors in a scaled state: variances of position and acceleration
// differ by orders of magnitude.
struct ScaledFactors {
    double scale[2][kStates], L[kMatrix][2];
};

JEAT_GRAPH_PART void factorise(const double* predicted_covariances, ScaledFactors& out) {
    for (int axis = 0; axis < 2; ++axis) {
        const double* const predicted = predicted_covariances + axis * kMatrix;
        double* const scale = out.scale[axis];
        for (int i = 0; i < kStates; ++i) scale[i] = 1.0 / std::sqrt(predicted[i * kStates + i]);
        for (int i = 0; i < kStates; ++i)
            for (int j = 0; j <= i; ++j)
                out.L[i * kStates + j][axis] = predicted[i * kStates + j] * (scale[i] * scale[j]);
    }
    cholesky(out.L);
}

// G' = P-^-1 F P of one axis, all of its columns at once.
JEAT_GRAPH_PART void smoother_gain(const ScaledFactors& predicted, int axis, const Matrix& F, const double* P,
                                   double (&Gt)[kStates][kRow]) {
    const double* const scale = predicted.scale[axis];
    const auto& L = predicted.L;
    for (int i = 0; i < kStates; ++i) {
        for (int k = filters::kDriven[i][0]; k <= filters::kDriven[i][1]; ++k)
            for (int j = 0; j < kStates; ++j) Gt[i][j] += F[i * kStates + k] * P[k * kStates + j];
        for (int j = 0; j < kRow; ++j) Gt[i][j] *= scale[i];
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
        for (int j = 0; j < kRow; ++j) Gt[i][j] *= scale[i];
}

// m <- m + G (m+ - m-), P <- P + G (P+ - P-) G' of one axis, of whose upper triangle alone.
JEAT_GRAPH_PART void smooth_axis(double* mean, double* P, const double (&Gt)[kStates][kRow],
                                 const double* predicted_mean, const double* predicted, const double* next_mean,
                                 const double* next) {
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
        for (int j = i; j < kStates; ++j) P[i * kStates + j] = P[j * kStates + i] = P[i * kStates + j] + more[j];
    }
}

}  // namespace

JEAT_GRAPH_WIDE void rts(double* means, double* covariances, const Matrix& F, const double* predicted_means,
                         const double* predicted_covariances, const double* next_means,
                         const double* next_covariances) {
    ScaledFactors predicted;
    factorise(predicted_covariances, predicted);
    for (int axis = 0; axis < 2; ++axis) {
        const int m = axis * kStates, P = axis * kMatrix;
        double Gt[kStates][kRow] = {};
        smoother_gain(predicted, axis, F, covariances + P, Gt);
        smooth_axis(means + m, covariances + P, Gt, predicted_means + m, predicted_covariances + P, next_means + m,
                    next_covariances + P);
    }
}

}  // namespace jeat::smoothers
