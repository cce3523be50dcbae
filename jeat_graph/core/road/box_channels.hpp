// What is measured of a box: centre and size, or the one side that shows where the picture cuts the other off.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "arrays.hpp"
#include "math.hpp"
#include "road/cuboid.hpp"

namespace jeat::road {

// Channels of a box: centre x, centre y (px), ln width, ln height.
inline constexpr std::size_t CHANNELS = 4;
// What of an axis is measured, as jeat_graph/road/box_channels.py numbers it.
inline constexpr std::int64_t WHOLE = 0, LOW = 1, HIGH = 2, NEITHER = 3;
// Least width and height whose logarithm is taken (px).
inline constexpr double LEAST_EXTENT_PX = 1e-6;

struct Channels {
    std::array<double, CHANNELS> z;
    std::array<std::array<double, UNKNOWNS>, CHANNELS> slope;
};

// Whether a channel of a box with these modes counts.
inline bool measured(const std::int64_t* mode, std::size_t channel) {
    return channel < 2 ? mode[channel] != NEITHER : mode[channel - 2] == WHOLE;
}

// The channels of a hull, zero where nothing is measured; a centre's is the side itself where only that is.
inline Channels channels_of(const Hull& hull, const std::int64_t* mode) {
    Channels out{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const std::size_t low = axis, high = axis + 2;
        if (mode[axis] == WHOLE) {
            const double extent = std::max(hull.side[high] - hull.side[low], LEAST_EXTENT_PX);
            out.z[low] = 0.5 * (hull.side[low] + hull.side[high]);
            out.z[high] = log_of(extent);
            for (std::size_t c = 0; c < UNKNOWNS; ++c) {
                out.slope[low][c] = 0.5 * (hull.slope[low][c] + hull.slope[high][c]);
                out.slope[high][c] = (hull.slope[high][c] - hull.slope[low][c]) / extent;
            }
        } else if (mode[axis] != NEITHER) {
            const std::size_t side = mode[axis] == LOW ? low : high;
            out.z[axis] = hull.side[side];
            out.slope[axis] = hull.slope[side];
        }
    }
    return out;
}

// Fills derivatives (N * 4, 5) and residuals (N, 4) of the boxes of one vehicle of `size`; `place` holds x, y (m),
// `way` sine and cosine of the heading. Returns whether the vehicle is in front of the camera at all times.
inline bool linearise(const Camera& camera, View2<const double> place, View2<const double> way, const double* size,
                      View2<const double> z, View2<const std::int64_t> mode, std::span<double> slopes,
                      View2<double> residual) {
    Hull hull;
    for (std::size_t k = 0; k < z.rows; ++k) {
        if (!hull_of(camera, place[k][0], place[k][1], {way[k][0], way[k][1]}, size, hull)) return false;
        const Channels expected = channels_of(hull, mode[k]);
        for (std::size_t channel = 0; channel < CHANNELS; ++channel) {
            std::copy(expected.slope[channel].begin(), expected.slope[channel].end(),
                      slopes.begin() + static_cast<std::ptrdiff_t>((k * CHANNELS + channel) * UNKNOWNS));
            residual[k][channel] = z[k][channel] - expected.z[channel];
        }
    }
    return true;
}

}  // namespace jeat::road
