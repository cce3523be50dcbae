// Counts of events in bins, for jeat_graph/detection/windows.py.
#pragma once

#include <algorithm>
#include <cstring>

#include "arrays.hpp"
#include "wide.hpp"

namespace jeat::detection {

// The cells (2, H, W) of a bin, darker and brighter, and the total (H, W) of all bins.
struct Bin {
    std::uint8_t *darker, *brighter;
    View2<std::uint16_t> total;
};

inline constexpr std::uint8_t MOST_OF_A_CELL = 255;

// Counts events in a bin and in the total; those outside the picture are left out.
inline void count_events(std::span<const std::uint16_t> x, std::span<const std::uint16_t> y,
                         std::span<const std::uint8_t> polarity, const Bin& bin) {
    const auto [total, height, width] = bin.total;
    for (std::size_t k = 0; k < x.size(); ++k) {
        if (x[k] >= width || y[k] >= height) continue;
        const std::size_t at = y[k] * width + x[k];
        std::uint8_t& cell = (polarity[k] > 0 ? bin.brighter : bin.darker)[at];
        if (cell < MOST_OF_A_CELL) {
            ++cell;
            ++total[at];
        }
    }
}

// Empties all cells of a bin, and takes them off the total.
inline void empty_bin(const Bin& bin) {
    const std::size_t size = bin.total.size();
    std::uint16_t* total = bin.total.data;
    for (std::size_t k = 0; k < size; ++k) {
        total[k] = static_cast<std::uint16_t>(total[k] - bin.darker[k] - bin.brighter[k]);
    }
    std::memset(bin.darker, 0, size);
    std::memset(bin.brighter, 0, size);
}

// Empties the cells of a bin's events, and takes them off the total.
inline void empty_cells(std::span<const std::uint16_t> x, std::span<const std::uint16_t> y, const Bin& bin) {
    const auto [total, height, width] = bin.total;
    for (std::size_t k = 0; k < x.size(); ++k) {
        if (x[k] >= width || y[k] >= height) continue;
        const std::size_t at = y[k] * width + x[k];
        total[at] = static_cast<std::uint16_t>(total[at] - bin.darker[at] - bin.brighter[at]);
        bin.darker[at] = bin.brighter[at] = 0;
    }
}

// A ring (bins, 2, H, W) of cells, and the bins of it that are asked for.
struct Ring {
    const std::uint8_t* cells;
    std::size_t bins, height, width;
    std::span<const std::int64_t> slots;

    std::size_t plane() const { return height * width; }
};

inline void check_ring(const Ring& ring, std::span<const std::int32_t> y, std::span<const std::int32_t> x) {
    for (const std::int64_t slot : ring.slots) {
        if (slot < 0 || static_cast<std::size_t>(slot) >= ring.bins) throw std::out_of_range("no such bin");
    }
    for (std::size_t p = 0; p < x.size(); ++p) {
        if (x[p] < 0 || static_cast<std::size_t>(x[p]) >= ring.width || y[p] < 0 ||
            static_cast<std::size_t>(y[p]) >= ring.height) {
            throw std::out_of_range("a pixel lies outside the picture");
        }
    }
}

// Events of some pixels (P,) in some bins.
inline void events_of_few(const Ring& ring, std::span<const std::int32_t> y, std::span<const std::int32_t> x,
                          std::int32_t* out) {
    for (std::size_t p = 0; p < x.size(); ++p) {
        const std::size_t at = static_cast<std::size_t>(y[p]) * ring.width + static_cast<std::size_t>(x[p]);
        std::int32_t sum = 0;
        for (const std::int64_t slot : ring.slots) {
            const std::uint8_t* cells = ring.cells + 2 * static_cast<std::size_t>(slot) * ring.plane();
            sum += cells[at] + cells[ring.plane() + at];
        }
        out[p] = sum;
    }
}

// Adds the cells of a bin to sums.
JEAT_GRAPH_WIDE static void add_cells(const std::uint8_t* darker, const std::uint8_t* brighter, std::uint16_t* sum,
                                      std::size_t size) {
    for (std::size_t k = 0; k < size; ++k) {
        sum[k] = static_cast<std::uint16_t>(sum[k] + darker[k] + brighter[k]);
    }
}

// The same for many pixels: all of the picture are summed, neighbours in memory at once.
inline void events_of_many(const Ring& ring, std::span<const std::int32_t> y, std::span<const std::int32_t> x,
                           std::int32_t* out) {
    const std::size_t size = ring.plane();
    const auto sums = std::make_unique<std::uint16_t[]>(size);
    std::uint16_t* sum = sums.get();
    constexpr std::size_t AT_ONCE = 1 << 13;  // of which the sums stay in the nearest cache
    for (std::size_t from = 0; from < size; from += AT_ONCE) {
        const std::size_t end = std::min(from + AT_ONCE, size);
        for (const std::int64_t slot : ring.slots) {
            const std::uint8_t* darker = ring.cells + 2 * static_cast<std::size_t>(slot) * size;
            const std::uint8_t* brighter = darker + size;
            add_cells(darker + from, brighter + from, sum + from, end - from);
        }
    }
    for (std::size_t p = 0; p < x.size(); ++p) {
        out[p] = sum[static_cast<std::size_t>(y[p]) * ring.width + static_cast<std::size_t>(x[p])];
    }
}

}  // namespace jeat::detection
