// Boxes as left, top, right, bottom.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "constants.hpp"
#include "filters/singer.hpp"

namespace jeat::filters {

struct Sides {
    double left, top, right, bottom;

    double width() const { return right - left; }
    double height() const { return bottom - top; }
    double area() const { return width() * height(); }
};

inline double intersection(const Sides& a, const Sides& b) {
    const double w = std::min(a.right, b.right) - std::max(a.left, b.left);
    const double h = std::min(a.bottom, b.bottom) - std::max(a.top, b.top);
    return w > 0.0 && h > 0.0 ? w * h : 0.0;
}

inline double intersection_over_union(const Sides& a, const Sides& b) {
    const double common = intersection(a, b);
    return common / std::max(a.area() + b.area() - common, kLeastArea);
}

// The box of a state, whose width and height may be known already.
inline Sides corners(const double* mean, double w, double h) {
    const double x = mean[kPosition], y = mean[kStates + kPosition];
    return {x - w / 2.0, y - h / 2.0, x + w / 2.0, y + h / 2.0};
}
inline Sides corners(const double* mean) {
    return corners(mean, exp_of(mean[kLogSize]), exp_of(mean[kStates + kLogSize]));
}

// The box that a detector is expected to give: with the error that lasts.
inline Sides expected_corners(const double* mean, double w, double h) {
    const double x = mean[kPosition] + mean[kPositionError],
                 y = mean[kStates + kPosition] + mean[kStates + kPositionError];
    return {x - w / 2.0, y - h / 2.0, x + w / 2.0, y + h / 2.0};
}

inline double expected_log_size(const double* mean, int axis) {
    return mean[axis * kStates + kLogSize] + mean[axis * kStates + kSizeError];
}
inline Sides expected_corners(const double* mean) {
    return expected_corners(mean, exp_of(expected_log_size(mean, 0)), exp_of(expected_log_size(mean, 1)));
}

// Boxes by their left sides: which of them may reach into an interval, without a look at the rest. Where there are
// many they are also kept by width, each class twice as wide as the one before: one wide box among many narrow ones
// is no reason to look at all of them. A box that lies nowhere (NaN) is near none.
class ByLeft {
public:
    explicit ByLeft(std::span<const Sides> boxes) {
        std::vector<std::pair<double, std::size_t>> order;
        order.reserve(boxes.size());
        for (std::size_t k = 0; k < boxes.size(); ++k) {
            if (std::isnan(boxes[k].left)) continue;
            order.emplace_back(boxes[k].left, k);
            widest_ = std::max(widest_, boxes[k].width());
        }
        std::sort(order.begin(), order.end());
        entries_.reserve(order.size());
        for (const auto& [left, k] : order) entries_.push_back({boxes[k], k});
        if (entries_.size() > kFewBoxes) sort_by_width();
    }
    // Call visit(k, box) for every box whose left side lies in [low, high].
    template <class Visit> void with_left_in(double low, double high, Visit visit) const {
        visit_between(entries_, low, high, visit);
    }
    // Call visit(k, box) for every box that may overlap another one.
    template <class Visit> void near(const Sides& box, Visit visit) const {
        const auto visit_beside = [&](std::size_t k, const Sides& other) {
            if (other.top < box.bottom && other.bottom > box.top) visit(k, other);
        };
        if (classes_.empty()) return visit_between(entries_, box.left - widest_, box.right, visit_beside);
        for (const Class& one : classes_) visit_between(one.entries, box.left - one.widest, box.right, visit_beside);
    }

private:
    static constexpr std::size_t kFewBoxes = 256;
    // Boxes lie here in their order, so that a visit reads memory from front to back.
    struct Entry {
        Sides box;
        std::size_t k;
    };
    struct Class {
        int exponent;
        double widest = 0.0;
        std::vector<Entry> entries{};
    };

    void sort_by_width() {
        for (const Entry& entry : entries_) {
            const double width = entry.box.width();
            const int exponent = width > 0.0 ? std::ilogb(width) : std::numeric_limits<int>::min();
            auto at = std::find_if(classes_.begin(), classes_.end(),
                                   [&](const Class& one) { return one.exponent == exponent; });
            if (at == classes_.end()) at = classes_.insert(at, Class{exponent});
            at->widest = std::max(at->widest, width);
            at->entries.push_back(entry);
        }
    }
    template <class Visit>
    static void visit_between(const std::vector<Entry>& entries, double low, double high, Visit& visit) {
        auto at = std::lower_bound(entries.begin(), entries.end(), low,
                                   [](const Entry& entry, double value) { return entry.box.left < value; });
        for (; at != entries.end() && at->box.left <= high; ++at) visit(at->k, at->box);
    }

    std::vector<Entry> entries_;
    std::vector<Class> classes_;
    double widest_ = 0.0;
};

}  // namespace jeat::filters
