// Leaves out the noise of an event camera, for jeat_graph/detection/noise.py.
#pragma once

#include <algorithm>
#include <limits>

#include "arrays.hpp"

namespace jeat::detection {

// Columns and rows of events (px).
struct Places {
    std::span<const std::uint16_t> x, y;
};

// Counts the events of each pixel (H, W).
inline void count_pixels(const Places& places, View2<std::int32_t> counts) {
    for (std::size_t k = 0; k < places.x.size(); ++k) {
        const std::size_t column = places.x[k], row = places.y[k];
        if (column < counts.columns && row < counts.rows) ++counts[row][column];
    }
}

inline bool any(View2<const bool> marks) {
    return std::find(marks.data, marks.data + marks.size(), true) != marks.data + marks.size();
}

// Marks the events that have another in the eight pixels around within `support_us` before, and keeps the
// times of the pixels (H + 2, W + 2; µs from `begin_us`); returns how many stood alone.
inline std::int64_t judge_noise(std::span<const std::int64_t> t, const Places& places, View2<std::int32_t> last,
                                View2<const bool> hot, std::int64_t begin_us, std::int64_t support_us,
                                std::span<bool> good) {
    constexpr std::int64_t EARLIEST = std::int64_t{std::numeric_limits<std::int32_t>::min()} + 1;
    const bool any_hot = any(hot);
    std::int64_t alone = 0;
    for (std::size_t k = 0; k < t.size(); ++k) {
        const std::size_t column = places.x[k], row = places.y[k];
        if (column >= hot.columns || row >= hot.rows || (any_hot && hot[row][column])) continue;
        const std::int64_t now = t[k] - begin_us;
        const auto since = static_cast<std::int32_t>(std::max(now - support_us, EARLIEST));
        // All eight around are asked, though the first that fired will do: which one that is cannot be
        // guessed, and a wrong guess takes the processor longer.
        const std::int32_t* above = last[row] + column;
        std::int32_t* here = last[row + 1] + column;
        const std::int32_t* below = last[row + 2] + column;
        const std::int32_t newest =
            std::max({above[0], above[1], above[2], here[0], here[2], below[0], below[1], below[2]});
        const bool near = newest >= since;
        here[1] = static_cast<std::int32_t>(now);
        alone += !near;
        good[k] = near;
    }
    return alone;
}

// Marks the events that are in the picture (H, W) and not of hot pixels.
inline void leave_hot(const Places& places, View2<const bool> hot, std::span<bool> good) {
    for (std::size_t k = 0; k < places.x.size(); ++k) {
        const std::size_t column = places.x[k], row = places.y[k];
        good[k] = column < hot.columns && row < hot.rows && !hot[row][column];
    }
}

// Columns of events, to read or to write; all of one length.
template <class Time, class Place, class Polarity> struct EventColumns {
    std::span<Time> t;
    std::span<Place> x, y;
    std::span<Polarity> p;
};
using GivenEvents = EventColumns<const std::int64_t, const std::uint16_t, const std::uint8_t>;
using TakenEvents = EventColumns<std::int64_t, std::uint16_t, std::uint8_t>;

// Copies the events that are marked; returns how many. `out` has room for one more than are given.
inline std::size_t take_events(const GivenEvents& events, std::span<const bool> good, const TakenEvents& out) {
    std::size_t n = 0;
    for (std::size_t k = 0; k < good.size(); ++k) {
        // Written before it is known whether it stays: no branch that is guessed wrongly.
        out.t[n] = events.t[k];
        out.x[n] = events.x[k];
        out.y[n] = events.y[k];
        out.p[n] = events.p[k];
        n += good[k];
    }
    return n;
}

}  // namespace jeat::detection
