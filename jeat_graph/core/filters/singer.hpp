// Singer's motion model of one axis, [p, v, a, l, r, b, c], seven states; the formulas are in filters/singer.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "constants.hpp"
#include "filters/model_constants.hpp"
#include "math.hpp"

namespace jeat::filters {

// The state of a track: two axes; its covariance: one matrix for each, row by row.
inline constexpr int kMean = 2 * kStates, kMatrix = kStates * kStates, kCovariance = 2 * kMatrix;

using Matrix = std::array<double, kMatrix>;

// Natural logarithms of the spectral densities.
struct ProcessNoise {
    double jerk, growth, position, size;
};

// The model over one step, and the covariance by each noise of unit density.
struct Discretised {
    Matrix F, jerk, growth, position, size;
};

namespace detail {

template <int N>
std::array<double, N * N> product(const std::array<double, N * N>& a, const std::array<double, N * N>& b) {
    std::array<double, N * N> out{};
    for (int i = 0; i < N; ++i)
        for (int k = 0; k < N; ++k)
            for (int j = 0; j < N; ++j) out[i * N + j] += a[i * N + k] * b[k * N + j];
    return out;
}

template <int N> std::array<double, N * N> transposed(const std::array<double, N * N>& a) {
    std::array<double, N * N> out;
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) out[j * N + i] = a[i * N + j];
    return out;
}

// Σ_k (A h)^k / k! for short steps, N x N.
inline constexpr int kTerms = 9;
template <int N> std::array<double, N * N> short_exponential(const std::array<double, N * N>& A, double h) {
    std::array<double, N * N> term{}, sum{};
    for (int i = 0; i < N; ++i) term[i * N + i] = sum[i * N + i] = 1.0;
    for (int k = 1; k <= kTerms; ++k) {
        term = product<N>(term, A);
        for (int i = 0; i < N * N; ++i) term[i] *= h / k, sum[i] += term[i];
    }
    return sum;
}

// How often a step is halved until the series converges.
inline int halvings(double dt, double fastest) {
    int n = 0;
    double h = dt * fastest;
    while (h > 0.1) {
        h /= 2.0;
        ++n;
    }
    return n;
}

}  // namespace detail

// exp(A t) of a small matrix whose entries are at most `fastest`.
template <int N> std::array<double, N * N> exponential(const std::array<double, N * N>& A, double t, double fastest) {
    const int n = detail::halvings(t, fastest);
    auto out = detail::short_exponential<N>(A, std::ldexp(t, -n));
    for (int k = 0; k < n; ++k) out = detail::product<N>(out, out);
    return out;
}

// Transition and the integrals of e^(As) L e^(A's), by series over a short step and doubling: Q(2h) = Q + F Q F'.
inline Discretised discretise(double dt, const ModelConstants& c) {
    using namespace detail;
    Matrix A{};
    A[kPosition * kStates + kVelocity] = A[kVelocity * kStates + kAcceleration] = A[kLogSize * kStates + kGrowth] = 1.0;
    A[kVelocity * kStates + kVelocity] = -1.0 / c.velocity_time_s;
    A[kAcceleration * kStates + kAcceleration] = -1.0 / c.acceleration_time_s;
    A[kGrowth * kStates + kGrowth] = -1.0 / c.growth_time_s;
    A[kPositionError * kStates + kPositionError] = A[kSizeError * kStates + kSizeError] = -1.0 / c.error_time_s;
    double fastest = 1.0;
    for (const double a : A) fastest = std::max(fastest, std::abs(a));
    const int n = halvings(dt, fastest);
    const double h = std::ldexp(dt, -n);
    Discretised out;
    out.F = short_exponential<kStates>(A, h);
    const Matrix At = transposed<kStates>(A);
    const int driven[] = {kAcceleration, kGrowth, kPosition, kLogSize};
    Matrix* const noises[] = {&out.jerk, &out.growth, &out.position, &out.size};
    for (int i = 0; i < 4; ++i) {
        // dQ/dt = A Q + Q A' + L: its derivatives at 0 are X_1 = L, X_{k+1} = A X_k + X_k A'.
        Matrix term{}, Q{};
        term[driven[i] * kStates + driven[i]] = 1.0;
        double factor = h;
        for (int k = 1; k <= kTerms + 4; ++k) {
            for (int j = 0; j < kMatrix; ++j) Q[j] += term[j] * factor;
            const Matrix left = product<kStates>(A, term), right = product<kStates>(term, At);
            for (int j = 0; j < kMatrix; ++j) term[j] = left[j] + right[j];
            factor *= h / (k + 1);
        }
        *noises[i] = Q;
    }
    for (int k = 0; k < n; ++k) {
        const Matrix Ft = transposed<kStates>(out.F);
        for (Matrix* const Q : noises) {
            const Matrix moved = product<kStates>(product<kStates>(out.F, *Q), Ft);
            for (int j = 0; j < kMatrix; ++j) (*Q)[j] += moved[j];
        }
        out.F = product<kStates>(out.F, out.F);
    }
    return out;
}

// Variance of the lasting error of the position of one axis (px^2), and of ln size; rho2: of the sides' other errors.
struct LastingError {
    double position, size;

    LastingError(double length, double both, double rho2, const ModelConstants& c) {
        const double side = c.error_share * rho2 * square(0.5 * both + 0.5 * length);
        position = side / 2.0;
        size = 2.0 * side / square(length);
    }
};

inline double object_size(const double* mean) { return exp_of(0.5 * (mean[kLogSize] + mean[kStates + kLogSize])); }

inline double mean_growth(const double* mean) { return 0.5 * (mean[kGrowth] + mean[kStates + kGrowth]); }

// By how much ln size grows in a step (g the rate of ln size), as far as perspective takes it.
inline double step_growth(double g, double dt, const ModelConstants& c) {
    return clamp(g * dt, -c.most_perspective, c.most_perspective);
}

// The transition of a track that moves at constant speed in space: a = 2 g v, dg/dt = g^2. It grows by x, and `faster` is
// e^2x.
inline Matrix in_perspective(const Matrix& F, double x, double faster) {
    Matrix out = F;
    if (std::abs(x) < kLeastPerspective) return out;
    const double further = (faster - 1.0) / (2.0 * x);
    const double growing = 1.0 / (1.0 - x), grown = -log_of(1.0 - x) / x;
    out[kPosition * kStates + kVelocity] *= further;
    out[kVelocity * kStates + kVelocity] *= faster;
    out[kLogSize * kStates + kGrowth] *= grown;
    out[kGrowth * kStates + kGrowth] *= growing;
    return out;
}
inline Matrix in_perspective(const Matrix& F, double g, double dt, const ModelConstants& c) {
    const double x = step_growth(g, dt, c);
    return std::abs(x) < kLeastPerspective ? F : in_perspective(F, x, exp_of(2.0 * x));
}

// The densities themselves, but of the jerk the root.
struct Densities {
    double root_jerk, growth, position, size, rho2;

    Densities(const ProcessNoise& q, double side_variance)
        : root_jerk(exp_of(q.jerk / 2.0)), growth(exp_of(q.growth)), position(exp_of(q.position)), size(exp_of(q.size)),
          rho2(side_variance) {}
};

// Columns of F that are not zero in each row: a state follows from itself and those that drive it.
inline constexpr int kDriven[kStates][2] = {
    {kPosition, kAcceleration}, {kVelocity, kAcceleration},       {kAcceleration, kAcceleration}, {kLogSize, kGrowth},
    {kGrowth, kGrowth},         {kPositionError, kPositionError}, {kSizeError, kSizeError}};

// Rows of matrices are this long where loops over them are to become vectors.
inline constexpr int kRow = kStates + 1;

// m <- F m, P <- F P F' + Q.
void predict(double* mean, double* covariance, const Discretised& step, double dt, const Densities& q,
             const ModelConstants& c);

// What tables tell of a track and its variances, `kMotion` for each axis: reported_motion and the diagonal of reported_covariance.
inline void report_motion(const double* mean, const double* covariance, const ModelConstants& c, double* reported,
                          double* variance) {
    const double g = 0.5 * (mean[kGrowth] + mean[kStates + kGrowth]);
    const double by_velocity = 2.0 * g - 1.0 / c.velocity_time_s;
    for (int axis = 0; axis < 2; ++axis, reported += kMotion, variance += kMotion) {
        const double* const m = mean + axis * kStates;
        const double* const P = covariance + axis * kMatrix;
        const double* const other = covariance + (1 - axis) * kMatrix;
        for (int k = 0; k < kMotion; ++k) reported[k] = m[k], variance[k] = P[k * kStates + k];
        reported[kPosition] += m[kPositionError];
        reported[kLogSize] += m[kSizeError];
        const double v = m[kVelocity];
        reported[kAcceleration] += by_velocity * v;
        // By v, a and the growth of this axis; the other axis's growth has half of g, too.
        const int by[] = {kVelocity, kAcceleration, kGrowth};
        const double slope[] = {by_velocity, 1.0, v};
        double sum = square(v) * other[kGrowth * kStates + kGrowth];
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) sum += slope[i] * slope[j] * P[by[i] * kStates + by[j]];
        variance[kAcceleration] = sum;
    }
}

}  // namespace jeat::filters
