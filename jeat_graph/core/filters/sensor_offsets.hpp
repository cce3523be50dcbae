// What the boxes of two detectors differ by; the formulas are in filters/sensor_offsets.py.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "constants.hpp"
#include "filters/boxes.hpp"
#include "filters/columns.hpp"
#include "filters/model_constants.hpp"
#include "math.hpp"

namespace jeat::filters {

struct OffsetSums {
    std::size_t sensors = 0;
    std::vector<double> weight, total;  // (S, S), (S, S, 4)

    void widen() {
        widen_pairs(weight, 1, sensors, 1);
        widen_pairs(total, 1, sensors, 4);
        ++sensors;
    }

    // By how many pairs of boxes a sensor was compared with the others.
    double compared(std::size_t i) const {
        double sum = 0.0;
        for (std::size_t j = 0; j < sensors; ++j) sum += weight[i * sensors + j];
        return sum;
    }

    // The mean difference of two sensors so far.
    std::array<double, 4> mean(std::size_t i, std::size_t j, const ModelConstants& c) const {
        const std::size_t at = i * sensors + j;
        std::array<double, 4> out;
        for (int k = 0; k < 4; ++k) out[k] = total[at * 4 + k] / (weight[at] + c.offset_count);
        return out;
    }

    void count(std::size_t i, std::size_t j, const std::array<double, 4>& d, const std::array<double, 4>& expected,
               const ModelConstants& c) {
        double far = 0.0;
        for (int k = 0; k < 4; ++k) far = std::max(far, std::abs(d[k] - expected[k]));
        const double share = std::min(1.0, c.offset_clip / std::max(far, kLeastPrecision));
        const std::size_t at = i * sensors + j, back = j * sensors + i;
        weight[at] += share;
        weight[back] += share;
        for (int k = 0; k < 4; ++k) {
            total[at * 4 + k] += share * d[k];
            total[back * 4 + k] -= share * d[k];
        }
    }

    // By how much a sensor's boxes are off the common frame.
    std::array<double, 4> offset(std::size_t i, const std::vector<double>& noise, const ModelConstants& c) const {
        double whole = 0.0;
        std::array<double, 4> out{};
        std::vector<double> precision(sensors, 0.0);
        for (std::size_t j = 0; j < sensors; ++j) {
            precision[j] = compared(j) > 0.0 ? 1.0 / noise[j] : 0.0;
            whole += precision[j];
        }
        for (std::size_t j = 0; j < sensors; ++j) {
            const auto d = mean(i, j, c);
            for (int k = 0; k < 4; ++k) out[k] += d[k] * (precision[j] / std::max(whole, kLeastPrecision));
        }
        return out;
    }
};

inline std::array<double, 4> difference(const Sides& a, const Sides& b, double moved_x, double moved_y) {
    return {((a.left + a.right - b.left - b.right) / 2.0 - moved_x) / std::sqrt(a.width() * b.width()),
            ((a.top + a.bottom - b.top - b.bottom) / 2.0 - moved_y) / std::sqrt(a.height() * b.height()),
            log_of(a.width() / b.width()), log_of(a.height() / b.height())};
}

// What makes a sensor's boxes what they are on the average.
class Correction {
public:
    explicit Correction(const std::array<double, 4>& offset)
        : x_(offset[0]), y_(offset[1]), width_(exp_of(-offset[2])), height_(exp_of(-offset[3])) {}

    Sides corrected(const Sides& box) const {
        const double x = (box.left + box.right) / 2.0 - x_ * box.width();
        const double y = (box.top + box.bottom) / 2.0 - y_ * box.height();
        const double w = box.width() * width_ / 2.0, h = box.height() * height_ / 2.0;
        return {x - w, y - h, x + w, y + h};
    }

private:
    double x_, y_, width_, height_;
};

}  // namespace jeat::filters
