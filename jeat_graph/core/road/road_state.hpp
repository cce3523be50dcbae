// The state of a vehicle on the road, its prediction and its update by a box; see jeat_graph/road/road_state.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "math.hpp"
#include "road/box_channels.hpp"

namespace jeat::road {

// Components: x, its speed; y, its speed and acceleration; length, width, height.
inline constexpr std::size_t X = 0, VX = 1, Y = 2, VY = 3, AY = 4, LENGTH = 5, STATES = 8;
inline constexpr std::array<std::size_t, UNKNOWNS> OF_UNKNOWN{X, Y, LENGTH, LENGTH + 1, LENGTH + 2};
inline constexpr std::array<double, 3> LEAST_SIZE{1.2, 0.4, 0.8};
// A slower vehicle is taken to face along the road (m/s); of a still slower one no heading is known at all.
inline constexpr double LEAST_SPEED = 2.0, LEAST_HEADED_SPEED = 1e-3;

struct State {
    std::array<double, STATES> mean{};
    std::array<std::array<double, STATES>, STATES> cov{};
};

// How vehicles move: spreads of accelerations (m/s²) and of speeds across the road (m/s), and how long one lasts (s).
struct Motion {
    double acceleration_std, acceleration_s, lateral_std, lateral_s;
};

// Predicts by dt (s): along the road Singer's model, across it a speed that is pulled to zero.
inline void predict(State& state, double dt, const Motion& motion) {
    if (!(dt > 0.0)) return;
    auto& [m, P] = state;
    const double fade = exp_of(-dt / motion.acceleration_s), calm = exp_of(-dt / motion.lateral_s);
    const double to_speed = motion.acceleration_s * (1.0 - fade);
    const double to_place = motion.acceleration_s * (dt - to_speed);
    const double across = motion.lateral_s * (1.0 - calm);
    // F v, for a vector whose components `step` apart lie at v.
    const auto move = [&](double* v, std::size_t step) {
        v[X * step] += across * v[VX * step];
        v[VX * step] *= calm;
        v[Y * step] += dt * v[VY * step] + to_place * v[AY * step];
        v[VY * step] += to_speed * v[AY * step];
        v[AY * step] *= fade;
    };
    move(m.data(), 1);
    for (std::size_t c = 0; c < STATES; ++c) move(&P[0][c], STATES);
    for (std::size_t r = 0; r < STATES; ++r) move(P[r].data(), 1);
    const double dt2 = dt * dt, dt3 = dt2 * dt;
    const double lateral = square(motion.lateral_std) * (1.0 - calm * calm);
    const double q = 2.0 * square(motion.acceleration_std) / motion.acceleration_s;
    P[VX][VX] += lateral;
    P[X][X] += lateral * dt2 / 3.0;
    P[AY][AY] += q * dt;
    P[VY][VY] += q * dt3 / 3.0;
    P[Y][Y] += q * dt3 * dt2 / 20.0;
    const auto both = [&P = P](std::size_t a, std::size_t b, double value) { P[a][b] += value, P[b][a] += value; };
    both(X, VX, lateral * dt / 2.0);
    both(VY, AY, q * dt2 / 2.0);
    both(Y, AY, q * dt3 / 6.0);
    both(Y, VY, q * dt2 * dt2 / 8.0);
}

// A box as it is taken in: channels, their variances, what of each axis is measured.
struct Box {
    std::array<double, CHANNELS> z, R;
    std::array<std::int64_t, 2> mode;
};

// Takes a box in, its channels one after another, linearised about the mean `at`. A channel farther off than `gate`
// (a squared distance) counts less, smoothly. Returns false, with the state as it was, where the vehicle is not in
// front of the camera.
inline bool update_about(const std::array<double, STATES>& at, Direction way, State& state, const Box& box, double gate,
                         const Camera& camera) {
    Hull hull;
    if (!hull_of(camera, at[X], at[Y], way, at.data() + LENGTH, hull)) return false;
    const Channels expected = channels_of(hull, box.mode.data());
    auto& [m, P] = state;
    for (std::size_t channel = 0; channel < CHANNELS; ++channel) {
        if (!measured(box.mode.data(), channel)) continue;
        const auto& J = expected.slope[channel];
        double innovation = box.z[channel] - expected.z[channel], S = box.R[channel];
        for (std::size_t c = 0; c < UNKNOWNS; ++c) innovation -= J[c] * (m[OF_UNKNOWN[c]] - at[OF_UNKNOWN[c]]);
        std::array<double, STATES> PH{};
        for (std::size_t r = 0; r < STATES; ++r)
            for (std::size_t c = 0; c < UNKNOWNS; ++c) PH[r] += P[r][OF_UNKNOWN[c]] * J[c];
        for (std::size_t c = 0; c < UNKNOWNS; ++c) S += J[c] * PH[OF_UNKNOWN[c]];
        const double distance = innovation * innovation / S;
        if (distance > gate) S += box.R[channel] * (distance / gate - 1.0);
        for (std::size_t r = 0; r < STATES; ++r) {
            const double gain = PH[r] / S;
            m[r] += gain * innovation;
            for (std::size_t c = r; c < STATES; ++c) P[c][r] = P[r][c] -= gain * PH[c];
        }
    }
    for (std::size_t c = 0; c < 3; ++c) m[LENGTH + c] = std::max(m[LENGTH + c], LEAST_SIZE[c]);
    return true;
}

// The same about the state itself, facing as it drives.
inline bool update(State& state, const Box& box, double gate, const Camera& camera) {
    const auto at = state.mean;
    const double speed = std::sqrt(square(at[VX]) + square(at[VY]));
    const Direction way = speed > LEAST_SPEED ? Direction{at[VX] / speed, at[VY] / speed} : Direction{0.0, 1.0};
    return update_about(at, way, state, box, gate, camera);
}

// A state as tables of the road have it: x, y (m), speed (m/s), heading from y towards x (rad), acceleration along the
// way (m/s²), length, width, height (m); with variances.
inline void road_terms(const State& state, double* mean, double* variance) {
    const auto& [m, P] = state;
    const double speed = std::sqrt(square(m[VX]) + square(m[VY]));
    const double ux = speed > 0.0 ? m[VX] / speed : 0.0, uy = speed > 0.0 ? m[VY] / speed : 1.0;
    const double xx = P[VX][VX], xy = P[VX][VY], yy = P[VY][VY];
    const std::array<double, LENGTH> means{m[X], m[Y], speed, atan2_of(m[VX], m[VY]), m[AY] * uy};
    const std::array<double, LENGTH> variances{
        P[X][X], P[Y][Y], ux * ux * xx + 2.0 * ux * uy * xy + uy * uy * yy,
        (uy * uy * xx - 2.0 * ux * uy * xy + ux * ux * yy) / square(std::max(speed, LEAST_HEADED_SPEED)),
        P[AY][AY] * uy * uy};
    std::copy(means.begin(), means.end(), mean);
    std::copy(variances.begin(), variances.end(), variance);
    for (std::size_t k = LENGTH; k < STATES; ++k) mean[k] = m[k], variance[k] = P[k][k];
}

}  // namespace jeat::road
