// Encodes DAT (see dat.hpp).
#pragma once

#include <algorithm>

#include "events/word_writer.hpp"

namespace jeat::events::dat {

inline constexpr int SIDE_BITS = 14;

// Encodes events; nothing is kept from one call to the next.
inline Encoded encode(const Events& events, std::span<std::uint64_t> words) {
    const std::size_t count = std::min(events.t.size(), words.size());
    for (std::size_t k = 0; k < count; ++k) {
        const std::uint64_t address =
            std::uint64_t{events.p[k] > 0} << (2 * SIDE_BITS) | std::uint64_t{events.y[k]} << SIDE_BITS | events.x[k];
        words[k] = address << 32 | (static_cast<std::uint64_t>(events.t[k]) & 0xFFFFFFFFu);
    }
    return {count, count};
}

}  // namespace jeat::events::dat
