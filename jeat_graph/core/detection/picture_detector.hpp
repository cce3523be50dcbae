// Compares pictures with their background, for jeat_graph/detection/picture_detector.py.
#pragma once

#include <array>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <vector>

#include "arrays.hpp"
#include "wide.hpp"

namespace jeat::detection {

// The brightness of a picture is judged by every so manieth pixel along rows and columns.
inline constexpr std::size_t STRIDE = 4;
inline constexpr std::int32_t GREY = 255;
// How many pixels differ by -GREY to GREY.
using Histogram = std::array<std::int64_t, 2 * GREY + 1>;

// Median (pixels,) of pictures (N, pixels), and the median of the deviations from it.
inline void middle_and_spread(View2<const std::uint8_t> pictures, double* middle, float* spread) {
    const auto count = static_cast<std::int64_t>(pictures.rows);
    const std::int64_t low = (count - 1) / 2, high = count / 2;
    constexpr std::int32_t NONE = std::numeric_limits<std::int32_t>::max();
    std::vector<std::int32_t> sorted(pictures.rows);
    std::int32_t* const values = sorted.data();
    for (std::size_t pixel = 0; pixel < pictures.columns; ++pixel) {
        // Few values: each is put where it belongs among those before.
        const std::uint8_t* own = pictures.data + pixel;
        for (std::int64_t n = 0; n < count; ++n, own += pictures.columns) {
            const std::int32_t value = *own;
            std::int64_t k = n;
            for (; k > 0 && values[k - 1] > value; --k) values[k] = values[k - 1];
            values[k] = value;
        }
        const std::int32_t twice = values[low] + values[high];
        // The deviations are in order from the middle outwards: the nearer of the two ends comes next.
        std::int64_t left = low, right = low + 1;
        std::int32_t one = 0, other = 0;
        for (std::int64_t k = 0; k <= high; ++k) {
            const std::int32_t to_left = left >= 0 ? twice - 2 * values[left] : NONE;
            const std::int32_t to_right = right < count ? 2 * values[right] - twice : NONE;
            one = other;
            other = std::min(to_left, to_right);
            const bool leftwards = to_left <= to_right;
            left -= leftwards;
            right += !leftwards;
        }
        middle[pixel] = twice / 2.0;
        spread[pixel] = static_cast<float>(count % 2 == 0 ? (one + other) / 4.0 : other / 2.0);
    }
}

// Median of whole numbers from 0, of which there are so many each, and at least one in all.
inline double median(const Histogram& number) {
    const std::int64_t count = std::accumulate(number.begin(), number.end(), std::int64_t{0});
    std::int64_t low = -1, passed = 0;
    for (std::size_t k = 0; k < number.size(); ++k) {
        passed += number[k];
        if (low < 0 && passed > (count - 1) / 2) low = static_cast<std::int64_t>(k);
        if (passed > count / 2) return static_cast<double>(low + static_cast<std::int64_t>(k)) / 2.0;
    }
    throw std::invalid_argument("a median of nothing");
}

// Median difference of a picture from the background, without its fraction, and the median deviation from it.
inline std::pair<std::int64_t, double> usual_difference(View2<const std::uint8_t> grey,
                                                        View2<const std::uint8_t> background) {
    Histogram number{}, apart{};
    for (std::size_t row = 0; row < grey.rows; row += STRIDE) {
        for (std::size_t column = 0; column < grey.columns; column += STRIDE) {
            ++number[static_cast<std::size_t>(GREY + grey[row][column] - background[row][column])];
        }
    }
    // Without its fraction: towards zero, as before the shift of the numbers to those from 0.
    const auto brighter = static_cast<std::int64_t>(median(number) - GREY);
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(number.size()); ++k) {
        const auto away = static_cast<std::size_t>(std::abs(k - GREY - brighter));
        // Of the numbers that no picture has, which lie farthest from a median at an end, there are none.
        if (away < apart.size()) apart[away] += number[static_cast<std::size_t>(k)];
    }
    return {brighter, median(apart)};
}

// Marks the pixels that differ by more than both limits; returns how many do.
JEAT_GRAPH_WIDE static std::int64_t mark_different(std::span<const std::uint8_t> grey,
                                                   std::span<const std::uint8_t> background, std::int32_t brighter,
                                                   std::int32_t limit, std::span<const std::int16_t> limits,
                                                   std::uint8_t* marks) {
    std::int64_t number = 0;
    // In parts whose number fits into 32 bits of a register of several.
    constexpr std::size_t PART = 1 << 14;
    for (std::size_t from = 0; from < grey.size(); from += PART) {
        const std::size_t end = std::min(from + PART, grey.size());
        std::int32_t in_part = 0;
        for (std::size_t k = from; k < end; ++k) {
            const std::int32_t difference = std::abs(std::int32_t{grey[k]} - std::int32_t{background[k]} - brighter);
            const bool marked = difference > std::max(std::int32_t{limits[k]}, limit);
            marks[k] = marked;
            in_part += marked;
        }
        number += in_part;
    }
    return number;
}

}  // namespace jeat::detection
