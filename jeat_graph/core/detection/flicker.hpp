// Events of lamps that flicker with the mains: pixels that grow brighter again and again after one period.
// Its Python twin, for tests, is in tests/detection/test_flicker.py.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "arrays.hpp"
#include "detection/noise.hpp"

namespace jeat::detection {

// What is a flicker: shortest and longest period, and after how long a pixel starts over (µs); after so many
// periods it flickers.
struct FlickerRule {
    std::int64_t shortest_us, longest_us, forgotten_us;
    int least;
};

// Unmarks the events of pixels that flicker. `rise` holds when each pixel (H, W) last turned from darker to
// brighter (µs), `state` twice the number of periods that it has kept, and whether it was brighter last.
inline void leave_flicker(std::span<const std::int64_t> t, const Places& places, std::span<const std::uint8_t> polarity,
                          View2<std::int64_t> rise, View2<std::uint8_t> state, const FlickerRule& rule,
                          std::span<bool> good) {
    const int most = 2 * rule.least;
    for (std::size_t k = 0; k < t.size(); ++k) {
        const std::size_t column = places.x[k], row = places.y[k];
        if (column >= rise.columns || row >= rise.rows) continue;
        std::int64_t& last = rise[row][column];
        std::uint8_t& here = state[row][column];
        const bool brighter = polarity[k] != 0, was_brighter = here & 1;
        int kept = here >> 1;
        const std::int64_t since = t[k] - last;
        if (since > rule.forgotten_us) kept = 0;
        if (brighter && !was_brighter && since >= rule.shortest_us / 4) {  // what comes sooner is noise
            // Longer than a period: one was missed, or it is none; a missed one says nothing against it.
            if (since < rule.shortest_us || since > 3 * rule.longest_us)
                kept = std::max(kept - 1, 0);
            else if (since <= rule.longest_us)
                kept = std::min(kept + 1, most);
            last = t[k];
        }
        here = static_cast<std::uint8_t>(2 * kept + brighter);
        if (kept >= rule.least) good[k] = false;
    }
}

}  // namespace jeat::detection
