// How far a size is from those of vehicles; kinds of vehicles are in jeat_graph/road/fleet.py.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "math.hpp"

namespace jeat::road {

// Length, width, height (m) of the smallest and the largest kind, and how sizes of those kinds differ.
struct Extremes {
    std::array<double, 3> least, least_spread, greatest, greatest_spread;
};

// Squared distance of a size, known with variances, from what lies between the extremes, in their spreads.
inline double beyond_vehicles(const double* size, const double* variance, const Extremes& of) {
    double total = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
        const bool larger = size[k] > of.greatest[k];
        const double off = larger ? size[k] - of.greatest[k] : std::max(of.least[k] - size[k], 0.0);
        const double spread = larger ? of.greatest_spread[k] : of.least_spread[k];
        total += off * off / (spread * spread + variance[k]);
    }
    return total;
}

}  // namespace jeat::road
