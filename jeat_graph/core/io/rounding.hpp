// Rounds numbers to decimal digits, for jeat_graph/io/tables/rounding.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <span>
#include <string>

namespace jeat::io {

inline constexpr int MOST_DECIMALS = 22;  // 10^22 is the largest power of ten that a double holds exactly
inline constexpr int MOST_POWER = 308;    // the largest of which there is a double
inline constexpr double LOG10_2 = 0.30102999566398119521;

// The doubles nearest to the powers of ten from 10^0 on.
inline const std::array<double, MOST_POWER + 1>& powers_of_ten() {
    static const auto powers = [] {
        std::array<double, MOST_POWER + 1> table{};
        for (int n = 0; n <= MOST_POWER; ++n) table[n] = std::strtod(("1e" + std::to_string(n)).c_str(), nullptr);
        return table;
    }();
    return powers;
}

// Greatest n with 10^n <= size, for a positive number; of very small ones one that is small enough.
inline int power_below(double size) {
    const auto& powers = powers_of_ten();
    // From the power of two below, which gives one that is at most one too small.
    const double estimate = std::ilogb(size) * LOG10_2;
    const int towards_zero = static_cast<int>(estimate);
    const int power = towards_zero - (estimate < towards_zero), above = power + 1;
    if (power < -MOST_POWER || above > MOST_POWER) return power;
    const double ten = above >= 0 ? powers[above] : 1.0 / powers[-above];
    return size >= ten ? above : power;
}

// The whole number nearest to a value, the even one of two: without the function of the C library, which not every
// processor has an instruction for.
inline double nearest_whole(double value) {
    constexpr double WHOLE = 0x1p52;  // from here on doubles are whole numbers
    const double size = std::abs(value);
    return size < WHOLE ? std::copysign((size + WHOLE) - WHOLE, value) : value;
}

// Rounds to significant decimal digits, in place; zero, NaN and infinity stay, and minus zero becomes zero.
inline void round_significant(std::span<double> values, int digits) {
    const auto& powers = powers_of_ten();
    for (double& value : values) {
        const double size = std::abs(value);
        if (size == 0.0 || !std::isfinite(size)) {
            value += 0.0;
            continue;
        }
        const int place = std::min(digits - 1 - power_below(size), MOST_DECIMALS);
        // Both factors are exact powers of ten, one is 1: the result is the double nearest to its digits.
        const double up = powers[std::max(place, 0)], down = powers[std::max(-place, 0)];
        const double rounded = nearest_whole(value * up / down) / up * down;
        if (std::isfinite(rounded)) value = rounded + 0.0;
    }
}

}  // namespace jeat::io
