// How long an unseen track is reported; the formulas are in filters/gap_survival.py.
#pragma once

#include <algorithm>
#include <array>

#include "filters/model_constants.hpp"
#include "math.hpp"

namespace jeat::filters {

inline constexpr int kGapBins = 9;
inline constexpr std::array<double, kGapBins + 1> kGapBinsS{0.0, 0.04, 0.08, 0.15, 0.25, 0.4, 0.7, 1.1, 1.8, 3.0};

struct GapCounts {
    std::array<double, kGapBins> ended{}, ended_well{};

    void count_end(double gap_s, bool well) {
        for (int k = 0; k < kGapBins && kGapBinsS[k] < gap_s; ++k) {
            ended[k] += 1.0;
            ended_well[k] += well ? 1.0 : 0.0;
        }
    }
    void count_loss() {
        for (double& number : ended) number += 1.0;
    }
    double survival(double gap_s, const ModelConstants& c) const {
        int k = 0;
        while (k + 1 < kGapBins && kGapBinsS[k + 1] <= gap_s) ++k;
        const double prior = exp_of(-std::max(kGapBinsS[k], c.gap_prior_least_s) / c.gap_prior_s);
        return (ended_well[k] + c.gap_prior_count * prior) / (ended[k] + c.gap_prior_count);
    }
};

}  // namespace jeat::filters
