// How far the boxes of a detector are off; the formulas are in filters/sensor_accuracy.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "constants.hpp"
#include "filters/model_constants.hpp"
#include "filters/sensor_offsets.hpp"
#include "math.hpp"

namespace jeat::filters {

inline constexpr std::array<double, 4> kToSides{0.5, 0.5, 0.125, 0.125};

struct AccuracySums {
    std::vector<double> pairs, product;  // (S, S)
    std::vector<double> lasting;         // (S,)

    std::size_t sensors() const { return lasting.size(); }

    void widen(double believed) {
        const std::size_t S = sensors();
        widen_pairs(pairs, 1, S, 1);
        widen_pairs(product, 1, S, 1);
        lasting.push_back(believed);
    }

    void count(std::size_t i, std::size_t j, double of_pair) {
        const std::size_t S = sensors(), at = i * S + j, back = j * S + i;
        pairs[at] += 1.0;
        pairs[back] += 1.0;
        product[at] += of_pair;
        product[back] += of_pair;
    }

    // `given` is what the user says of each, NaN where it is to be learnt.
    void solve(const std::vector<double>& log_side_variance, const std::vector<double>& p_detect,
               const std::vector<double>& given, const ModelConstants& c) {
        const std::size_t S = sensors();
        for (std::size_t i = 0; i < S; ++i) lasting[i] = std::isnan(given[i]) ? 0.0 : given[i];
        const std::vector<double> known = lasting;
        std::vector<std::size_t> learnt;
        for (std::size_t i = 0; i < S; ++i) {
            if (!std::isnan(given[i])) continue;
            if (in_triangle(i, c)) {
                learnt.push_back(i);
                continue;
            }
            double sum = 0.0, number = 0.0;
            for (std::size_t j = 0; j < S; ++j) {
                const double own = std::isnan(given[j]) ? beyond(i, j, log_side_variance, c) * share(p_detect[i], p_detect[j])
                                                        : std::max(both(i, j, c) - known[j], 0.0);
                sum += pairs[i * S + j] * own;
                number += pairs[i * S + j];
            }
            if (number > 0.0) lasting[i] = sum / number;
        }
        std::vector<double> first(S, 0.0);
        for (const std::size_t k : learnt) first[k] = least_squares(k, {}, c) / 2.0;
        for (const std::size_t k : learnt) lasting[k] = first[k];
        for (int sweep = 0; sweep < kSweeps; ++sweep)
            for (const std::size_t k : learnt) lasting[k] = std::max(0.0, least_squares(k, lasting, c));
    }

private:
    double both(std::size_t i, std::size_t j, const ModelConstants& c) const {
        const std::size_t at = i * sensors() + j;
        return std::max(product[at] / (pairs[at] + c.lasting_count), 0.0);
    }
    double beyond(std::size_t i, std::size_t j, const std::vector<double>& log_side_variance,
                  const ModelConstants& c) const {
        const double held = c.error_share * (exp_of(log_side_variance[i]) + exp_of(log_side_variance[j]));
        return std::max(both(i, j, c) - held, 0.0);
    }
    static double share(double p, double other) { return (1.0 - p) / std::max(2.0 - p - other, kLeastShare); }

    bool in_triangle(std::size_t i, const ModelConstants& c) const {
        const std::size_t S = sensors();
        const auto known = [&](std::size_t a, std::size_t b) { return pairs[a * S + b] >= c.lasting_count; };
        for (std::size_t j = 0; j < S; ++j)
            for (std::size_t k = 0; k < S; ++k)
                if (known(i, j) && known(j, k) && known(k, i)) return true;
        return false;
    }

    // What sensor k's differences say of it, the others' V as they are; none: 0.
    double least_squares(std::size_t k, const std::vector<double>& others, const ModelConstants& c) const {
        const std::size_t S = sensors();
        double sum = 0.0, total = 0.0;
        for (std::size_t j = 0; j < S; ++j) {
            const double weight = in_triangle(j, c) ? pairs[k * S + j] : 0.0;
            sum += weight * (both(k, j, c) - (others.empty() ? 0.0 : others[j]));
            total += weight;
        }
        return sum / total;
    }
};

// A difference less its mean, no further off than one counts.
inline std::array<double, 4> clipped(const std::array<double, 4>& d, const std::array<double, 4>& mean,
                                     const ModelConstants& c) {
    std::array<double, 4> out;
    for (std::size_t k = 0; k < 4; ++k) out[k] = clamp(d[k] - mean[k], -c.lasting_clip, c.lasting_clip);
    return out;
}

inline double product_of(const std::array<double, 4>& d, const double* before) {
    double out = 0.0;
    for (std::size_t k = 0; k < 4; ++k) out += d[k] * before[k] * kToSides[k];
    return out;
}

// Variance of one side as the filter takes it: of how many pairs of boxes a sensor was compared by, and its V.
inline double side_noise(double log_side_variance, double compared, double lasting, const ModelConstants& c) {
    const double floor = compared > c.offset_count ? square(c.compared_std) : 0.0;
    return std::max(exp_of(log_side_variance), floor) + c.lasting_boxes * lasting;
}

}  // namespace jeat::filters
