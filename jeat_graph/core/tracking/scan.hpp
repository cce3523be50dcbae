// What the stages of a step hand on: a scan, its boxes as they are corrected, and the pairs that association found.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "arrays.hpp"
#include "association/assignment.hpp"
#include "filters/box_sides.hpp"
#include "filters/box_spread.hpp"

namespace jeat::tracking {

using namespace jeat::filters;

// One scan of a sensor.
struct Scan {
    std::size_t sensor = 0;
    std::vector<Sides> boxes;
    std::vector<double> logits;
    // How much more likely each box is of a track than of another by its appearance: ln ratio, (tracks, boxes).
    View2<const double> similarity{nullptr, 0, 0};
    // Where the association is given: the identity of each box, below 0 for none, and whether later boxes have the same
    // identity. Empty where the tracker decides. At most one box of a scan has an identity.
    std::vector<std::int64_t> owners;
    std::vector<std::uint8_t> awaited;
    std::vector<BySide> spreads;         // how sure the detector is of its boxes' sides; empty where it says nothing
    std::vector<double> later;           // posteriors by what comes later, to the smoother
    std::vector<std::int64_t> assigned;  // written: the track that each box went to
    std::vector<double> nis;             // written: squared distance of its centre, NaN where it began a track
    std::vector<double> noise_scale;     // written: mean variance of its sides, 1 before anything was learnt
};

// Its boxes as the sensors have them on the average, and which of their sides end at the edge of the picture.
struct CorrectedBoxes {
    std::vector<Sides> boxes;
    std::vector<Edges> edges;
    std::vector<BySide> spreads;  // as of Scan
    ByLeft index{{}};

    std::size_t size() const { return boxes.size(); }
    // What is expected of one of them by its own spread, of which there is one.
    SidesExpected with_own_spread(const SidesExpected& expected, std::size_t box, const SpreadNoise& noise) const {
        return with_spread(expected, noise.more(spreads[box], boxes[box], expected.size));
    }
};

// What association found in one scan, and for its pairs.
struct AssociatedPairs {
    std::vector<association::Pair> made;            // tracks (rows), boxes (columns), ln L, in the order of tracks
    std::vector<std::array<double, 4>> innovation;  // of each of these
    std::vector<SidesExpected> expected;            // of all tracks
    std::vector<SidesExpected> by_spread;  // of all pairs where the boxes have spreads of their own, else empty
    std::vector<double> p_detect;          // of all tracks
    std::vector<std::size_t> pair_of;      // of all tracks, made.size() where there is none
    std::vector<std::size_t> track_of;     // of all boxes; before births the number of tracks where none took it
    std::vector<std::uint8_t> confirms;    // of all boxes: whether it tells that its track is still there

    // What was expected of the box of a pair.
    const SidesExpected& expected_of(std::size_t pair) const {
        return by_spread.empty() ? expected[made[pair].row] : by_spread[pair];
    }
};

}  // namespace jeat::tracking
