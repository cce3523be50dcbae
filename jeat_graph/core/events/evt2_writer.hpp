// Encodes EVT 2.0 (see evt2.hpp).
#pragma once

#include "events/evt2.hpp"
#include "events/word_writer.hpp"

namespace jeat::events::evt2 {

// Encodes events until they or the room end; of the state it uses `high`.
inline Encoded encode(const Events& events, std::span<std::uint32_t> words, EncoderState& state) {
    constexpr std::size_t MOST_WORDS = 4;  // of one event, with the times before it
    const auto put_time = [](std::int64_t value) { return static_cast<std::uint32_t>(TIME << 28 | value); };
    std::size_t n = 0, k = 0;
    for (; k < events.t.size() && n + MOST_WORDS <= words.size(); ++k) {
        const std::int64_t high = events.t[k] >> LOW_BITS;
        if (high != state.high) {
            // Readers see that the counter began again by its last and its first value.
            if (state.high >= 0 && high >> HIGH_BITS != state.high >> HIGH_BITS) {
                words[n++] = put_time(HIGH_MASK);
                words[n++] = put_time(0);
            }
            words[n++] = put_time(high & HIGH_MASK);
            state.high = high;
        }
        const auto low = static_cast<std::uint32_t>(events.t[k] & ((1 << LOW_BITS) - 1));
        words[n++] = std::uint32_t{events.p[k] > 0} << 28 | low << 22 | std::uint32_t{events.x[k]} << 11 |
                     std::uint32_t{events.y[k]};
    }
    return {k, n};
}

}  // namespace jeat::events::evt2
