#include "filters/box_sides.hpp"

#include <algorithm>
#include <cmath>

#include "wide_math.hpp"

namespace jeat::filters {

namespace {

double student_weight(double d2, const ModelConstants& c) {
    const double nu = c.degrees_of_freedom;
    return clamp((nu + 4.0) / (nu + std::min(d2, kMostDistance)), kLeastWeight, 1.0);
}

// Probabilities that each side is cut: left, right, top, bottom.
JEAT_GRAPH_PART void cut_probabilities(const std::array<double, 4>& y, const SidesExpected& expected,
                                       const ShareLogs& logs, Four& out) {
    // Of both axes side by side: the first two numbers of four, and the other two once more.
    Four total, cut_low, cut_high;
    const auto alone = [](double y, double v, double log_v) { return -0.5 * y * y / v - 0.5 * (log_v + kLog2Pi); };
    for (int axis = 0; axis < 2; ++axis) {
        const Pair2& S = expected.S[axis];
        const double left = y[2 * axis], right = y[2 * axis + 1], inside = logs.cut - expected.log_size[axis];
        const double both = -0.5 * S.squared_distance(left, right) - 0.5 * expected.log_det[axis] - kLog2Pi;
        const double low = alone(right, S.rr, expected.log_right[axis]) + inside + (left > 0.0 ? 0.0 : kOutwards);
        const double high = alone(left, S.ll, expected.log_left[axis]) + inside + (right < 0.0 ? 0.0 : kOutwards);
        total[axis] = total[2 + axis] = both;
        cut_low[axis] = cut_low[2 + axis] = low;
        cut_high[axis] = cut_high[2 + axis] = high;
    }
    take_log_add(total, cut_high);
    take_log_add(total, cut_low);
    out = Four{cut_low[0] - total[0], cut_high[0] - total[0], cut_low[1] - total[1], cut_high[1] - total[1]};
    take_exp(out);
}

// Width and height of the box that a detector is expected to give.
JEAT_GRAPH_PART void expected_size(const double* mean, Four& out) {
    out = Four{expected_log_size(mean, 0), expected_log_size(mean, 1), 0.0, 0.0};
    take_exp(out);
}

// Update one axis by its two sides, whose variances are R, in Joseph's form.
JEAT_GRAPH_PART void update_axis(double* mean, double* P, double left, double right, double size, double Rl,
                                 double Rr) {
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

JEAT_GRAPH_WIDE SidesExpected expected_sides(const double* mean, const double* covariance, double rho2,
                                             const ModelConstants& c) {
    SidesExpected out;
    Four size;
    expected_size(mean, size);
    out.box = expected_corners(mean, size[0], size[1]);
    out.size = {out.box.width(), out.box.height()};
    const double both = std::sqrt(out.size[0] * out.size[1]);
    for (int axis = 0; axis < 2; ++axis) {
        const double* const P = covariance + axis * kMatrix;
        const auto sum = [P](int i, int j, int k, int l) {
            return P[i * kStates + k] + P[i * kStates + l] + P[j * kStates + k] + P[j * kStates + l];
        };
        const double w = out.size[axis], a = sum(kPosition, kPositionError, kPosition, kPositionError);
        const double b = w * sum(kPosition, kPositionError, kLogSize, kSizeError);
        const double d = w * w / 4.0 * sum(kLogSize, kSizeError, kLogSize, kSizeError);
        const double R = side_variance(w, both, rho2, c);
        out.variance[2 * axis] = out.variance[2 * axis + 1] = R;
        out.S[axis] = {a - b + d + R, a - d, a + b + d + R};
        Four of{out.S[axis].determinant(), out.S[axis].ll, out.S[axis].rr, w};
        take_log(of);
        out.log_det[axis] = of[0], out.log_left[axis] = of[1], out.log_right[axis] = of[2], out.log_size[axis] = of[3];
    }
    return out;
}

bool uncover_sides(double* mean, double* covariance, std::array<double, 4>& y, const SidesExpected& expected,
                   const Edges& unmeasured, const ShareLogs& logs, const ModelConstants& c) {
    bool shows = false;
    for (int axis = 0; axis < 2; ++axis)
        if (!unmeasured.at[2 * axis] && !unmeasured.at[2 * axis + 1])
            shows |= uncover(mean + axis * kStates, covariance + axis * kMatrix, y[2 * axis], y[2 * axis + 1], expected,
                             axis, logs, c);
    return shows;
}

JEAT_GRAPH_WIDE void update(double* mean, double* covariance, const std::array<double, 4>& y,
                            const std::array<double, 4>& left_over, const SidesExpected& expected,
                            const Edges& unmeasured, const ShareLogs& logs, const ModelConstants& c) {
    const double heavy = 1.0 / student_weight(squared_distance(y, expected.S), c);
    Four cut, size;
    cut_probabilities(y, expected, logs, cut);
    expected_size(mean, size);
    for (int axis = 0; axis < 2; ++axis) {
        double *const m = mean + axis * kStates, *const P = covariance + axis * kMatrix;
        const double tail = cut[2 * axis] + cut[2 * axis + 1] > 0.5 ? 1.0 : heavy;
        const double Rl = expected.variance[2 * axis] * tail, Rr = expected.variance[2 * axis + 1] * tail;
        const double none = square(kUnmeasured * expected.size[axis]);
        update_axis(m, P, left_over[2 * axis], left_over[2 * axis + 1], size[axis],
                    unmeasured.at[2 * axis] ? none : Rl / std::max(1.0 - cut[2 * axis], kLeastProbability),
                    unmeasured.at[2 * axis + 1] ? none : Rr / std::max(1.0 - cut[2 * axis + 1], kLeastProbability));
    }
}

}  // namespace jeat::filters
