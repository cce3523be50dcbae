// EVT 2.1, whose words jeat_graph/io/events/evt21.py describes.
#pragma once

#include <bit>

#include "events/evt2.hpp"

namespace jeat::events::evt21 {

// The half with time, place and kind, which is a word of EVT 2.0, and the half with a bit for each column.
template <bool swapped> struct Halves {
    static std::int64_t upper(std::uint64_t word) {
        return static_cast<std::int64_t>(swapped ? word & 0xFFFFFFFFu : word >> 32);
    }
    static std::uint32_t columns(std::uint64_t word) { return static_cast<std::uint32_t>(swapped ? word >> 32 : word); }
};

// Counts the events of a word that is late, bits of which the first `most` lie in the picture, as `hold` does.
inline void hold_columns(std::uint32_t columns, std::int64_t most, std::int64_t t, std::int64_t last,
                         DecoderState& state) {
    if (most <= 0 || t >= last) return;
    const std::uint32_t inside = most >= 32 ? columns : columns & ((std::uint32_t{1} << most) - 1);
    if (inside != 0) hold(std::popcount(inside), t, last, state);
}

// Decodes words till they or the room end (see evt2::decode); `swapped`: the upper half of each comes first.
template <bool swapped> std::size_t decode(std::span<const std::uint64_t> words, DecoderState& state,
                                           const Columns& out, const Triggers& triggers, const Limits& limits) {
    using evt2::SIDE, evt2::TIME;
    auto n = static_cast<std::size_t>(state.filled);
    std::int64_t last = state.last, previous = state.previous;
    std::int64_t time = evt2::upper_time(state);
    std::size_t used = words.size();
    for (std::size_t k = 0; k < words.size(); ++k) {
        std::uint32_t columns = Halves<swapped>::columns(words[k]);
        const std::int64_t word = Halves<swapped>::upper(words[k]);
        const std::int64_t kind = word >> 28;
        if (kind < 2) {
            if (n + MOST_OF_A_WORD > out.t.size()) {
                used = k;
                break;
            }
            const std::int64_t x = (word >> 11) & SIDE, y = word & SIDE;
            if (time >= 0 && columns != 0 && y < limits.height) {
                const std::int64_t t = time + evt2::lower_time(word);
                state.backwards += t < previous;
                previous = t;
                last = std::max(t, last);
                hold_columns(columns, limits.width - x, t, last, state);
            }
            for (; columns != 0; columns &= columns - 1) {
                const std::int64_t column = x + std::countr_zero(columns);
                if (is_kept(column, y, time >= 0, limits, state)) put_event(out, n++, last, column, y, kind);
            }
        } else {
            const Leap leap = kind == TIME ? evt2::leap_of(words, k, state, Halves<swapped>::upper) : Leap::none;
            if (leap == Leap::lone) continue;
            if (leap == Leap::open || !evt2::take_other(word, triggers, state)) {
                used = k;
                break;
            }
            time = evt2::upper_time(state);
        }
    }
    state.filled = static_cast<std::int64_t>(n);
    state.last = last;
    state.previous = previous;
    return used;
}

}  // namespace jeat::events::evt21
