// EVT 2.0, whose words jeat_graph/io/events/evt2.py describes; its times and edges are those of EVT 2.1, too.
#pragma once

#include "events/decoding.hpp"

namespace jeat::events::evt2 {

inline constexpr int HIGH_BITS = 28, LOW_BITS = 6;
inline constexpr std::int64_t HIGH_MASK = (std::int64_t{1} << HIGH_BITS) - 1;
inline constexpr std::int64_t SIDE = 0x7FF;
inline constexpr std::int64_t TIME = 8, EDGE = 10, OTHERS = 14;

// The time (µs) without the low bits, which events and edges have; negative if none is known.
inline std::int64_t upper_time(const DecoderState& state) {
    return ((state.wraps << HIGH_BITS) + state.high) << LOW_BITS;
}

// The low bits of the time (µs) of an event or edge.
inline std::int64_t lower_time(std::int64_t word) { return (word >> 22) & 0x3F; }

// Takes a word that is no event into the state; false if it is an edge and there is no room for it.
inline bool take_other(std::int64_t word, const Triggers& triggers, DecoderState& state) {
    const std::int64_t kind = word >> 28;
    if (kind == TIME) {
        const std::int64_t now = word & HIGH_MASK;
        state.wraps = turns_of_counter(now, state.high, state.wraps, HIGH_BITS, LOW_BITS, state);
        state.high = now;
    } else if (kind == EDGE) {
        if (state.high < 0) {
            ++state.untimed;
        } else if (state.triggers == static_cast<std::int64_t>(triggers.t.size())) {
            return false;
        } else {
            put_edge(triggers, static_cast<std::size_t>(state.triggers), upper_time(state) + lower_time(word),
                     (word >> 8) & 0x1F, word & 1);
            ++state.triggers;
        }
    } else if (kind < OTHERS) {
        ++state.unknown;
    }
    return true;
}

// What leap the time of word `k` is, by the next time; `upper(word)` is the word of EVT 2.0 in a word.
template <class Word, class Upper>
Leap leap_of(std::span<const Word> words, std::size_t k, DecoderState& state, Upper upper) {
    const std::int64_t old = state.high, now = upper(words[k]) & HIGH_MASK;
    if (!leaps(now, old, LOW_BITS)) return Leap::none;
    std::int64_t after = -1;
    for (std::size_t j = k + 1; j < words.size(); ++j) {
        const std::int64_t word = upper(words[j]);
        if (word >> 28 == TIME) {
            after = word & HIGH_MASK;
            break;
        }
    }
    return kind_of_leap(old, now, after, std::int64_t{1} << HIGH_BITS, words.size() - k, state);
}

// Decodes words until they, or the room, end, or the state waits for more; returns how many were used.
inline std::size_t decode(std::span<const std::uint32_t> words, DecoderState& state, const Columns& out,
                          const Triggers& triggers, const Limits& limits) {
    const auto whole = [](std::uint32_t word) { return static_cast<std::int64_t>(word); };
    auto n = static_cast<std::size_t>(state.filled);
    std::int64_t last = state.last, previous = state.previous;
    std::int64_t time = upper_time(state);
    std::size_t used = words.size();
    for (std::size_t k = 0; k < words.size(); ++k) {
        const std::int64_t word = words[k];
        const std::int64_t kind = word >> 28;
        if (kind < 2) {
            if (n == out.t.size()) {
                used = k;
                break;
            }
            const std::int64_t x = (word >> 11) & SIDE, y = word & SIDE;
            if (is_kept(x, y, time >= 0, limits, state)) {
                const std::int64_t t = time + lower_time(word);
                if (t < last) {
                    hold(1, t, last, state);
                    if (t < previous) ++state.backwards;
                } else {
                    last = t;
                }
                previous = t;
                put_event(out, n++, last, x, y, kind);
            }
        } else {
            const Leap leap = kind == TIME ? leap_of(words, k, state, whole) : Leap::none;
            if (leap == Leap::lone) continue;
            if (leap == Leap::open || !take_other(word, triggers, state)) {
                used = k;
                break;
            }
            time = upper_time(state);
        }
    }
    state.filled = static_cast<std::int64_t>(n);
    state.last = last;
    state.previous = previous;
    return used;
}

}  // namespace jeat::events::evt2
