// DAT, whose words jeat_graph/io/events/dat.py describes.
#pragma once

#include "events/decoding.hpp"

namespace jeat::events::dat {

inline constexpr std::uint64_t CLOCK_MASK = 0xFFFFFFFFu;

// What leap from `old` the time of word `k` is, by the next one.
inline Leap leap_of(std::span<const std::uint64_t> words, std::size_t k, std::int64_t old, DecoderState& state) {
    const auto now = static_cast<std::int64_t>(words[k] & CLOCK_MASK);
    if (!leaps(now, old, 0)) return Leap::none;
    const std::int64_t after =
        k + 1 < words.size() ? static_cast<std::int64_t>(words[k + 1] & CLOCK_MASK) : std::int64_t{-1};
    return kind_of_leap(old, now, after, std::int64_t{1} << CLOCK_BITS, words.size() - k, state);
}

// Decodes words until they, or the room, end, or the state waits for more; returns how many were used.
template <int x_bits, int y_bits> std::size_t decode(std::span<const std::uint64_t> words, DecoderState& state,
                                                     const Columns& out, const Limits& limits) {
    auto n = static_cast<std::size_t>(state.filled);
    std::int64_t turns = state.wraps, last = state.last, low = state.high;
    std::int64_t time = turns << CLOCK_BITS;
    std::int64_t latest = std::max(low, last - time);  // on this turn of the clock; after a step back not `low`
    std::size_t used = words.size();
    for (std::size_t k = 0; k < words.size(); ++k) {
        if (n == out.t.size()) {
            used = k;
            break;
        }
        auto now = static_cast<std::int64_t>(words[k] & CLOCK_MASK);
        const auto address = static_cast<std::int64_t>(words[k] >> 32);
        const std::int64_t x = address & ((1 << x_bits) - 1);
        const std::int64_t y = (address >> x_bits) & ((1 << y_bits) - 1);
        const std::int64_t polarity = address >> (x_bits + y_bits);
        if (polarity > 1) {
            ++state.unknown;
            continue;
        }
        if (!is_kept(x, y, true, limits, state)) continue;
        if (latest <= now && now <= low + LEAP_US) {
            latest = now;
        } else {
            const Leap leap = leap_of(words, k, low, state);
            if (leap == Leap::open) {
                used = k;
                break;
            }
            if (leap == Leap::lone) {
                now = low;
            } else if (!(low <= now && now <= low + LEAP_US)) {
                turns = turns_of_clock(now, low, turns, state);
                time = turns << CLOCK_BITS;
            }
            if (time + now < last) hold(1, time + now, last, state);
            latest = std::max(now, last - time);
        }
        low = now;
        last = time + latest;
        put_event(out, n++, last, x, y, polarity);
    }
    state.filled = static_cast<std::int64_t>(n);
    state.wraps = turns;
    state.last = last;
    state.high = low;
    return used;
}

}  // namespace jeat::events::dat
