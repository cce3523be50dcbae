// How long an unseen track is reported; the formulas are in filters/gap_survival.py.
#pragma once

#include <algorithm>
#include <array>

#include "constants.hpp"
#include "filters/model_constants.hpp"
#include "math.hpp"

namespace jeat::filters {

inline constexpr int kGapBins = static_cast<int>(kGapBinEnds.size()) - 1;

struct GapCounts {
    std::array<double, kGapBins> ended{}, ended_well{};

    void count_end(double gap, bool well) {
        for (int k = 0; k < kGapBins && kGapBinEnds[k] < gap; ++k) {
            ended[k] += 1.0;
            ended_well[k] += well ? 1.0 : 0.0;
        }
    }
    void count_loss() {
        for (double& number : ended) number += 1.0;
    }
    double survival(double gap, const ModelConstants& c) const {
        if (!(gap > 0.0)) return 1.0;
        int k = 0;
        while (k + 1 < kGapBins && kGapBinEnds[k + 1] <= gap) ++k;
        const double prior = exp_of(-std::max(kGapBinEnds[k], c.gap_prior_least) / c.gap_prior);
        return (ended_well[k] + c.gap_prior_count * prior) / (ended[k] + c.gap_prior_count);
    }
};

}  // namespace jeat::filters
