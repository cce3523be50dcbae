// A detection measures the four sides of its box; the formulas are in filters/box_sides.py.
#pragma once

#include <array>
#include <cmath>

#include "constants.hpp"
#include "filters/boxes.hpp"
#include "filters/model_constants.hpp"
#include "filters/singer.hpp"
#include "math.hpp"

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
    std::array<double, 2> size;      // by axis
    std::array<double, 4> variance;  // of the measured sides: left, right, top, bottom
    std::array<Pair2, 2> S;          // covariance of the innovation
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

// What the error of a side is in proportion to: of width or height and the size, in px.
inline double side_scale(double size, double both) { return 0.5 * both + 0.5 * size; }

// rho^2 of the sensor, its variance in sizes^2.
inline double side_variance(double size, double both, double rho2, const ModelConstants& c) {
    return rho2 * square(side_scale(size, both)) + square(c.pixel_std);
}

SidesExpected expected_sides(const double* mean, const double* covariance, double rho2, const ModelConstants& c);

// Innovations of the sides by axis: left, right, top, bottom.
inline std::array<double, 4> side_innovations(const Sides& box, const Sides& expected) {
    return {box.left - expected.left, box.right - expected.right, box.top - expected.top, box.bottom - expected.bottom};
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
    return {
        {edges.at[0] && y[0] > 0.0, edges.at[1] && y[1] < 0.0, edges.at[2] && y[2] > 0.0, edges.at[3] && y[3] < 0.0}};
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

// P grows by d^2 along one side: by [1/2, along] of [p, l].
inline void vary_side(double* P, double d, double along) {
    const double V = square(d);
    P[kPosition * kStates + kPosition] += V / 4.0;
    P[kPosition * kStates + kLogSize] += V * along / 2.0;
    P[kLogSize * kStates + kPosition] += V * along / 2.0;
    P[kLogSize * kStates + kLogSize] += V * square(along);
}

// Uncover the sides that show again, on both axes; what is left of the innovations y. Says whether there is one.
bool uncover_sides(double* mean, double* covariance, std::array<double, 4>& y, const SidesExpected& expected,
                   const Edges& unmeasured, const ShareLogs& logs, const ModelConstants& c);

// Update a track by a box: heavy tails, and sides that are cut, have less weight. Left over are the innovations y of
// the state as it is after `uncover_sides`.
void update(double* mean, double* covariance, const std::array<double, 4>& y, const std::array<double, 4>& left_over,
            const SidesExpected& expected, const Edges& unmeasured, const ShareLogs& logs, const ModelConstants& c);

// The state of a track that begins at a box; `more` is what the variances of its sides are more by its own spread.
inline void initial_state(const Sides& box, const Edges& edges, double rho2, double scene_rho2,
                          const std::array<double, 4>& more, const ModelConstants& c, double* mean,
                          double* covariance) {
    std::fill(mean, mean + kMean, 0.0);
    std::fill(covariance, covariance + kCovariance, 0.0);
    const double size[] = {box.width(), box.height()}, both = std::sqrt(size[0] * size[1]);
    const double centre[] = {(box.left + box.right) / 2.0, (box.top + box.bottom) / 2.0};
    for (int axis = 0; axis < 2; ++axis) {
        const double R = side_variance(size[axis], both, rho2, c);
        const double Rl = R + more[2 * axis], Rr = R + more[2 * axis + 1];
        mean[axis * kStates + kPosition] = centre[axis];
        mean[axis * kStates + kLogSize] = log_of(size[axis]);
        const LastingError error(size[axis], both, scene_rho2, c);
        const double variance[] = {(Rl + Rr) / 4.0,
                                   square(c.velocity_std * both),
                                   square(c.acceleration_std * both),
                                   (Rl + Rr) / square(size[axis]),
                                   square(c.growth_std),
                                   error.position,
                                   error.size};
        double* const P = covariance + axis * kMatrix;
        for (int i = 0; i < kStates; ++i) P[i * kStates + i] = variance[i];
        P[kPosition * kStates + kLogSize] = P[kLogSize * kStates + kPosition] = (Rr - Rl) / (2.0 * size[axis]);
        // How far it reaches beyond the edge nobody knows.
        for (int side = 0; side < 2; ++side)
            if (edges.at[2 * axis + side])
                vary_side(covariance + axis * kMatrix, c.edge_birth * size[axis], (side ? 1.0 : -1.0) / size[axis]);
    }
}

}  // namespace jeat::filters
