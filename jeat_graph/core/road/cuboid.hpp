// The box of a vehicle: sides of a cuboid's hull in the picture, whose definition is jeat_graph/road/cuboid.py.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "road/camera.hpp"

namespace jeat::road {

// Unknowns that a box depends on: x, y of the footprint's middle, length, width, height (m).
inline constexpr std::size_t UNKNOWNS = 5;
// A corner nearer than this is not in front of the camera (m).
inline constexpr double NEAREST_M = 0.5;

// Left, top, right, bottom (px), with derivatives with respect to the unknowns (px/m).
struct Hull {
    std::array<double, 4> side;
    std::array<std::array<double, UNKNOWNS>, 4> slope;
};

namespace detail {

// Corner k of eight: whether it is ahead, to the right, above.
struct Corner {
    double ahead, beside, above;
    explicit Corner(std::size_t k) : ahead(k & 2 ? 1.0 : -1.0), beside(k & 1 ? 1.0 : -1.0), above(k & 4 ? 1.0 : 0.0) {}
};

}  // namespace detail

// Returns whether the whole cuboid is in front of the camera; only then the hull is filled.
inline bool hull_of(const Camera& camera, double x, double y, Direction d, const double* size, Hull& hull) {
    using detail::Corner;
    const auto& R = camera.rotation;
    const double to_x = x - camera.position[0], to_y = y - camera.position[1], to_z = -camera.position[2];
    // Right, below and before the camera (m): the footprint's middle, half a length ahead, half a width beside,
    // the height. All corners are sums of these.
    std::array<double, 3> middle, length, width, height;
    for (std::size_t i = 0; i < 3; ++i) {
        middle[i] = R[i][0] * to_x + R[i][1] * to_y + R[i][2] * to_z;
        length[i] = 0.5 * size[0] * (R[i][0] * d.x + R[i][1] * d.y);
        width[i] = 0.5 * size[1] * (R[i][0] * d.y - R[i][1] * d.x);
        height[i] = size[2] * R[i][2];
    }
    std::array<std::array<double, 3>, 8> corner;
    std::array<std::size_t, 4> outermost{};
    constexpr double infinity = std::numeric_limits<double>::infinity();
    hull.side = {infinity, infinity, -infinity, -infinity};
    for (std::size_t k = 0; k < 8; ++k) {
        const Corner at(k);
        for (std::size_t i = 0; i < 3; ++i)
            corner[k][i] = middle[i] + at.ahead * length[i] + at.beside * width[i] + at.above * height[i];
        const double depth = corner[k][2];
        if (!(depth >= NEAREST_M)) return false;
        const double n0 = corner[k][0] / depth, n1 = corner[k][1] / depth;
        const double gain = camera.distortion(n0 * n0 + n1 * n1);
        const std::array<double, 2> pixel{n0 * gain * camera.focal[0] + camera.centre[0],
                                          n1 * gain * camera.focal[1] + camera.centre[1]};
        for (std::size_t axis = 0; axis < 2; ++axis) {
            if (pixel[axis] < hull.side[axis]) hull.side[axis] = pixel[axis], outermost[axis] = k;
            if (pixel[axis] > hull.side[axis + 2]) hull.side[axis + 2] = pixel[axis], outermost[axis + 2] = k;
        }
    }
    for (std::size_t s = 0; s < 4; ++s) {
        const Corner at(outermost[s]);
        const auto& [right, below, depth] = corner[outermost[s]];
        const std::size_t axis = s % 2;
        const std::array<double, 2> n{right / depth, below / depth};
        const double r2 = n[0] * n[0] + n[1] * n[1];
        const double gain = camera.distortion(r2), bend = camera.distortion_slope(r2), f = camera.focal[axis] / depth;
        std::array<double, 3> in_camera;  // derivative with respect to right, below, before
        for (std::size_t i = 0; i < 2; ++i) in_camera[i] = f * (n[axis] * n[i] * bend + (i == axis ? gain : 0.0));
        in_camera[2] = -(in_camera[0] * n[0] + in_camera[1] * n[1]);
        std::array<double, 3> on_road;
        for (std::size_t i = 0; i < 3; ++i)
            on_road[i] = in_camera[0] * R[0][i] + in_camera[1] * R[1][i] + in_camera[2] * R[2][i];
        hull.slope[s] = {on_road[0], on_road[1], 0.5 * at.ahead * (on_road[0] * d.x + on_road[1] * d.y),
                         0.5 * at.beside * (on_road[0] * d.y - on_road[1] * d.x), at.above * on_road[2]};
    }
    return true;
}

}  // namespace jeat::road
