// Motion of the camera as its pictures show it; the formulas are in filters/picture_motion.py.
#pragma once

#include <algorithm>
#include <array>
#include <limits>

#include "constants.hpp"
#include "filters/singer.hpp"

namespace jeat::filters {

inline constexpr std::size_t kMotionNumbers = 11;

// A shift (px), growth and rotation (rad) about a centre (px), or their rates (1/s).
struct Similarity {
    std::array<double, 2> centre{};
    std::array<double, 4> theta{};

    std::array<double, 2> displacement(double px, double py) const {
        const double x = px - centre[0], y = py - centre[1];
        return {theta[0] + theta[2] * x - theta[3] * y, theta[1] + theta[2] * y + theta[3] * x};
    }
};

// Motion since the picture before, `span_s` ago.
struct PictureMotion {
    double span_s = 0.0;
    Similarity moved;
    std::array<double, 4> variance{};

    static PictureMotion of(const double* numbers) {
        PictureMotion out;
        out.span_s = numbers[0];
        std::copy_n(numbers + 1, 2, out.moved.centre.begin());
        std::copy_n(numbers + 3, 4, out.moved.theta.begin());
        std::copy_n(numbers + 7, 4, out.variance.begin());
        return out;
    }
};

// The camera's velocity as of the last picture, which is part of the tracks' velocities.
struct CameraVelocity {
    Similarity rate;
    double picture_s = -std::numeric_limits<double>::infinity(), until_s = -std::numeric_limits<double>::infinity();

    bool known() const { return picture_s > -std::numeric_limits<double>::infinity(); }
    CameraVelocity at(double t) const { return t <= until_s ? *this : CameraVelocity{}; }

    static CameraVelocity after(const PictureMotion& motion, double t) {
        CameraVelocity out{motion.moved, t, t + kSpansKnown * motion.span_s};
        for (double& one : out.rate.theta) one /= motion.span_s;
        return out;
    }
};

// How the camera's newest picture changes a track: by a velocity (px/s), for a time (s).
struct CameraChange {
    std::array<double, 2> rate, before;
    double elapsed;
};

// `step_s` is the time of the tracks' last step, `last_s` of the track's last detection.
inline CameraChange camera_change(const double* mean, double last_s, const PictureMotion& motion,
                                  const CameraVelocity& before, const CameraVelocity& now, double step_s) {
    const double x = mean[kPosition], y = mean[kStates + kPosition], t = now.picture_s;
    const auto to = now.rate.displacement(x, y), from = before.rate.displacement(x, y);
    const double unseen = std::max(step_s - std::max(last_s, t - motion.span_s), 0.0);
    return {{to[0] - from[0], to[1] - from[1]}, from, t - step_s + unseen};
}

// Take a track along.
inline void follow(double* mean, double* covariance, const CameraChange& change, const PictureMotion& motion,
                   const CameraVelocity& before, const CameraVelocity& now) {
    const double elapsed = change.elapsed, grown = now.rate.theta[2] - before.rate.theta[2];
    const double share = square(elapsed / motion.span_s);
    const double x2 = square(mean[kPosition] - motion.moved.centre[0]);
    const double y2 = square(mean[kStates + kPosition] - motion.moved.centre[1]);
    const double apart[] = {motion.variance[2] * x2 + motion.variance[3] * y2,
                            motion.variance[2] * y2 + motion.variance[3] * x2};
    for (int axis = 0; axis < 2; ++axis) {
        double *const m = mean + axis * kStates, *const P = covariance + axis * kMatrix;
        m[kPosition] += change.rate[axis] * elapsed;
        m[kLogSize] += grown * elapsed;
        m[kGrowth] += grown;
        P[kPosition * kStates + kPosition] += share * (motion.variance[axis] + apart[axis]);
        P[kLogSize * kStates + kLogSize] += share * motion.variance[2];
    }
    const auto onwards = now.rate.displacement(mean[kPosition], mean[kStates + kPosition]);
    for (int axis = 0; axis < 2; ++axis) mean[axis * kStates + kVelocity] += onwards[axis] - change.before[axis];
}

// Predict a track by `predict`, which is told of its own velocity only: the camera's goes straight on for `dt` (s).
template <class Predict> void with_camera(double* mean, const CameraVelocity& camera, double dt, Predict predict) {
    if (!camera.known()) return predict();
    const auto before = camera.rate.displacement(mean[kPosition], mean[kStates + kPosition]);
    for (int axis = 0; axis < 2; ++axis) mean[axis * kStates + kVelocity] -= before[axis];
    predict();
    for (int axis = 0; axis < 2; ++axis) mean[axis * kStates + kPosition] += before[axis] * dt;
    const auto after = camera.rate.displacement(mean[kPosition], mean[kStates + kPosition]);
    for (int axis = 0; axis < 2; ++axis) mean[axis * kStates + kVelocity] += after[axis];
}

// Give an object that begins the camera's velocity for its own.
inline void with_velocity(double* mean, const CameraVelocity& camera) {
    const auto moves = camera.rate.displacement(mean[kPosition], mean[kStates + kPosition]);
    for (int axis = 0; axis < 2; ++axis) {
        mean[axis * kStates + kVelocity] += moves[axis];
        mean[axis * kStates + kGrowth] += camera.rate.theta[2];
    }
}

}  // namespace jeat::filters
