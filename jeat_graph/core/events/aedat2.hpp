// AEDAT 2.0, whose words jeat_graph/io/events/aedat2.py describes.
#pragma once

#include "events/decoding.hpp"

namespace jeat::events::aedat2 {

// A 32-bit word turned from big-endian.
constexpr std::int64_t swapped(std::uint32_t word) {
    return static_cast<std::int64_t>(((word & 0xFFu) << 24) | ((word & 0xFF00u) << 8) | ((word >> 8) & 0xFF00u) |
                                     (word >> 24));
}

// What an address says. `davis`: of a DAVIS, else of a DVS128.
struct Address {
    bool special;  // an edge of an external signal, no event
    std::int64_t x, y, polarity;
};
template <bool davis> constexpr Address address_of(std::int64_t word) {
    if constexpr (davis)
        return {(word >> 10 & 1) != 0, word >> 12 & 0x3FF, word >> 22 & 0x1FF, word >> 11 & 1};
    else
        return {(word >> 15 & 1) != 0, word >> 1 & 0x7F, word >> 8 & 0x7F, 1 - (word & 1)};
}

// Decodes words until they, or the room, end; returns how many were used.
template <bool davis> std::size_t decode(std::span<const std::uint64_t> words, DecoderState& state, const Columns& out,
                                         const Triggers& triggers, const Limits& limits) {
    auto n = static_cast<std::size_t>(state.filled), m = static_cast<std::size_t>(state.triggers);
    std::int64_t turns = state.wraps, last = state.last, low = state.high;
    std::int64_t time = turns << CLOCK_BITS;
    std::size_t used = words.size();
    for (std::size_t k = 0; k < words.size(); ++k) {
        const std::int64_t word = swapped(static_cast<std::uint32_t>(words[k]));
        const std::int64_t now = swapped(static_cast<std::uint32_t>(words[k] >> 32));
        if (davis && word >> 31) continue;
        if (n == out.t.size() || m == triggers.t.size()) {
            used = k;
            break;
        }
        const auto [special, x, y, polarity] = address_of<davis>(word);
        if (!special && !is_kept(x, y, true, limits, state)) continue;
        if (!(low <= now && now <= low + JUMP_US)) {
            turns = turns_of_clock(now, low, turns, state);
            time = turns << CLOCK_BITS;
        }
        low = now;
        const std::int64_t t = time + now;
        if (t < last && !special) hold(1, t, last, state);
        last = std::max(t, last);
        if (special) {
            put_edge(triggers, m++, last, 0, polarity);
        } else {
            put_event(out, n++, last, limits.width - 1 - x, limits.height - 1 - y, polarity);
        }
    }
    state.filled = static_cast<std::int64_t>(n);
    state.triggers = static_cast<std::int64_t>(m);
    state.wraps = turns;
    state.last = last;
    state.high = low;
    return used;
}

}  // namespace jeat::events::aedat2
