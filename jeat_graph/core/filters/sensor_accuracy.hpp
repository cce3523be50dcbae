// How far the boxes of a detector are off; the formulas are in filters/sensor_accuracy.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "constants.hpp"
#include "filters/model_constants.hpp"
#include "filters/sensor_offsets.hpp"
#include "math.hpp"

namespace jeat::filters {

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
        std::vector<double> both(S * S), weight(S * S);
        const std::vector<std::uint8_t> hat = in_triangles(c);
        for (std::size_t i = 0; i < S; ++i) lasting[i] = std::isnan(given[i]) ? 0.0 : given[i];
        for (std::size_t at = 0; at < S * S; ++at) {
            both[at] = std::max(product[at] / (pairs[at] + c.lasting_count), 0.0);
            weight[at] = hat[at / S] && hat[at % S] ? pairs[at] : 0.0;
        }
        const std::vector<double> known = lasting, none(S, 0.0);
        // What sensor k's differences say of it, with the others' V as they are.
        const auto least_squares = [&](std::size_t k, const std::vector<double>& others) {
            double sum = 0.0, total = 0.0;
            for (std::size_t j = 0; j < S; ++j) {
                sum += weight[k * S + j] * (both[k * S + j] - others[j]);
                total += weight[k * S + j];
            }
            return sum / total;
        };
        std::vector<std::size_t> learnt;
        for (std::size_t i = 0; i < S; ++i) {
            if (!std::isnan(given[i])) continue;
            if (hat[i]) {
                learnt.push_back(i);
                lasting[i] = least_squares(i, none) / 2.0;
                continue;
            }
            double sum = 0.0, number = 0.0;
            for (std::size_t j = 0; j < S; ++j) {
                const double held = c.error_share * (exp_of(log_side_variance[i]) + exp_of(log_side_variance[j]));
                const double beyond = std::max(both[i * S + j] - held, 0.0),
                             rest = std::max(both[i * S + j] - known[j], 0.0);
                sum += pairs[i * S + j] * (std::isnan(given[j]) ? beyond * share(p_detect[i], p_detect[j]) : rest);
                number += pairs[i * S + j];
            }
            if (number > 0.0) lasting[i] = sum / number;
        }
        for (int sweep = 0; sweep < kSweeps; ++sweep)
            for (const std::size_t k : learnt) lasting[k] = std::max(0.0, least_squares(k, lasting));
    }

private:
    static double share(double p, double other) { return (1.0 - p) / std::max(2.0 - p - other, kLeastShare); }

    // Which sensors were compared enough with two others that were compared with each other.
    std::vector<std::uint8_t> in_triangles(const ModelConstants& c) const {
        const std::size_t S = sensors();
        const auto known = [&](std::size_t a, std::size_t b) { return pairs[a * S + b] >= c.lasting_count; };
        std::vector<std::uint8_t> out(S, 0);
        for (std::size_t i = 0; i < S; ++i)
            for (std::size_t j = 0; j < S && !out[i]; ++j)
                for (std::size_t k = 0; k < j && !out[i]; ++k) out[i] = known(i, j) && known(j, k) && known(k, i);
        return out;
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
