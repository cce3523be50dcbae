// The words of EVT 3.0 that stand for up to twelve events of a row, a bit each.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "events/decoding.hpp"

namespace jeat::events::evt3 {

// Which columns the bits of a byte stand for, in order, and how many they are: without a branch for each bit.
struct ColumnsOfBits {
    std::array<std::array<std::uint16_t, 8>, 256> column{};
    std::array<std::uint8_t, 256> count{};

    constexpr ColumnsOfBits() {
        for (unsigned bits = 0; bits < 256; ++bits) {
            for (unsigned k = 0; k < 8; ++k) {
                if (bits >> k & 1) column[bits][count[bits]++] = static_cast<std::uint16_t>(k);
            }
        }
    }
};
inline constexpr ColumnsOfBits COLUMNS_OF_BITS;

// Writes eight rows, of which as many count as there are bits: the caller has seen to the room.
inline std::size_t put_eight(const Columns& out, std::size_t n, unsigned bits, std::int64_t time, std::int64_t first,
                             std::int64_t row, std::int64_t polarity) {
    const auto& columns = COLUMNS_OF_BITS.column[bits];
    std::int64_t* t = out.t.data() + n;
    std::uint16_t *x = out.x.data() + n, *y = out.y.data() + n;
    std::uint8_t* p = out.p.data() + n;
    const auto from = static_cast<std::uint16_t>(first), line = static_cast<std::uint16_t>(row);
    const auto sign = static_cast<std::uint8_t>(polarity);
    std::array<std::uint16_t, 8> place;
    for (int k = 0; k < 8; ++k) place[k] = static_cast<std::uint16_t>(from + columns[k]);
    for (int k = 0; k < 8; ++k) t[k] = time;
    for (int k = 0; k < 8; ++k) x[k] = place[k];
    for (int k = 0; k < 8; ++k) y[k] = line;
    for (int k = 0; k < 8; ++k) p[k] = sign;
    return n + COLUMNS_OF_BITS.count[bits];
}

// Writes those events of a group that lie in the picture, and returns the next row.
inline std::size_t put_inside(const Columns& out, std::size_t n, unsigned bits, std::int64_t t, std::int64_t first,
                              std::int64_t row, std::int64_t polarity, const Limits& limits) {
    for (; bits != 0; bits &= bits - 1) {
        const std::int64_t x = first + std::countr_zero(bits);
        if (x < limits.width && row < limits.height) put_event(out, n++, t, x, row, polarity);
    }
    return n;
}

}  // namespace jeat::events::evt3
