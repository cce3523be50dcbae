// Compares groups of pixels with the boxes of the step before, for jeat_graph/detection/memory.py.
#pragma once

#include <cmath>
#include <limits>

#include "detection/components.hpp"

namespace jeat::detection {

// Corners (names, 4) of the pixels of each cloud (px; infinities where it has none), and their number (names,).
inline void cloud_extents(const Marked& marked, std::size_t names, double* extents, std::int64_t* sizes) {
    constexpr double INFINITE = std::numeric_limits<double>::infinity();
    for (std::size_t name = 0; name < names; ++name) {
        double* const own = extents + 4 * name;
        own[0] = own[1] = INFINITE;
        own[2] = own[3] = -INFINITE;
    }
    std::fill_n(sizes, names, 0);
    for (std::size_t p = 0; p < marked.size();) {
        const std::size_t first = p;
        p = end_of_run(marked, p);
        const auto name = static_cast<std::size_t>(marked.group[first]);
        const double row = marked.y[first];
        double* const own = extents + 4 * name;
        sizes[name] += static_cast<std::int64_t>(p - first);
        own[0] = std::min<double>(own[0], marked.x[first]);
        own[1] = std::min(own[1], row);
        own[2] = std::max<double>(own[2], marked.x[p - 1] + 1.0);
        own[3] = std::max(own[3], row + 1.0);
    }
}

// Where each row of some pixels begins (rows + 1): a box asks but few pixels, those of its own rows.
inline std::vector<std::size_t> starts_of_rows(const Marked& marked) {
    std::vector<std::size_t> start(marked.size() ? static_cast<std::size_t>(marked.y.back()) + 2 : 1, 0);
    for (std::size_t p = 0; p < marked.size(); ++p) start[static_cast<std::size_t>(marked.y[p]) + 1] = p + 1;
    for (std::size_t row = 1; row < start.size(); ++row) start[row] = std::max(start[row], start[row - 1]);
    return start;
}

// Left, top, width and height (px).
struct Box {
    double left, top, width, height;
};

// Counts, by their middles, the pixels of each cloud in each box and in the one around it (names, K), and those
// of each cloud (names,). All start at 0.
struct Inside {
    std::int64_t *inside, *near, *count;
    std::size_t boxes;
};

// Counts the pixels of one row, from `k` to before `end`, for box `j`.
inline void count_row(const Marked& marked, std::size_t k, std::size_t end, std::size_t j, const Box& box,
                      const Box& around, bool in_rows, const Inside& out) {
    const auto begin = marked.x.begin();
    k = static_cast<std::size_t>(std::lower_bound(begin + static_cast<std::ptrdiff_t>(k),
                                                  begin + static_cast<std::ptrdiff_t>(end), around.left - 1.0) -
                                 begin);
    while (k < end && marked.x[k] + 0.5 - around.left <= around.width) {
        const std::int32_t name = marked.group[k];
        std::int64_t one = 0, other = 0;
        for (; k < end && marked.group[k] == name && marked.x[k] + 0.5 - around.left <= around.width; ++k) {
            const double from_left = marked.x[k] + 0.5 - box.left;
            one += from_left >= 0.0 && from_left <= box.width;
            other += marked.x[k] + 0.5 - around.left >= 0.0;
        }
        const std::size_t at = static_cast<std::size_t>(name) * out.boxes + j;
        out.near[at] += other;
        if (in_rows) out.inside[at] += one;
    }
}

inline void count_inside(const Marked& marked, const Box* boxes, const Box* around, const Inside& out) {
    for (const std::int32_t name : marked.group) ++out.count[name];
    const std::vector<std::size_t> start = starts_of_rows(marked);
    const std::size_t rows = start.size() - 1;
    for (std::size_t j = 0; j < out.boxes; ++j) {
        const Box &box = boxes[j], &large = around[j];
        const double from = std::floor(large.top - 0.5);
        const double most = static_cast<double>(rows);
        auto row = from > 0.0 ? static_cast<std::size_t>(std::min(from, most)) : std::size_t{0};
        for (; row < rows; ++row) {
            const double middle = static_cast<double>(row) + 0.5;
            if (!(middle - large.top <= large.height)) break;
            if (middle < large.top) continue;
            const bool in_rows = middle >= box.top && middle - box.top <= box.height;
            count_row(marked, start[row], start[row + 1], j, box, large, in_rows, out);
        }
    }
}

// Which box each place (N, 2) belongs to: distances in halves of a box, so that 1 is its edge.
inline void nearest_boxes(View2<const double> places, std::span<const Box> boxes, std::int64_t* out) {
    for (std::size_t k = 0; k < places.rows; ++k) {
        double least = std::numeric_limits<double>::infinity();
        out[k] = 0;
        for (std::size_t j = 0; j < boxes.size(); ++j) {
            const auto& [left, top, width, height] = boxes[j];
            const double half_x = std::max(width / 2.0, 1.0), half_y = std::max(height / 2.0, 1.0);
            const double dx = std::abs(places[k][0] - left - width / 2.0) / half_x;
            const double dy = std::abs(places[k][1] - top - height / 2.0) / half_y;
            const double away = std::max(dx, dy);
            if (away < least) {
                least = away;
                out[k] = static_cast<std::int64_t>(j);
            }
        }
    }
}

}  // namespace jeat::detection
