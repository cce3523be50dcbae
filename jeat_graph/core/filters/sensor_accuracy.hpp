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

inline constexpr std::size_t kCompared = 5;  // differences of two sensors (4), and the sum of both aspects
// Sums over both times of a pair of u, u², e, e²; of e e', and of (e u' + e' u) / 2.
enum AspectSum : std::size_t { kSum, kSumSquare, kDifference, kDifferenceSquare, kLasting, kLeaning, kAspectSums };
using Compared = std::array<double, kCompared>;

// Whether a sum has the other sign seen from the other sensor.
inline bool changes_sign(std::size_t sum) { return sum == kDifference || sum == kLeaning; }

struct AccuracySums {
    std::vector<double> pairs, product;  // (S, S)
    std::vector<double> aspect;          // (S, S, kAspectSums), row less column
    std::vector<double> lasting;         // (S,)

    std::size_t sensors() const { return lasting.size(); }

    void widen(double believed) {
        const std::size_t S = sensors();
        widen_pairs(pairs, 1, S, 1);
        widen_pairs(product, 1, S, 1);
        widen_pairs(aspect, 1, S, kAspectSums);
        lasting.push_back(believed);
    }

    // How two sensors compare on a track now, and how they did before.
    void count(std::size_t i, std::size_t j, const Compared& now, const double* before) {
        const std::size_t S = sensors(), at = i * S + j, back = j * S + i;
        double of_pair = 0.0;
        for (std::size_t k = 0; k < 4; ++k) of_pair += now[k] * before[k] * kToSides[k];
        const double u = now[4], before_u = before[4], e = now[2] - now[3], before_e = before[2] - before[3];
        double new_sums[kAspectSums];
        new_sums[kSum] = u + before_u;
        new_sums[kSumSquare] = u * u + before_u * before_u;
        new_sums[kDifference] = e + before_e;
        new_sums[kDifferenceSquare] = e * e + before_e * before_e;
        new_sums[kLasting] = e * before_e;
        new_sums[kLeaning] = (e * before_u + before_e * u) / 2.0;
        for (const std::size_t one : {at, back}) {
            pairs[one] += 1.0;
            product[one] += of_pair;
            for (std::size_t k = 0; k < kAspectSums; ++k)
                aspect[one * kAspectSums + k] += one == back && changes_sign(k) ? -new_sums[k] : new_sums[k];
        }
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
                sum += pairs[i * S + j] * (std::isnan(given[j]) ? beyond * share(i, j, p_detect, c) : rest);
                number += pairs[i * S + j];
            }
            if (number > 0.0) lasting[i] = sum / number;
        }
        for (int sweep = 0; sweep < kSweeps; ++sweep)
            for (const std::size_t k : learnt) lasting[k] = std::max(0.0, least_squares(k, lasting));
    }

private:
    // Which share of what lasts between two sensors is the first one's.
    double share(std::size_t i, std::size_t j, const std::vector<double>& p_detect, const ModelConstants& c) const {
        const std::size_t at = i * sensors() + j;
        const double* const sums = aspect.data() + at * kAspectSums;
        const double number = std::max(pairs[at], 1.0);
        const double u = sums[kSum] / number / 2.0, e = sums[kDifference] / number / 2.0;
        const double var_u = sums[kSumSquare] / number / 2.0 - square(u);
        const double var_e = sums[kDifferenceSquare] / number / 2.0 - square(e);
        const double apart = std::max(sums[kLasting] / number - square(e), 0.0);
        const double leaning = sums[kLeaning] / number - e * u;
        const double missed = 1.0 - p_detect[i], other = 1.0 - p_detect[j];
        const double prior = (missed - other) / std::max(missed + other, kLeastShare);
        const double per_square = pairs[at] / c.aspect_pairs / std::max(var_u * var_e, kLeastShare);
        const double precise = 1.0 / square(c.aspect_prior);
        const double delta = (prior * precise + per_square * apart * leaning) / (precise + per_square * square(apart));
        return 0.5 + 0.5 * clamp(delta, -1.0, 1.0);
    }

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

// The sum of ln(w/h) of both sensors' boxes.
inline double aspect_sum(const Sides& box, const Sides& other, const ModelConstants& c) {
    const double one = log_of((box.right - box.left) / (box.bottom - box.top));
    const double two = log_of((other.right - other.left) / (other.bottom - other.top));
    return clamp(one + two, -c.aspect_clip, c.aspect_clip);
}

// Variance of one side as the filter takes it: of how many pairs of boxes a sensor was compared by, and its V.
inline double side_noise(double log_side_variance, double compared, double lasting, const ModelConstants& c) {
    const double floor = compared > c.offset_count ? square(c.compared_std) : 0.0;
    return std::max(exp_of(log_side_variance), floor) + c.lasting_boxes * lasting;
}

}  // namespace jeat::filters
