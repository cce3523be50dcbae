// Which box each track takes: the assignment of greatest log likelihood ratio.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "association/likelihood_ratio.hpp"
#include "tracking/scan.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

class Associator {
public:
    // Find the boxes of tracks; `given` is the scan of these boxes as it came, whose noise_scale is written.
    void associate(const State& state, const CorrectedBoxes& scan, Scan& given, AssociatedPairs& out);

private:
    // What all pairs of one track have in common: `start` is what neither score nor place say of ln L; outside of the
    // gates no pair has a ratio above 1.
    struct TrackTerms {
        const SidesExpected& expected;
        const SpreadNoise& spread;
        double start, real;
        association::Gates gates;
    };

    double weigh_scores(const State& state, const Scan& given);
    void weigh_boxes(const CorrectedBoxes& scan, const Scan& given, const ModelConstants& c,
                     std::vector<std::uint8_t>& confirms) const;
    void find_candidates(const State& state, const CorrectedBoxes& scan, const Scan& given, double least_of_clutter,
                         AssociatedPairs& out);
    double log_ratio(const TrackTerms& track, const CorrectedBoxes& scan, std::size_t box,
                     const association::ScanTerms& terms, const ModelConstants& c) const;
    void order_owners(const Scan& given);
    std::size_t box_of(std::int64_t owner) const;
    const std::vector<association::Pair>& by_appearance(const Scan& given);

    std::vector<double> q_, of_clutter_;  // of boxes: of being real by its score, and likelihood of that among clutter
    std::vector<association::Pair> candidates_, with_appearance_;
    std::vector<std::pair<std::int64_t, std::size_t>> owned_;  // owners of the scan's boxes, in order
    association::Assignment assignment_;
};

}  // namespace jeat::tracking
