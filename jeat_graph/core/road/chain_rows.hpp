// Rows between neighbouring states of a vehicle, all boxes in between being eliminated; see
// jeat_graph/road/chain_rows.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "arrays.hpp"
#include "math.hpp"
#include "road/box_errors.hpp"

namespace jeat::road {

// Components of the motion: place, speed and acceleration across the road, then along it; and of the size.
inline constexpr std::size_t AXIS = 3, MOTION = 2 * AXIS, SIZES = 3;

// Memory for one matrix.
class Matrix {
public:
    Matrix(std::size_t rows, std::size_t columns) : columns_(columns), data_(rows * columns) {}
    double* operator[](std::size_t row) { return data_.data() + row * columns_; }
    std::size_t columns() const { return columns_; }
    void clear() { std::fill(data_.begin(), data_.end(), 0.0); }

private:
    std::size_t columns_;
    std::vector<double> data_;
};

namespace detail {

// Predicts by dt: A (n, Q) is any number of states side by side, P (n, n) their covariance.
inline void step(double dt, std::span<const double> jerk, std::span<const double> memory_s, Matrix& A, Matrix& P) {
    const double dt2 = dt * dt, dt3 = dt2 * dt, half = 0.5 * dt2;
    const std::size_t n = P.columns();
    const auto move_rows = [&](Matrix& M, std::size_t p) {
        double *place = M[p], *speed = M[p + 1], *acceleration = M[p + 2];
        for (std::size_t q = 0; q < M.columns(); ++q) {
            place[q] += dt * speed[q] + half * acceleration[q];
            speed[q] += dt * acceleration[q];
        }
    };
    for (std::size_t a = 0; a < 2; ++a) move_rows(A, AXIS * a), move_rows(P, AXIS * a);
    for (std::size_t a = 0; a < 2; ++a) {
        const std::size_t p = AXIS * a;
        for (std::size_t r = 0; r < n; ++r) {
            double* const at = P[r] + p;
            at[0] += dt * at[1] + half * at[2];
            at[1] += dt * at[2];
        }
        const double q = jerk[a] * jerk[a];
        const std::array<std::array<double, AXIS>, AXIS> noise{
            {{q * dt3 * dt2 / 20.0, q * dt2 * dt2 / 8.0, q * dt3 / 6.0},
             {q * dt2 * dt2 / 8.0, q * dt3 / 3.0, q * half},
             {q * dt3 / 6.0, q * half, q * dt}}};
        for (std::size_t r = 0; r < AXIS; ++r)
            for (std::size_t c = 0; c < AXIS; ++c) P[p + r][p + c] += noise[r][c];
    }
    for (std::size_t g = 0; g < memory_s.size(); ++g) {
        const double forget = exp_of(-dt / memory_s[g]);
        for (std::size_t e = MOTION + CHANNELS * g; e < MOTION + CHANNELS * (g + 1); ++e) {
            for (std::size_t q = 0; q < A.columns(); ++q) A[e][q] *= forget;
            for (std::size_t q = 0; q < n; ++q) P[e][q] *= forget;
            for (std::size_t r = 0; r < n; ++r) P[r][e] *= forget;
            P[e][e] += 1.0 - forget * forget;
        }
    }
}

// Replaces the lower triangle of P by that of its root L, P = L Lᵀ.
inline void cholesky(Matrix& P) {
    const std::size_t n = P.columns();
    for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t i = j; i < n; ++i) {
            double sum = P[i][j];
            for (std::size_t k = 0; k < j; ++k) sum -= P[i][k] * P[j][k];
            if (i == j) {
                if (!(sum > 0.0)) throw std::runtime_error("the covariance of a state is not positive definite");
                P[j][j] = std::sqrt(sum);
            } else {
                P[i][j] = sum / P[j][j];
            }
        }
    }
}

// Replaces A by L⁻¹ A.
inline void solve_lower(Matrix& L, Matrix& A) {
    for (std::size_t i = 0; i < L.columns(); ++i) {
        for (std::size_t k = 0; k < i; ++k)
            for (std::size_t q = 0; q < A.columns(); ++q) A[i][q] -= L[i][k] * A[k][q];
        for (std::size_t q = 0; q < A.columns(); ++q) A[i][q] /= L[i][i];
    }
}

}  // namespace detail

// Where the rows of one pair of states go: rows of 2 n + 4, of which each is on the first state, the second, the size,
// and has a right-hand side.
struct Pair {
    double start, end;        // times of the states (s)
    std::size_t first, last;  // boxes from the first, not with the last
    View2<double> out;
};

namespace detail {

// The state at a time between the two of a pair.
struct Between {
    explicit Between(std::size_t errors)
        : n(MOTION + errors), wide(n + SIZES + 1), state(n, wide), P(n, n), seen(n), row(wide) {
        for (std::size_t j = 0; j < n; ++j) state[j][j] = 1.0;
    }

    std::size_t n, wide;
    Matrix state;                   // each component, by the first state, the size, and a constant
    Matrix P;                       // covariance
    std::vector<double> seen, row;  // room for a row
};

// What one number of a box says: slopes J on its place and size, and h on the persisting error of its channel.
struct Measurement {
    const double* J;
    std::size_t error;
    double h, variance, right;
};

// Writes the row of a number, and conditions the state on it. Returns its variance before.
inline double condition(const Measurement& z, Between& now, double* out) {
    auto& [n, wide, state, P, seen, row] = now;
    const double* const J = z.J;
    const std::size_t constant = wide - 1;
    // The row H of a box: on the two places, and on the persisting error of this channel of its sensor.
    for (std::size_t r = 0; r < n; ++r) seen[r] = P[r][0] * J[0] + P[r][AXIS] * J[1] + P[r][z.error] * z.h;
    for (std::size_t q = 0; q < wide; ++q)
        row[q] = state[0][q] * J[0] + state[AXIS][q] * J[1] + state[z.error][q] * z.h;
    for (std::size_t j = 0; j < SIZES; ++j) row[n + j] += J[2 + j];
    row[constant] = z.right - row[constant];
    const double S = seen[0] * J[0] + seen[AXIS] * J[1] + seen[z.error] * z.h + z.variance;
    const double root = 1.0 / std::sqrt(S);
    for (std::size_t q = 0; q < n; ++q) out[q] = root * row[q];
    for (std::size_t q = n; q < wide; ++q) out[n + q] = root * row[q];
    for (std::size_t j = 0; j < n; ++j) {
        const double gain = seen[j] / S;
        for (std::size_t q = 0; q < constant; ++q) state[j][q] -= gain * row[q];
        state[j][constant] += gain * row[constant];
        for (std::size_t q = 0; q < n; ++q) P[j][q] -= gain * seen[q];
    }
    return S;
}

// Writes the rows that tie the second state to what the first one and the boxes say of it: P becomes its root.
inline void tie(Between& now, View2<double> to) {
    auto& [n, wide, state, P, seen, row] = now;
    const std::size_t constant = wide - 1;
    cholesky(P);
    Matrix W(n, n);
    for (std::size_t j = 0; j < n; ++j) W[j][j] = 1.0;
    solve_lower(P, W);
    solve_lower(P, state);
    for (std::size_t r = 0; r < n; ++r) {
        double* const out = to[r];
        for (std::size_t q = 0; q < n; ++q) out[q] = -state[r][q], out[n + q] = W[r][q];
        for (std::size_t q = n; q < constant; ++q) out[n + q] = -state[r][q];
        out[n + constant] = state[r][constant];
    }
}

}  // namespace detail

// Fills the rows of one pair. Returns how many they are, and ln of the determinant of their covariance.
inline std::pair<std::size_t, double> pair_rows(const Pair& pair, const Boxes& boxes, const double* slopes,
                                                View2<const double> right, std::span<const double> jerk) {
    detail::Between now(CHANNELS * boxes.memory_s.size());
    double t = pair.start, log_determinant = 0.0;
    std::size_t place = now.n;
    for (std::size_t k = pair.first; k < pair.last; ++k) {
        if (boxes.t[k] > t) {
            detail::step(boxes.t[k] - t, jerk, boxes.memory_s, now.state, now.P);
            t = boxes.t[k];
        }
        for (std::size_t channel = 0; channel < CHANNELS; ++channel) {
            if (!measured(boxes.mode[k], channel)) continue;
            const detail::Measurement z{slopes + (k * CHANNELS + channel) * UNKNOWNS,
                                        MOTION + CHANNELS * static_cast<std::size_t>(boxes.group[k]) + channel,
                                        boxes.coloured[k][channel], boxes.new_variance(k, channel), right[k][channel]};
            log_determinant += log_of(detail::condition(z, now, pair.out[place++]));
        }
    }
    detail::step(pair.end - t, jerk, boxes.memory_s, now.state, now.P);
    detail::tie(now, pair.out);
    for (std::size_t r = 0; r < now.n; ++r) log_determinant += 2.0 * log_of(now.P[r][r]);
    return {place, log_determinant};
}

}  // namespace jeat::road
