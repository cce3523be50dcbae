// Where the camera's motion has taken a point at rest; the formulas are in filters/camera_path.py.
#pragma once

#include <array>

#include "filters/camera_motion.hpp"
#include "filters/picture_motion.hpp"
#include "filters/singer.hpp"

namespace jeat::filters {

struct CameraPath {
    std::array<double, 2> moved{}, velocity{};

    void predict(const Matrix& F, const CameraVelocity& camera, double width, double height, double dt) {
        const auto rate = camera.rate.displacement(width / 2.0, height / 2.0);
        for (int axis = 0; axis < 2; ++axis) {
            moved[axis] += rate[axis] * dt + F[kPosition * kStates + kVelocity] * velocity[axis];
            velocity[axis] *= F[kVelocity * kStates + kVelocity];
        }
    }
    void follow(const CameraVelocity& before, const CameraVelocity& now, double width, double height, double step_s) {
        const auto from = before.rate.displacement(width / 2.0, height / 2.0),
                   to = now.rate.displacement(width / 2.0, height / 2.0);
        for (int axis = 0; axis < 2; ++axis) moved[axis] += (to[axis] - from[axis]) * (now.picture_s - step_s);
    }
    void follow(const CameraMotion& motion, double lasting) {
        for (int axis = 0; axis < 2; ++axis) {
            moved[axis] += motion.theta[axis];
            velocity[axis] += lasting * motion.theta[axis];
        }
    }
};

}  // namespace jeat::filters
