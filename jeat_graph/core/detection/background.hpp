// Tells events of what moves from those that a place always has, for jeat_graph/detection/background.py.
#pragma once

#include <cmath>

#include "arrays.hpp"

namespace jeat::detection {

// How what is usual is told: `sigmas` of independent events, and the shares of a new window in the means, of
// what does not stand out (`quick`) and of what does (`slow`).
struct Usual {
    float sigmas, quick, slow;
};

// Where hardly any are usual, the normal distribution is wrong by about so many events.
inline constexpr float MORE_EVENTS = 2.0F;
// Of what stands out the mean follows so many deviations, and so many events: or it would become usual.
inline constexpr float FOLLOWED_SIGMAS = 1.0F, FOLLOWED_EVENTS = 0.5F;

// Writes the counts that stand out of the means of the sums around them, and lets the means follow.
//
// Of what does not stand out the means are at first those of all windows so far; what does is followed slowly
// from the first on, or a slow vehicle would be usual before it has left its place.
inline void mark_unusual(std::span<const std::uint16_t> counts, std::span<const float> around,
                         std::span<float> mean, const Usual& how, std::span<std::uint16_t> out) {
    for (std::size_t k = 0; k < counts.size(); ++k) {
        const float usual = mean[k], now = around[k];
        const float sigma = std::sqrt(usual);
        const bool stands_out = now > usual + how.sigmas * sigma + MORE_EVENTS;
        const float more = FOLLOWED_SIGMAS * sigma + FOLLOWED_EVENTS, change = now - usual;
        const float most = more < change ? more : change;
        out[k] = stands_out ? counts[k] : std::uint16_t{0};
        mean[k] = usual + (stands_out ? how.slow * most : how.quick * change);
    }
}

}  // namespace jeat::detection
