// A detection measures the four sides of its box; the formulas are in filters/box_sides.py.
#pragma once

#include <array>
#include <cmath>

#include "filters/boxes.hpp"
#include "filters/model_constants.hpp"
#include "filters/singer.hpp"
#include "math.hpp"

namespace jeat::filters {

inline constexpr double kLog2Pi = 1.8378770664093454;
inline constexpr double kLeastProbability = 0.02, kLeastWeight = 1e-3, kOutwards = -20.0, kMostDistance = 200.0;

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
    std::array<Pair2, 2> S, wide;          // covariance of the innovation, and with an outlier's variance
    double log_det, log_det_wide;          // over both axes
};

// rho^2 of the sensor, its variance in sizes^2.
inline double side_variance(double size, double both, double rho2, const ModelConstants& c) {
    return rho2 * square(0.5 * both + 0.5 * size) + square(c.pixel_std);
}

inline SidesExpected expected_sides(const double* mean, const double* covariance, double rho2,
                                    const ModelConstants& c) {
    SidesExpected out;
    out.size = {exp_of(mean[kLogSize]), exp_of(mean[kStates + kLogSize])};
    out.box = corners(mean, out.size[0], out.size[1]);
    const double area = out.size[0] * out.size[1], both = std::sqrt(area);
    const double extra = square(c.outlier_std) * area;
    out.log_det = out.log_det_wide = 0.0;
    for (int axis = 0; axis < 2; ++axis) {
        const double* const P = covariance + axis * kMatrix;
        const double w = out.size[axis], a = P[kPosition * kStates + kPosition];
        const double b = w * P[kPosition * kStates + kLogSize], d = w * w / 4.0 * P[kLogSize * kStates + kLogSize];
        const double R = side_variance(w, both, rho2, c);
        out.variance[axis] = R;
        out.S[axis] = {a - b + d + R, a - d, a + b + d + R};
        out.wide[axis] = out.S[axis].plus(extra, extra);
        out.log_det += log_of(out.S[axis].determinant());
        out.log_det_wide += log_of(out.wide[axis].determinant());
    }
    return out;
}

// Innovations of the sides by axis: left, right, top, bottom.
inline std::array<double, 4> side_innovations(const Sides& box, const Sides& expected) {
    return {box.left - expected.left, box.right - expected.right, box.top - expected.top,
            box.bottom - expected.bottom};
}

inline double squared_distance(const std::array<double, 4>& y, const std::array<Pair2, 2>& S) {
    return S[0].squared_distance(y[0], y[1]) + S[1].squared_distance(y[2], y[3]);
}

inline double student_weight(double d2, const ModelConstants& c) {
    const double nu = c.degrees_of_freedom;
    return clamp((nu + 4.0) / (nu + std::min(d2, kMostDistance)), kLeastWeight, 1.0);
}

// Probabilities that the left or the right side of one axis is cut.
inline std::array<double, 2> cut_probabilities(double left, double right, const Pair2& S, double size,
                                               const ModelConstants& c) {
    const double both = -0.5 * S.squared_distance(left, right) - 0.5 * log_of(S.determinant()) - kLog2Pi;
    const auto alone = [](double y, double v) { return -0.5 * y * y / v - 0.5 * (log_of(v) + kLog2Pi); };
    const double inside = log_of(c.cut_share) - log_of(size);
    const double cut_left = alone(right, S.rr) + inside + (left > 0.0 ? 0.0 : kOutwards);
    const double cut_right = alone(left, S.ll) + inside + (right < 0.0 ? 0.0 : kOutwards);
    const double total = log_add(log_add(both, cut_right), cut_left);
    return {exp_of(cut_left - total), exp_of(cut_right - total)};
}

// Update one axis by its two sides, whose variances are R, in Joseph's form.
inline void update_axis(double* mean, double* P, double left, double right, double size, double Rl, double Rr) {
    const double half = size / 2.0;
    double PHl[kStates], PHr[kStates];
    for (int i = 0; i < kStates; ++i) {
        const double p = P[i * kStates + kPosition], l = half * P[i * kStates + kLogSize];
        PHl[i] = p - l;
        PHr[i] = p + l;
    }
    const Pair2 S{PHl[kPosition] - half * PHl[kLogSize] + Rl, PHr[kPosition] - half * PHr[kLogSize],
                  PHr[kPosition] + half * PHr[kLogSize] + Rr};
    const double det = S.determinant();
    Matrix A{};
    double Kl[kStates], Kr[kStates];
    for (int i = 0; i < kStates; ++i) {
        Kl[i] = (PHl[i] * S.rr - PHr[i] * S.lr) / det;
        Kr[i] = (PHr[i] * S.ll - PHl[i] * S.lr) / det;
        mean[i] += Kl[i] * left + Kr[i] * right;
        A[i * kStates + i] = 1.0;
        A[i * kStates + kPosition] -= Kl[i] + Kr[i];
        A[i * kStates + kLogSize] += half * (Kl[i] - Kr[i]);
    }
    Matrix AP;
    for (int i = 0; i < kStates; ++i)
        for (int j = 0; j < kStates; ++j) {
            double sum = 0.0;
            for (int k = 0; k < kStates; ++k) sum += A[i * kStates + k] * P[k * kStates + j];
            AP[i * kStates + j] = sum;
        }
    for (int i = 0; i < kStates; ++i)
        for (int j = i; j < kStates; ++j) {
            double sum = Kl[i] * Rl * Kl[j] + Kr[i] * Rr * Kr[j];
            for (int k = 0; k < kStates; ++k) sum += AP[i * kStates + k] * A[j * kStates + k];
            P[i * kStates + j] = P[j * kStates + i] = sum;
        }
}

// Where it is likelier that a side has been cut so far and now shows further out than that both sides measure as
// before, nothing is known of that side: the state takes it as it is measured, and P grows by d^2 along it.
inline void uncover(double* mean, double* P, double& left, double& right, const Pair2& S, double size,
                    const ModelConstants& c) {
    const double both = -0.5 * S.squared_distance(left, right) - 0.5 * log_of(S.determinant()) - kLog2Pi;
    const double out[] = {-left, right}, other[] = {right, left}, variance[] = {S.rr, S.ll};
    for (int side = 0; side < 2; ++side) {
        if (out[side] <= 0.0 || out[side] >= c.most_uncovered * size) continue;
        const double alone = -0.5 * square(other[side]) / variance[side] - 0.5 * (log_of(variance[side]) + kLog2Pi) -
                             log_of(size) + log_of(c.uncovered_share);
        if (alone <= both) continue;
        const double sign = side == 0 ? -1.0 : 1.0, whole = exp_of(mean[kLogSize]) + out[side];
        mean[kPosition] += sign * out[side] / 2.0;
        mean[kLogSize] = log_of(whole);
        (side == 0 ? left : right) = 0.0;
        const double along = sign / whole, V = square(out[side]);
        P[kPosition * kStates + kPosition] += V / 4.0;
        P[kPosition * kStates + kLogSize] += V * along / 2.0;
        P[kLogSize * kStates + kPosition] += V * along / 2.0;
        P[kLogSize * kStates + kLogSize] += V * square(along);
    }
}

// Update a track by a box: heavy tails, and sides that are cut, have less weight.
inline void update(double* mean, double* covariance, const std::array<double, 4>& y, const SidesExpected& expected,
                   const ModelConstants& c) {
    const double heavy = 1.0 / student_weight(squared_distance(y, expected.S), c);
    for (int axis = 0; axis < 2; ++axis) {
        double left = y[2 * axis], right = y[2 * axis + 1];
        double *const m = mean + axis * kStates, *const P = covariance + axis * kMatrix;
        const auto cut = cut_probabilities(left, right, expected.S[axis], expected.size[axis], c);
        const double R = expected.variance[axis] * (cut[0] + cut[1] > 0.5 ? 1.0 : heavy);
        uncover(m, P, left, right, expected.S[axis], expected.size[axis], c);
        update_axis(m, P, left, right, exp_of(m[kLogSize]), R / std::max(1.0 - cut[0], kLeastProbability),
                    R / std::max(1.0 - cut[1], kLeastProbability));
    }
}

// The state of a track that begins at a box.
inline void initial_state(const Sides& box, double rho2, const ModelConstants& c, double* mean,
                          double* covariance) {
    std::fill(mean, mean + kMean, 0.0);
    std::fill(covariance, covariance + kCovariance, 0.0);
    const double size[] = {box.width(), box.height()}, both = std::sqrt(size[0] * size[1]);
    const double centre[] = {(box.left + box.right) / 2.0, (box.top + box.bottom) / 2.0};
    for (int axis = 0; axis < 2; ++axis) {
        const double R = side_variance(size[axis], both, rho2, c);
        mean[axis * kStates + kPosition] = centre[axis];
        mean[axis * kStates + kLogSize] = log_of(size[axis]);
        const double variance[] = {R / 2.0, square(c.velocity_std * both), square(c.acceleration_std * both),
                                   2.0 * R / square(size[axis]), square(c.growth_std)};
        for (int i = 0; i < kStates; ++i) covariance[axis * kMatrix + i * kStates + i] = variance[i];
    }
}

}  // namespace jeat::filters
