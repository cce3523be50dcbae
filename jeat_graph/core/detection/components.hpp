// Measures groups of marked pixels, for jeat_graph/detection/components.py.
//
// Neighbours in a row are mostly of one group: what is said of such a run is said once, for a number in memory
// that is added to pixel by pixel waits for itself each time.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "arrays.hpp"

namespace jeat::detection {

// Marked pixels, row by row; all four of one length (see `Marked` in the Python file).
struct Marked {
    std::span<const std::int32_t> x, y, group, weight;
    std::size_t size() const { return x.size(); }
};

// Raises ValueError where pixels do not come row by row, or are of no group from 0 to before `groups`.
inline void check_marked(const Marked& marked, std::size_t groups) {
    const auto& [x, y, group, weight] = marked;
    check_lengths({x.size(), y.size(), group.size(), weight.size()});
    std::int32_t column = -1, row = 0;
    bool good = true;
    for (std::size_t p = 0; p < x.size(); ++p) {
        good &= y[p] > row ? x[p] >= 0 : y[p] == row && x[p] > column;
        good &= group[p] >= 0 && static_cast<std::size_t>(group[p]) < groups;
        column = x[p];
        row = y[p];
    }
    check(good, "marked pixels must come row by row, each of a group that there is");
}

// The end of the run from p on: pixels of one group in one row.
inline std::size_t end_of_run(const Marked& marked, std::size_t p) {
    const std::int32_t group = marked.group[p], row = marked.y[p];
    while (p < marked.size() && marked.group[p] == group && marked.y[p] == row) ++p;
    return p;
}

// The sum of the marks of each of the groups (from 1) into `found` (count,).
inline void group_weights(std::size_t count, const Marked& marked, double* found) {
    std::fill_n(found, count, 0.0);
    for (std::size_t p = 0; p < marked.size();) {
        const std::size_t end = end_of_run(marked, p);
        std::int64_t total = 0;
        for (std::size_t k = p; k < end; ++k) total += marked.weight[k];
        if (marked.group[p] > 0) found[marked.group[p] - 1] += static_cast<double>(total);
        p = end;
    }
}

// Left, top, right and bottom of pixels (px).
using Corners = std::array<std::int64_t, 4>;

// Corners (count) of all pixels of each group, those with no weight too; zeros where there is none.
inline std::vector<Corners> extents_of(std::size_t count, const Marked& marked) {
    std::vector<Corners> extents(count, Corners{});
    for (std::size_t p = 0; p < marked.size();) {
        const std::size_t first = p;
        p = end_of_run(marked, p);
        if (marked.group[first] == 0) continue;
        auto& [left, top, right, bottom] = extents[static_cast<std::size_t>(marked.group[first]) - 1];
        const std::int64_t row = marked.y[first];
        if (bottom == 0) {  // its first row
            left = marked.x[first];
            top = row;
        }
        left = std::min<std::int64_t>(left, marked.x[first]);
        right = std::max<std::int64_t>(right, std::int64_t{marked.x[p - 1]} + 1);
        bottom = row + 1;
    }
    return extents;
}

// First and last of some columns or rows that hold this share of what the fullest holds, and anything.
inline std::pair<std::int64_t, std::int64_t> full_enough(std::span<const std::int32_t> filled, double share) {
    const double least = std::max(share * *std::max_element(filled.begin(), filled.end()), 1.0);
    std::size_t first = 0, last = filled.size() - 1;
    while (filled[first] < least) ++first;
    while (filled[last] < least) --last;
    return {static_cast<std::int64_t>(first), static_cast<std::int64_t>(last)};
}

// What is measured of `count` groups: corners (count, 4), sums and numbers (count,) of their marked pixels.
struct Measured {
    explicit Measured(std::size_t count) : corners(4 * count), weight(count), pixels(count) {}
    Buffer<std::int64_t> corners;
    Buffer<double> weight;
    Buffer<std::int64_t> pixels;
};

// How many marked pixels each column and row of a group has says where its box begins and ends, with thin ends
// (`share` = 0) and without.
inline Measured measure_groups(std::size_t count, const Marked& marked, double share) {
    const std::vector<Corners> extents = extents_of(count, marked);
    // Where the columns and the rows of each group begin in the arrays of all.
    std::vector<std::array<std::size_t, 2>> start(count + 1, {0, 0});
    for (std::size_t k = 0; k < count; ++k) {
        const auto& [left, top, right, bottom] = extents[k];
        start[k + 1] = {start[k][0] + static_cast<std::size_t>(right - left),
                        start[k][1] + static_cast<std::size_t>(bottom - top)};
    }
    std::vector<std::int32_t> columns(start[count][0]), rows(start[count][1]);
    Measured found(count);
    std::fill_n(found.weight.data.get(), count, 0.0);
    std::fill_n(found.pixels.data.get(), count, 0);
    std::fill_n(found.corners.data.get(), 4 * count, 0);
    for (std::size_t p = 0; p < marked.size();) {
        const std::size_t first = p;
        p = end_of_run(marked, p);
        if (marked.group[first] == 0) continue;
        const auto k = static_cast<std::size_t>(marked.group[first]) - 1;
        std::int32_t* const own = columns.data() + start[k][0];
        std::int64_t total = 0;
        std::int32_t number = 0;
        for (std::size_t j = first; j < p; ++j) {
            const std::int32_t on = marked.weight[j] > 0;
            own[marked.x[j] - extents[k][0]] += on;
            number += on;
            total += marked.weight[j];
        }
        rows[start[k][1] + static_cast<std::size_t>(marked.y[first] - extents[k][1])] += number;
        found.weight[k] += static_cast<double>(total);
        found.pixels[k] += number;
    }
    for (std::size_t k = 0; k < count; ++k) {
        if (found.pixels[k] == 0) continue;
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const auto& filled = axis == 0 ? columns : rows;
            const std::size_t from = start[k][axis], end = start[k + 1][axis];
            const auto [low, high] = full_enough(std::span(filled).subspan(from, end - from), share);
            found.corners[4 * k + axis] = extents[k][axis] + low;
            found.corners[4 * k + axis + 2] = extents[k][axis] + high + 1;
        }
    }
    return found;
}

}  // namespace jeat::detection
