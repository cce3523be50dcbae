// Boxes as left, top, right, bottom.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "filters/singer.hpp"

namespace jeat::filters {

struct Sides {
    double left, top, right, bottom;

    double width() const { return right - left; }
    double height() const { return bottom - top; }
    double area() const { return width() * height(); }
};

inline constexpr double kLeastArea = 1e-9;

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
inline Sides expected_corners(const double* mean) {
    const double w = exp_of(mean[kLogSize] + mean[kSizeError]);
    const double h = exp_of(mean[kStates + kLogSize] + mean[kStates + kSizeError]);
    const double x = mean[kPosition] + mean[kPositionError], y = mean[kStates + kPosition] + mean[kStates + kPositionError];
    return {x - w / 2.0, y - h / 2.0, x + w / 2.0, y + h / 2.0};
}

// Boxes by their left sides: which of them may reach into an interval, without a look at the rest.
class ByLeft {
public:
    explicit ByLeft(const std::vector<Sides>& boxes) : boxes_(boxes), order_(boxes.size()) {
        for (std::size_t k = 0; k < boxes.size(); ++k) order_[k] = k;
        std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
            return boxes[a].left != boxes[b].left ? boxes[a].left < boxes[b].left : a < b;
        });
        for (const Sides& box : boxes) widest_ = std::max(widest_, box.width());
    }
    // Call visit(k) for every box whose left side lies in [low, high].
    template <class Visit> void with_left_in(double low, double high, Visit visit) const {
        auto at = std::lower_bound(order_.begin(), order_.end(), low,
                                   [&](std::size_t k, double value) { return boxes_[k].left < value; });
        for (; at != order_.end() && boxes_[*at].left <= high; ++at) visit(*at);
    }
    // Call visit(k) for every box that may overlap another one.
    template <class Visit> void near(const Sides& box, Visit visit) const {
        with_left_in(box.left - widest_, box.right, visit);
    }

private:
    const std::vector<Sides>& boxes_;
    std::vector<std::size_t> order_;
    double widest_ = 0.0;
};

}  // namespace jeat::filters
