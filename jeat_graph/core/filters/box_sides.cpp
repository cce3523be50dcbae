#include "filters/box_sides.hpp"

#include <algorithm>
#include <cmath>

#include "wide.hpp"

namespace jeat::filters {

namespace {

double student_weight(double d2, const ModelConstants& c) {
    const double nu = c.degrees_of_freedom;
    return clamp((nu + 4.0) / (nu + std::min(d2, kMostDistance)), kLeastWeight, 1.0);
}

// Probabilities that the left or the right side of one axis is cut.
std::array<double, 2> cut_probabilities(double left, double right, const SidesExpected& expected, int axis,
                                               const ShareLogs& logs) {
    const Pair2& S = expected.S[axis];
    const double both = -0.5 * S.squared_distance(left, right) - 0.5 * expected.log_det[axis] - kLog2Pi;
    const auto alone = [](double y, double v, double log_v) { return -0.5 * y * y / v - 0.5 * (log_v + kLog2Pi); };
    const double inside = logs.cut - expected.log_size[axis];
    const double cut_left = alone(right, S.rr, expected.log_right[axis]) + inside + (left > 0.0 ? 0.0 : kOutwards);
    const double cut_right = alone(left, S.ll, expected.log_left[axis]) + inside + (right < 0.0 ? 0.0 : kOutwards);
    const double total = log_add(log_add(both, cut_right), cut_left);
    return {exp_of(cut_left - total), exp_of(cut_right - total)};
}

// Update one axis by its two sides, whose variances are R, in Joseph's form.
JEAT_GRAPH_PART void update_axis(double* mean, double* P, double left, double right, double size, double Rl, double Rr) {
    const double half = size / 2.0;
    double PHl[kRow] = {}, PHr[kRow] = {};
    for (int i = 0; i < kStates; ++i) {
        const double p = P[i * kStates + kPosition] + P[i * kStates + kPositionError];
        const double l = half * (P[i * kStates + kLogSize] + P[i * kStates + kSizeError]);
        PHl[i] = p - l;
        PHr[i] = p + l;
    }
    const auto centre = [](const double* PH) { return PH[kPosition] + PH[kPositionError]; };
    const auto extent = [half](const double* PH) { return half * (PH[kLogSize] + PH[kSizeError]); };
    const Pair2 S{centre(PHl) - extent(PHl) + Rl, centre(PHr) - extent(PHr), centre(PHr) + extent(PHr) + Rr};
    const double det = S.determinant();
    double Kl[kRow] = {}, Kr[kRow] = {};
    for (int i = 0; i < kStates; ++i) {
        Kl[i] = (PHl[i] * S.rr - PHr[i] * S.lr) / det;
        Kr[i] = (PHr[i] * S.ll - PHl[i] * S.lr) / det;
        mean[i] += Kl[i] * left + Kr[i] * right;
    }
    // With A = I - K H: first A P = P - K (P H')', then (A P) A' = A P - (A P H') K'.
    Matrix updated;
    for (int i = 0; i < kStates; ++i) {
        double row[kRow];
        std::copy(P + i * kStates, P + (i + 1) * kStates, row);
        row[kStates] = 0.0;
        for (int j = 0; j < kRow; ++j) row[j] -= Kl[i] * PHl[j] + Kr[i] * PHr[j];
        const double p = row[kPosition] + row[kPositionError], l = half * (row[kLogSize] + row[kSizeError]);
        const double by_left = Kl[i] * Rl - (p - l), by_right = Kr[i] * Rr - (p + l);
        for (int j = 0; j < kRow; ++j) row[j] += by_left * Kl[j] + by_right * Kr[j];
        for (int j = i; j < kStates; ++j) updated[i * kStates + j] = updated[j * kStates + i] = row[j];
    }
    std::copy(updated.begin(), updated.end(), P);
}

// Where it is likelier that a side has been cut so far and now shows further out than that both sides measure as
// before, nothing is known of that side: the state takes it as it is measured, and P grows by d^2 along it.
bool uncover(double* mean, double* P, double& left, double& right, const SidesExpected& expected, int axis,
                    const ShareLogs& logs, const ModelConstants& c) {
    bool shows = false;
    const Pair2& S = expected.S[axis];
    const double size = expected.size[axis];
    const double both = -0.5 * S.squared_distance(left, right) - 0.5 * expected.log_det[axis] - kLog2Pi;
    const double out[] = {-left, right}, other[] = {right, left}, variance[] = {S.rr, S.ll};
    const double log_variance[] = {expected.log_right[axis], expected.log_left[axis]};
    for (int side = 0; side < 2; ++side) {
        if (out[side] <= 0.0 || out[side] >= c.most_uncovered * size) continue;
        const double alone = -0.5 * square(other[side]) / variance[side] - 0.5 * (log_variance[side] + kLog2Pi) -
                             expected.log_size[axis] + logs.uncovered;
        if (alone <= both) continue;
        const double sign = side == 0 ? -1.0 : 1.0, whole = exp_of(mean[kLogSize] + mean[kSizeError]) + out[side];
        mean[kPosition] += sign * out[side] / 2.0;
        mean[kLogSize] = log_of(whole) - mean[kSizeError];
        (side == 0 ? left : right) = 0.0;
        vary_side(P, out[side], sign / whole);
        shows = true;
    }
    return shows;
}

}  // namespace

bool uncover_sides(double* mean, double* covariance, std::array<double, 4>& y, const SidesExpected& expected,
                          const Edges& unmeasured, const ShareLogs& logs, const ModelConstants& c) {
    bool shows = false;
    for (int axis = 0; axis < 2; ++axis)
        if (!unmeasured.at[2 * axis] && !unmeasured.at[2 * axis + 1])
            shows |= uncover(mean + axis * kStates, covariance + axis * kMatrix, y[2 * axis], y[2 * axis + 1],
                             expected, axis, logs, c);
    return shows;
}

JEAT_GRAPH_WIDE void update(double* mean, double* covariance, const std::array<double, 4>& y,
                            const std::array<double, 4>& left_over, const SidesExpected& expected, const Edges& unmeasured,
                            const ShareLogs& logs, const ModelConstants& c) {
    const double heavy = 1.0 / student_weight(squared_distance(y, expected.S), c);
    for (int axis = 0; axis < 2; ++axis) {
        const double left = y[2 * axis], right = y[2 * axis + 1];
        double *const m = mean + axis * kStates, *const P = covariance + axis * kMatrix;
        const auto cut = cut_probabilities(left, right, expected, axis, logs);
        const double tail = cut[0] + cut[1] > 0.5 ? 1.0 : heavy;
        const double Rl = expected.variance[2 * axis] * tail, Rr = expected.variance[2 * axis + 1] * tail;
        const double none = square(kUnmeasured * expected.size[axis]);
        update_axis(m, P, left_over[2 * axis], left_over[2 * axis + 1], exp_of(m[kLogSize] + m[kSizeError]),
                    unmeasured.at[2 * axis] ? none : Rl / std::max(1.0 - cut[0], kLeastProbability),
                    unmeasured.at[2 * axis + 1] ? none : Rr / std::max(1.0 - cut[1], kLeastProbability));
    }
}

}  // namespace jeat::filters
