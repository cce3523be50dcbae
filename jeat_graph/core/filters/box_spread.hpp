// How sure a detector is of each side of one box; the formulas are in filters/box_spread.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "filters/box_sides.hpp"
#include "math.hpp"

namespace jeat::filters {

// Of the four sides: left, right, top, bottom.
using BySide = std::array<double, 4>;

// (sigma / s)^2 of the sides of a box of the size given in px, within bounds; NaN where sigma is not known. `box_std`
// is of left, top, right, bottom.
inline BySide spread_squares(const double* box_std, double width, double height, const ModelConstants& c) {
    const double both = std::sqrt(width * height), size[] = {width, height};
    BySide out;
    for (int axis = 0; axis < 2; ++axis)
        for (int side = 0; side < 2; ++side) {
            const double std = box_std[2 * side + axis];
            out[2 * axis + side] =
                std::isnan(std)
                    ? std
                    : square(clamp(std / side_scale(size[axis], both), c.spread_bounds.low, c.spread_bounds.high));
        }
    return out;
}

// rho^2 of a sensor, the part of its noise that its own spreads stand for, and f^2, by which these are taken.
struct SpreadNoise {
    double rho2, gain;

    SpreadNoise(double log_variance, double mean_square)
        : rho2(exp_of(log_variance)), gain(std::isnan(mean_square) ? 1.0 : rho2 / mean_square) {}

    // What the variances of a box's sides are more than those of the sensor, for an object of the size given (px^2).
    BySide more(const BySide& squares, const Sides& box, const std::array<double, 2>& size) const {
        const double own[] = {box.width(), box.height()};
        const double own_both = std::sqrt(own[0] * own[1]), both = std::sqrt(size[0] * size[1]);
        BySide out;
        for (int axis = 0; axis < 2; ++axis) {
            const double of_box = gain * square(side_scale(own[axis], own_both)),
                         of_sensor = rho2 * square(side_scale(size[axis], both));
            for (int side = 2 * axis; side < 2 * axis + 2; ++side)
                out[side] = std::isnan(squares[side]) ? 0.0 : of_box * squares[side] - of_sensor;
        }
        return out;
    }

    // The mean variance of a box's sides in sizes^2, where that of the sensor is `noise`.
    double mean_noise(double noise, const BySide& squares) const {
        double sum = 0.0;
        for (const double one : squares) sum += std::isnan(one) ? 0.0 : gain * one - rho2;
        return noise + sum / 4.0;
    }
};

// What is expected of a box whose sides have other variances.
inline SidesExpected with_spread(SidesExpected expected, const BySide& more) {
    for (int axis = 0; axis < 2; ++axis) {
        const double left = more[2 * axis], right = more[2 * axis + 1];
        expected.S[axis] = expected.S[axis].plus(left, right);
        expected.variance[2 * axis] += left;
        expected.variance[2 * axis + 1] += right;
        expected.take_logs(axis);
    }
    return expected;
}

// The squares of the boxes of well known tracks, by the sizes of these.
struct SpreadSums {
    double sum = 0.0, number = 0.0;

    void add(const BySide& squares, const Sides& box, const std::array<double, 2>& size) {
        const double own[] = {box.width(), box.height()};
        const double own_both = std::sqrt(own[0] * own[1]), both = std::sqrt(size[0] * size[1]);
        for (int axis = 0; axis < 2; ++axis) {
            const double ratio = square(side_scale(own[axis], own_both) / side_scale(size[axis], both));
            for (int side = 2 * axis; side < 2 * axis + 2; ++side)
                if (!std::isnan(squares[side])) sum += squares[side] * ratio, number += 1.0;
        }
    }

    // ln rho^2 goes with the mean square, so that f stays as it is.
    void learn(double share, double& log_variance, double& mean_square, const ModelConstants& c) const {
        if (number == 0.0) return;
        const double now = sum / number;
        const bool first = std::isnan(mean_square);
        const double after = first ? now : mean_square + c.spread_rate * share * (now - mean_square);
        const double moved = first ? log_of(after) : log_variance + log_of(after / mean_square);
        mean_square = after;
        log_variance = clamp(moved, 2.0 * log_of(c.side_std_bounds.low), 2.0 * log_of(c.side_std_bounds.high));
    }
};

}  // namespace jeat::filters
