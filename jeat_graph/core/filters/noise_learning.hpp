// Measurement and process noise learnt from innovations; the formulas are in filters/noise_learning.py.
#pragma once

#include <array>

#include "filters/box_sides.hpp"

namespace jeat::filters {

using Innovation = std::array<double, 4>;

// Of centre x, y, ln width, ln height, in standard deviations, clipped.
inline Innovation normalised_innovation(const std::array<double, 4>& y, const SidesExpected& expected,
                                        const ModelConstants& c) {
    Innovation out;
    for (int axis = 0; axis < 2; ++axis) {
        const Pair2& S = expected.S[axis];
        const double left = y[2 * axis], right = y[2 * axis + 1], size = expected.size[axis];
        const double centre = (left + right) / 2.0 / std::sqrt((S.ll + 2.0 * S.lr + S.rr) / 4.0);
        const double extent = (right - left) / size / std::sqrt((S.ll + S.rr - 2.0 * S.lr) / square(size));
        out[axis] = clamp(centre, -c.innovation_clip, c.innovation_clip);
        out[2 + axis] = clamp(extent, -c.innovation_clip, c.innovation_clip);
    }
    return out;
}

// Squared distance of a box's centre from the expected one, in standard deviations: χ² of two degrees of freedom.
inline double centre_distance(const std::array<double, 4>& y, const SidesExpected& expected) {
    double out = 0.0;
    for (int axis = 0; axis < 2; ++axis) {
        const Pair2& S = expected.S[axis];
        out += square((y[2 * axis] + y[2 * axis + 1]) / 2.0) / ((S.ll + 2.0 * S.lr + S.rr) / 4.0);
    }
    return out;
}

// What the well known tracks of one scan say together.
struct InnovationSums {
    double teachers = 0.0, squares = 0.0, lag_centre = 0.0, lag_extent = 0.0;

    void add(const Innovation& e, const double* before, bool known, const ModelConstants& c) {
        teachers += 1.0;
        for (int k = 0; k < 4; ++k) {
            squares += std::min(e[k] * e[k], c.nis_cap);
            if (known) (k < 2 ? lag_centre : lag_extent) += e[k] * before[k];
        }
    }

    // The weight of a scan: few tracks teach little, and a fast sensor's scans repeat its errors.
    double share(double period_s, const ModelConstants& c) const {
        return std::min(1.0, teachers / c.noise_tracks) * std::min(1.0, period_s / c.noise_period_s);
    }
};

inline double bounded_log_variance(double log_variance, const Bounds& bounds) {
    return clamp(log_variance, 2.0 * log_of(bounds.low), 2.0 * log_of(bounds.high));
}

inline void learn_noise(const InnovationSums& sums, double period_s, double& log_variance, ProcessNoise& q,
                        const ModelConstants& c) {
    if (sums.teachers == 0.0) return;
    const double share = sums.share(period_s, c);
    const double excess = sums.squares / (4.0 * sums.teachers) - c.nis_target;
    log_variance = bounded_log_variance(log_variance + c.noise_rate * share * excess, c.side_std_bounds);
    const double centre = share * sums.lag_centre / (2.0 * sums.teachers);
    const double extent = share * sums.lag_extent / (2.0 * sums.teachers);
    q.jerk = bounded_log_variance(q.jerk + c.process_rate * centre, c.jerk_bounds);
    q.growth = bounded_log_variance(q.growth + c.process_rate * extent, c.growth_bounds);
    q.position = bounded_log_variance(q.position + c.walk_rate * centre, c.walk_bounds);
    q.size = bounded_log_variance(q.size + c.walk_rate * extent, c.walk_bounds);
}

}  // namespace jeat::filters
