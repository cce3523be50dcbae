// Tells events of what moves from those that a place always has, for jeat_graph/detection/background.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "arrays.hpp"
#include "wide.hpp"

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

// Lets means follow the sums around; `kept` is -1 where a sum stands out, else 0.
JEAT_GRAPH_WIDE static void follow(const float* around, float* mean, const Usual& how, std::int32_t* kept,
                                   std::size_t size) {
    const auto [sigmas, quick, slow] = how;
    for (std::size_t k = 0; k < size; ++k) {
        const float usual = mean[k], now = around[k], change = now - usual, sigma = std::sqrt(usual);
        const bool stands_out = now > usual + sigmas * sigma + MORE_EVENTS;
        const float more = FOLLOWED_SIGMAS * sigma + FOLLOWED_EVENTS;
        const float followed = stands_out && more < change ? more : change;
        mean[k] = usual + (stands_out ? slow : quick) * followed;
        kept[k] = stands_out ? -1 : 0;
    }
}

// Writes the counts that stand out of the means of the sums around them, and lets the means follow.
//
// Of what does not stand out the means are at first those of all windows so far; what does is followed slowly
// from the first on, or a slow vehicle would be usual before it has left its place.
inline void mark_unusual(std::span<const std::uint16_t> counts, std::span<const float> around, std::span<float> mean,
                         const Usual& how, std::span<std::uint16_t> out) {
    // In two loops over numbers of one size each: so they become vectors.
    constexpr std::size_t PART = 1024;
    std::array<std::int32_t, PART> kept;
    for (std::size_t from = 0; from < counts.size(); from += PART) {
        const std::size_t size = std::min(PART, counts.size() - from);
        follow(around.data() + from, mean.data() + from, how, kept.data(), size);
        for (std::size_t k = 0; k < size; ++k) {
            out[from + k] = static_cast<std::uint16_t>(counts[from + k] & kept[k]);
        }
    }
}

}  // namespace jeat::detection
