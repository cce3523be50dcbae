// Whitens what boxes say; the model of their errors is in jeat_graph/road/box_errors.py.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "arrays.hpp"
#include "math.hpp"
#include "road/box_channels.hpp"

namespace jeat::road {

// A box counts at least this much.
inline constexpr double LEAST_WEIGHT = 1e-6;

// Boxes of one vehicle in order of time, with the sizes of their errors.
struct Boxes {
    std::span<const double> t;
    View2<const double> white, coloured;
    View2<const std::int64_t> mode;
    std::span<const std::int64_t> group;
    std::span<const double> memory_s, weight;

    // Variance of what is new in a channel: a doubtful box is given more of it.
    double new_variance(std::size_t k, std::size_t channel) const {
        const double total = white[k][channel] + square(coloured[k][channel]);
        return white[k][channel] + total * (1.0 / std::max(weight[k], LEAST_WEIGHT) - 1.0);
    }
};

// Whitens columns (N, 4, Q) in place, zero where nothing is measured. Returns ln of the determinant of the errors'
// covariance.
inline double whiten(const Boxes& boxes, std::size_t width, double* columns) {
    double log_determinant = 0.0;
    std::vector<double> expected(width);
    for (std::size_t channel = 0; channel < CHANNELS; ++channel) {
        for (std::size_t g = 0; g < boxes.memory_s.size(); ++g) {
            double variance = 1.0, last = 0.0;
            bool first = true;
            std::fill(expected.begin(), expected.end(), 0.0);
            for (std::size_t k = 0; k < boxes.t.size(); ++k) {
                if (static_cast<std::size_t>(boxes.group[k]) != g) continue;
                double* const row = columns + (k * CHANNELS + channel) * width;
                if (!measured(boxes.mode[k], channel)) {
                    std::fill(row, row + width, 0.0);
                    continue;
                }
                if (!first) {
                    const double forget = exp_of(-(boxes.t[k] - last) / boxes.memory_s[g]);
                    variance = 1.0 + forget * forget * (variance - 1.0);
                    for (double& value : expected) value *= forget;
                }
                first = false, last = boxes.t[k];
                const double h = boxes.coloured[k][channel];
                const double S = h * h * variance + boxes.new_variance(k, channel);
                const double root = 1.0 / std::sqrt(S), gain = variance * h / S;
                log_determinant += log_of(S);
                for (std::size_t q = 0; q < width; ++q) {
                    const double innovation = row[q] - h * expected[q];
                    expected[q] += gain * innovation;
                    row[q] = innovation * root;
                }
                variance -= gain * h * variance;
            }
        }
    }
    return log_determinant;
}

}  // namespace jeat::road
