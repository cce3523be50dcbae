// At which score a sensor's box is as likely real as not; the formulas are in filters/score_calibration.py.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "association/assignment.hpp"
#include "constants.hpp"
#include "filters/boxes.hpp"
#include "filters/model_constants.hpp"

namespace jeat::filters {

// Sums over pairs of numbers, for their correlation; the formulas are in filters/score_calibration.py.
struct PairSums {
    double pairs = 0.0, first = 0.0, second = 0.0, first_squared = 0.0, second_squared = 0.0, product = 0.0;

    void add(double x, double y) {
        pairs += 1.0;
        first += x;
        second += y;
        first_squared += x * x;
        second_squared += y * y;
        product += x * y;
    }

    double first_variance() const { return pairs > 0.0 ? first_squared / pairs - square(first / pairs) : 0.0; }
    double second_variance() const { return pairs > 0.0 ? second_squared / pairs - square(second / pairs) : 0.0; }

    // Logarithm of how much likelier they are if they have to do with each other than if not.
    double log_factor(const ModelConstants& c) const {
        const double one = first_variance(), other = second_variance();
        if (!(std::min(one, other) > kLeastVariance)) return 0.0;
        const double covariance = product / pairs - first * second / (pairs * pairs);
        const double r = clamp(covariance / std::sqrt(one * other), 0.0, kMostCorrelation);
        const double x = 0.5 * (log1p_of(r) - log1p_of(-r));
        const double without = 1.0 / pairs + square(c.no_meaning_std), with = 1.0 / pairs + 1.0;
        return 0.5 * (log_of(without / with) + x * x * (1.0 / without - 1.0 / with));
    }
};

struct RepeatCounts {
    std::array<double, kScoreBins> boxes{}, repeated{};
    PairSums persistence, recurrence;  // logits of boxes that come again; logits, and whether the box comes again
    std::int64_t scans = 0;
    std::vector<Sides> last_boxes;
    std::vector<double> last_logits;
    std::vector<std::uint8_t> last_had_before;
    bool has_last = false;

    // `assignment` is room to work in.
    void count(const std::vector<Sides>& now, const std::vector<double>& new_logits,
               association::Assignment& assignment, const ModelConstants& c) {
        std::vector<std::uint8_t> had_before(now.size(), 0), has_after(last_boxes.size(), 0);
        if (has_last && !now.empty() && !last_boxes.empty()) {
            const ByLeft index(now);
            std::vector<association::Pair> pairs;
            for (std::size_t i = 0; i < last_boxes.size(); ++i)
                index.near(last_boxes[i], [&](std::size_t j, const Sides& box) {
                    const double overlap = intersection_over_union(last_boxes[i], box);
                    if (overlap >= c.repeat_overlap) pairs.push_back({i, j, overlap});
                });
            for (const std::size_t k : assignment.solve(pairs, last_boxes.size(), now.size(), c.exact_assignment)) {
                const auto& [i, j, overlap] = pairs[k];
                has_after[i] = had_before[j] = 1;
                persistence.add(last_logits[i], new_logits[j]);
            }
        }
        for (std::size_t i = 0; i < last_boxes.size() && !now.empty(); ++i)
            recurrence.add(last_logits[i], has_after[i] ? 1.0 : 0.0);
        if (has_last && scans > 1) {
            for (std::size_t i = 0; i < last_boxes.size(); ++i) {
                const bool again = has_after[i] && last_had_before[i];
                spread(last_logits[i], again);
            }
        }
        scans += 1;
        last_boxes = now;
        last_logits = new_logits;
        last_had_before = std::move(had_before);
        has_last = true;
    }

    // Count a box in the bins around its logit, by a normal density: from the nearest one outwards each follows from
    // the one before by a ratio that itself falls by a constant factor.
    void spread(double logit, bool again) {
        constexpr double kStep = kLogitStep / kBandwidth, kFarthest = 8.0;  // beyond is less than 1e-13 of the whole
        const double place = clamp((logit - kFirstLogit) / kLogitStep, 0.0, kScoreBins - 1.0);
        const int nearest = static_cast<int>(nearest_whole(place));
        const double distance = (kFirstLogit + nearest * kLogitStep - logit) / kBandwidth;
        if (std::abs(distance) > kFarthest) return;
        const double most = exp_of(-0.5 * distance * distance) * (kStep / std::sqrt(2.0 * kPi));
        const double falls = exp_of(-kStep * kStep);
        const auto count = [&](int bin, double share) {
            boxes[bin] += share;
            if (again) repeated[bin] += share;
        };
        count(nearest, most);
        for (const int way : {-1, 1}) {
            double share = most, ratio = exp_of(-kStep * (way * distance + 0.5 * kStep));
            for (int bin = nearest + way; bin >= 0 && bin < kScoreBins; bin += way) {
                share *= ratio;
                ratio *= falls;
                if (std::abs(distance + way * kStep * std::abs(bin - nearest)) > kFarthest) break;
                count(bin, share);
            }
        }
    }

    // Probability that a box's score says something of what the box is of; 1 before anything is counted.
    double meaning(const ModelConstants& c) const {
        const double spread =
            std::sqrt(std::max(persistence.first_variance(), 0.0) * std::max(persistence.second_variance(), 0.0));
        const double odds = log_of(c.no_meaning_share / (1.0 - c.no_meaning_share)) - persistence.log_factor(c) -
                            std::max(recurrence.log_factor(c), 0.0);
        return 1.0 - expit(odds) * std::min(1.0, spread / square(c.agreed_std));
    }

    double half_as_many(const ModelConstants& c) const {
        double total = 0.0;
        for (const double b : boxes) total += b;
        if (total <= 0.0) return 0.0;
        double above = 0.0, best = 0.0, best_repeated = 0.0;
        for (int g = kScoreBins - 1; g >= 0; --g) {
            above += boxes[g];
            if (g < kScoreBins - 1 && above > c.best_share * total) break;
            best += boxes[g];
            best_repeated += repeated[g];
        }
        const double top = (best_repeated + kBestCount * c.repeat_share) / (best + kBestCount);
        for (int g = kScoreBins - 1; g >= 0; --g) {
            const double trusted = boxes[g] * std::min(1.0, square(top / c.repeat_trusted));
            const double share =
                (trusted * repeated[g] / (boxes[g] * top + kLeastBoxes) + c.repeat_count * c.repeat_share) /
                (trusted + c.repeat_count);
            if (share < 0.5) return kFirstLogit + g * kLogitStep;
        }
        return kFirstLogit;
    }

    double decision_threshold(const ModelConstants& c) const {
        const double z = clamp(half_as_many(c), c.threshold_bounds.low, c.threshold_bounds.high);
        return c.threshold_offset + c.threshold_slope * z;
    }
};

}  // namespace jeat::filters
