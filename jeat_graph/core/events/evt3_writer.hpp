// Encodes EVT 3.0 (see evt3.hpp): runs of events of one row, time and polarity become groups of columns.
#pragma once

#include "events/evt3.hpp"
#include "events/word_writer.hpp"

namespace jeat::events::evt3 {

inline constexpr std::size_t LEAST_RUN = 4;   // a group costs two words, an event one
inline constexpr std::size_t MOST_WORDS = 8;  // of one step, the words of a time that moves on apart
inline constexpr int SPAN_12 = 12, SPAN_8 = 8;

// How many events from k on fit into one group of 12: same row, time and polarity, x ascending.
inline std::size_t run_from(const Events& events, std::size_t k) {
    const auto& [t, x, y, p] = events;
    std::size_t end = k + 1;
    while (end < t.size() && t[end] == t[k] && y[end] == y[k] && p[end] == p[k] && x[end] > x[end - 1] &&
           x[end] - x[k] < SPAN_12) {
        ++end;
    }
    return end - k;
}

// Encodes events until they or the room end.
inline Encoded encode(const Events& events, std::span<std::uint16_t> words, EncoderState& state) {
    const auto word = [](Kind kind, std::int64_t bits) { return static_cast<std::uint16_t>(kind << 12 | bits); };
    const auto& [t, x, y, p] = events;
    std::size_t n = 0, k = 0;
    while (k < t.size() && n + MOST_WORDS <= words.size()) {
        const std::int64_t high = t[k] >> LOW_BITS;
        // The counter has only 16.8 s: each of its steps is written, as cameras do, so that none is missed.
        if (high != state.high) {
            state.high = state.high >= 0 ? state.high + 1 : high;
            words[n++] = word(TIME_HIGH, state.high & BITS);
            state.low = -1;
            continue;
        }
        if ((t[k] & BITS) != state.low) {
            state.low = t[k] & BITS;
            words[n++] = word(TIME_LOW, state.low);
        }
        if (y[k] != state.row) {
            state.row = y[k];
            words[n++] = word(ROW, state.row);
        }
        const std::int64_t polarity = std::int64_t{p[k] > 0} << 11;
        const std::size_t count = run_from(events, k);
        if (count >= LEAST_RUN) {
            std::int64_t mask = 0;
            for (std::size_t j = k; j < k + count; ++j) mask |= std::int64_t{1} << (x[j] - x[k]);
            words[n++] = word(FIRST, polarity | x[k]);
            words[n++] = word(mask < 1 << SPAN_8 ? GROUP_8 : GROUP_12, mask);
            k += count;
        } else {
            words[n++] = word(EVENT, polarity | x[k]);
            ++k;
        }
    }
    return {k, n};
}

}  // namespace jeat::events::evt3
