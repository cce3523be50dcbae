// A detection measures the four sides of its box; the formulas are in filters/box_sides.py.
#pragma once

#include <array>
#include <cmath>

#include "constants.hpp"
#include "filters/boxes.hpp"
#include "filters/model_constants.hpp"
#include "filters/singer.hpp"
#include "math.hpp"
#include "wide.hpp"

namespace jeat::filters {

// A symmetric 2 x 2 matrix.
struct Pair2 {
    double ll, lr, rr;

    double determinant() const { return ll * rr - lr * lr; }
    double squared_distance(double left, double right) const {
        return (left * left * rr + right * right * ll - 2.0 * left * right * lr) / determinant();
    }
    Pair2 plus(double left, double right) const { return {ll + left, lr, rr + right}; }
};

// Of one track before it is compared with boxes.
struct SidesExpected {
    Sides box;
    std::array<double, 2> size, variance;  // of one measured side, by axis
    std::array<Pair2, 2> S;                // covariance of the innovation
    // Natural logarithms of its determinant, of the variance of the left (upper) side and of the right (lower) one, and of
    // the size.
    std::array<double, 2> log_det, log_left, log_right, log_size;

    void take_logs(int axis) {
        log_det[axis] = log_of(S[axis].determinant());
        log_left[axis] = log_of(S[axis].ll);
        log_right[axis] = log_of(S[axis].rr);
    }
};

// Natural logarithms of constants.
struct ShareLogs {
    double cut, uncovered;

    explicit ShareLogs(const ModelConstants& c) : cut(log_of(c.cut_share)), uncovered(log_of(c.uncovered_share)) {}
};

// rho^2 of the sensor, its variance in sizes^2.
inline double side_variance(double size, double both, double rho2, const ModelConstants& c) {
    return rho2 * square(0.5 * both + 0.5 * size) + square(c.pixel_std);
}

inline SidesExpected expected_sides(const double* mean, const double* covariance, double rho2,
                                    const ModelConstants& c) {
    SidesExpected out;
    out.box = expected_corners(mean);
    out.size = {out.box.width(), out.box.height()};
    const double both = std::sqrt(out.size[0] * out.size[1]);
    for (int axis = 0; axis < 2; ++axis) {
        const double* const P = covariance + axis * kMatrix;
        const auto sum = [P](int i, int j, int k, int l) { return P[i * kStates + k] + P[i * kStates + l] + P[j * kStates + k] + P[j * kStates + l]; };
        const double w = out.size[axis], a = sum(kPosition, kPositionError, kPosition, kPositionError);
        const double b = w * sum(kPosition, kPositionError, kLogSize, kSizeError);
        const double d = w * w / 4.0 * sum(kLogSize, kSizeError, kLogSize, kSizeError);
        const double R = side_variance(w, both, rho2, c);
        out.variance[axis] = R;
        out.S[axis] = {a - b + d + R, a - d, a + b + d + R};
        out.take_logs(axis);
        out.log_size[axis] = log_of(w);
    }
    return out;
}

// Innovations of the sides by axis: left, right, top, bottom.
inline std::array<double, 4> side_innovations(const Sides& box, const Sides& expected) {
    return {box.left - expected.left, box.right - expected.right, box.top - expected.top,
            box.bottom - expected.bottom};
}

// Which sides of a box lie at the edge of the picture: left, right, top, bottom.
struct Edges {
    std::array<bool, 4> at{};

    bool any() const { return at[0] || at[1] || at[2] || at[3]; }
};

inline Edges edges_of(const Sides& box, double width, double height, const ModelConstants& c) {
    const auto near = [&](double a, double b) { return std::abs(a - b) <= c.edge_px; };
    return {{near(box.left, 0.0), near(box.right, width), near(box.top, 0.0), near(box.bottom, height)}};
}

// Sides at the edge that lie inwards of what is expected: the edge has cut them, and they measure nothing.
inline Edges unmeasured_sides(const std::array<double, 4>& y, const Edges& edges) {
    return {{edges.at[0] && y[0] > 0.0, edges.at[1] && y[1] < 0.0, edges.at[2] && y[2] > 0.0, edges.at[3] && y[3] < 0.0}};
}

// What is expected of a box whose sides are cut by the edge: they lie anywhere within about the object.
inline SidesExpected with_cut(SidesExpected expected, const Edges& cut, const ModelConstants& c) {
    for (int axis = 0; axis < 2; ++axis) {
        const double V = square(c.edge_std * expected.size[axis]);
        const double left = cut.at[2 * axis] ? V : 0.0, right = cut.at[2 * axis + 1] ? V : 0.0;
        expected.S[axis] = expected.S[axis].plus(left, right);
        expected.take_logs(axis);
    }
    return expected;
}

inline double squared_distance(const std::array<double, 4>& y, const std::array<Pair2, 2>& S) {
    return S[0].squared_distance(y[0], y[1]) + S[1].squared_distance(y[2], y[3]);
}

inline double student_weight(double d2, const ModelConstants& c) {
    const double nu = c.degrees_of_freedom;
    return clamp((nu + 4.0) / (nu + std::min(d2, kMostDistance)), kLeastWeight, 1.0);
}

// Probabilities that the left or the right side of one axis is cut.
inline std::array<double, 2> cut_probabilities(double left, double right, const SidesExpected& expected, int axis,
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
inline void update_axis(double* mean, double* P, double left, double right, double size, double Rl, double Rr) {
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

// P grows by d^2 along one side: by [1/2, along] of [p, l].
inline void vary_side(double* P, double d, double along) {
    const double V = square(d);
    P[kPosition * kStates + kPosition] += V / 4.0;
    P[kPosition * kStates + kLogSize] += V * along / 2.0;
    P[kLogSize * kStates + kPosition] += V * along / 2.0;
    P[kLogSize * kStates + kLogSize] += V * square(along);
}

// Where it is likelier that a side has been cut so far and now shows further out than that both sides measure as
// before, nothing is known of that side: the state takes it as it is measured, and P grows by d^2 along it.
inline bool uncover(double* mean, double* P, double& left, double& right, const SidesExpected& expected, int axis,
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

// The same on both axes; what is left of the innovations y. Says whether a side shows again.
inline bool uncover_sides(double* mean, double* covariance, std::array<double, 4>& y, const SidesExpected& expected,
                          const Edges& unmeasured, const ShareLogs& logs, const ModelConstants& c) {
    bool shows = false;
    for (int axis = 0; axis < 2; ++axis)
        if (!unmeasured.at[2 * axis] && !unmeasured.at[2 * axis + 1])
            shows |= uncover(mean + axis * kStates, covariance + axis * kMatrix, y[2 * axis], y[2 * axis + 1],
                             expected, axis, logs, c);
    return shows;
}

// Update a track by a box: heavy tails, and sides that are cut, have less weight. Left over are the innovations y of
// the state as it is after `uncover_sides`.
JEAT_GRAPH_WIDE void update(double* mean, double* covariance, const std::array<double, 4>& y,
                            const std::array<double, 4>& left_over, const SidesExpected& expected, const Edges& unmeasured,
                            const ShareLogs& logs, const ModelConstants& c) {
    const double heavy = 1.0 / student_weight(squared_distance(y, expected.S), c);
    for (int axis = 0; axis < 2; ++axis) {
        const double left = y[2 * axis], right = y[2 * axis + 1];
        double *const m = mean + axis * kStates, *const P = covariance + axis * kMatrix;
        const auto cut = cut_probabilities(left, right, expected, axis, logs);
        const double R = expected.variance[axis] * (cut[0] + cut[1] > 0.5 ? 1.0 : heavy);
        const double none = square(kUnmeasured * expected.size[axis]);
        update_axis(m, P, left_over[2 * axis], left_over[2 * axis + 1], exp_of(m[kLogSize] + m[kSizeError]),
                    unmeasured.at[2 * axis] ? none : R / std::max(1.0 - cut[0], kLeastProbability),
                    unmeasured.at[2 * axis + 1] ? none : R / std::max(1.0 - cut[1], kLeastProbability));
    }
}

// The state of a track that begins at a box.
inline void initial_state(const Sides& box, const Edges& edges, double rho2, double scene_rho2, const ModelConstants& c, double* mean,
                          double* covariance) {
    std::fill(mean, mean + kMean, 0.0);
    std::fill(covariance, covariance + kCovariance, 0.0);
    const double size[] = {box.width(), box.height()}, both = std::sqrt(size[0] * size[1]);
    const double centre[] = {(box.left + box.right) / 2.0, (box.top + box.bottom) / 2.0};
    for (int axis = 0; axis < 2; ++axis) {
        const double R = side_variance(size[axis], both, rho2, c);
        mean[axis * kStates + kPosition] = centre[axis];
        mean[axis * kStates + kLogSize] = log_of(size[axis]);
        const LastingError error(size[axis], both, scene_rho2, c);
        const double variance[] = {R / 2.0, square(c.velocity_std * both), square(c.acceleration_std * both),
                                   2.0 * R / square(size[axis]), square(c.growth_std), error.position, error.size};
        for (int i = 0; i < kStates; ++i) covariance[axis * kMatrix + i * kStates + i] = variance[i];
        // How far it reaches beyond the edge nobody knows.
        for (int side = 0; side < 2; ++side)
            if (edges.at[2 * axis + side])
                vary_side(covariance + axis * kMatrix, c.edge_birth * size[axis], (side ? 1.0 : -1.0) / size[axis]);
    }
}

}  // namespace jeat::filters
