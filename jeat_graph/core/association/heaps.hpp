// Which boxes of a scan count where far too many lie on one spot; the rule is in association/heaps.py.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <span>
#include <unordered_map>
#include <vector>

#include "filters/boxes.hpp"
#include "interruption.hpp"

namespace jeat::association {

using filters::Sides;

// Boxes by their size and place: which of them may touch another one, without a look at the rest. Those whose longer
// side lies between two powers of 2 are in one grid, whose cells are as wide as any of them.
class BoxGrid {
public:
    void add(const Sides& box) {
        const int exponent = exponent_of(box);
        Class& one = classes_[exponent];
        one.all.push_back(box);
        const double cell = std::ldexp(2.0, exponent);
        one.cells[key(cell_of(box.left, cell), cell_of(box.top, cell))].push_back(box);
    }
    // Call visit(box) for every box that may touch another one, until it returns false.
    template <class Visit> void near(const Sides& box, Visit visit) const {
        for (const auto& [exponent, one] : classes_) {
            const double cell = std::ldexp(2.0, exponent);
            const std::int64_t left = cell_of(box.left - cell, cell), right = cell_of(box.right, cell);
            const std::int64_t top = cell_of(box.top - cell, cell), bottom = cell_of(box.bottom, cell);
            const double cells = static_cast<double>(right - left + 1) * static_cast<double>(bottom - top + 1);
            if (cells > static_cast<double>(one.all.size())) {
                if (!visit_all(one.all, visit)) return;
                continue;
            }
            for (std::int64_t x = left; x <= right; ++x)
                for (std::int64_t y = top; y <= bottom; ++y) {
                    const auto found = one.cells.find(key(x, y));
                    if (found != one.cells.end() && !visit_all(found->second, visit)) return;
                }
        }
    }

private:
    struct Class {
        std::vector<Sides> all;
        std::unordered_map<std::uint64_t, std::vector<Sides>> cells;
    };

    static int exponent_of(const Sides& box) {
        const double side = std::max(box.width(), box.height());
        return side > 0.0 ? std::clamp(std::ilogb(side), -30, 30) : -30;
    }
    static std::int64_t cell_of(double place, double cell) {
        return static_cast<std::int64_t>(std::clamp(std::floor(place / cell), -4e18, 4e18));
    }
    // Cells that share a key are visited together, which costs time alone.
    static std::uint64_t key(std::int64_t x, std::int64_t y) {
        return static_cast<std::uint64_t>(x) * 0x9e3779b97f4a7c15ULL + static_cast<std::uint64_t>(y);
    }
    template <class Visit> static bool visit_all(const std::vector<Sides>& boxes, Visit& visit) {
        for (const Sides& box : boxes)
            if (!visit(box)) return false;
        return true;
    }

    std::map<int, Class> classes_;
};

// Whether any box touches so many others. No ordinary scan has one, and it costs less to see that than to choose.
inline bool any_touches(std::span<const Sides> boxes, double number) {
    const filters::ByLeft index(boxes);
    for (const Sides& box : boxes) {
        double touching = -1.0;  // itself
        index.near(box, [&](std::size_t, const Sides& other) { touching += filters::intersection(box, other) > 0.0; });
        if (touching >= number) return true;
    }
    return false;
}
// With more boxes than this, all of them in one column of the picture, that costs more.
inline constexpr std::size_t kMostAtOnce = 2048;

// Places of the boxes that count, ascending.
inline std::vector<std::int64_t> kept_boxes(std::span<const Sides> boxes, std::span<const double> scores,
                                            double most_on_one_spot, double spot_overlap, double most_touching) {
    std::vector<std::int64_t> order(boxes.size()), out;
    std::iota(order.begin(), order.end(), std::int64_t{0});
    if (boxes.size() <= kMostAtOnce && spot_overlap > 0.0 &&
        !any_touches(boxes, std::min(most_on_one_spot, most_touching)))
        return order;
    const auto score = [&](std::int64_t k) { return scores[static_cast<std::size_t>(k)]; };
    std::stable_sort(order.begin(), order.end(), [&](std::int64_t a, std::int64_t b) { return score(a) > score(b); });
    BoxGrid kept;
    for (const std::int64_t k : order) {
        may_be_interrupted();
        const Sides& box = boxes[static_cast<std::size_t>(k)];
        double on_it = 0.0, touching = 0.0;
        kept.near(box, [&](const Sides& better) {
            const double overlap = filters::intersection_over_union(box, better);
            touching += overlap > 0.0;
            on_it += overlap >= spot_overlap;
            return on_it < most_on_one_spot && touching < most_touching;
        });
        if (on_it >= most_on_one_spot || touching >= most_touching) continue;
        kept.add(box);
        out.push_back(k);
    }
    std::sort(out.begin(), out.end());
    return out;
}

}  // namespace jeat::association
