// Which track a box belongs to: a log likelihood ratio for each pair; the formulas are in
// association/likelihood_ratio.py.
#pragma once

#include <algorithm>
#include <vector>

#include "association/assignment.hpp"
#include "constants.hpp"
#include "filters/box_sides.hpp"

namespace jeat::association {

using filters::ModelConstants;
using filters::Sides;
using filters::SidesExpected;

// What holds for all pairs of one scan.
struct ScanTerms {
    double student_constant, log_clutter;
    filters::ShareLogs logs;

    ScanTerms(double leftovers, double picture_area, const ModelConstants& c) : logs(c) {
        const double nu = c.degrees_of_freedom;
        student_constant = log_gamma((nu + 4.0) / 2.0) - log_gamma(nu / 2.0) - 2.0 * log_of(nu * kPi);
        log_clutter = log_of((leftovers + c.clutter_prior) / (picture_area * c.clutter_size_area));
    }
};

// The likelihood of a score of what is real with r; q is the box's probability of being real by its score.
inline double score_likelihood(double r, double q, const ModelConstants& c) {
    return r * q + (1.0 - r) * (1.0 - q) + c.score_floor;
}

inline constexpr double kImpossible = -1e9;

// The largest squared distances of all sides, and of the other three where one is cut, at which a pair can have a gain
// above 0. What is not of the sides gives `most`; where neither way gives half of what is needed, both together do not.
struct Gates {
    double whole, cut;

    explicit Gates(const ModelConstants& c) : whole(c.gate), cut(c.cut_gate) {}
    Gates(const SidesExpected& expected, double most, const ScanTerms& terms, const ModelConstants& c) {
        const double nu = c.degrees_of_freedom, enough = most + kLn2High + kRounding;
        const double peak = terms.student_constant - 0.5 * (expected.log_det[0] + expected.log_det[1]);
        const double away = clamp((peak + enough) / ((nu + 4.0) / 2.0), 0.0, 100.0);
        whole = std::min(c.gate, nu * (exp_of(away) - 1.0) * (1.0 + kRounding));
        double cut_peak = kImpossible;
        for (int axis = 0; axis < 2; ++axis)
            cut_peak = std::max(cut_peak, -0.5 * expected.log_det[1 - axis] - expected.log_size[axis] -
                                              0.5 * std::min(expected.log_left[axis], expected.log_right[axis]));
        cut_peak +=
            std::max(terms.logs.cut, terms.logs.uncovered) - 1.5 * filters::kLog2Pi + 2.0 * kLn2High;  // of four
        cut = clamp(2.0 * (cut_peak + enough), 0.0, c.cut_gate);
    }
};

// ln p(y) where an occluder cuts one side, or has cut it so far, and the other three fit.
inline double cut_log_density(const std::array<double, 4>& y, const std::array<double, 2>& distances,
                              const SidesExpected& expected, const filters::ShareLogs& logs, const ModelConstants& c) {
    double out = kImpossible;
    for (int axis = 0; axis < 2; ++axis) {
        const filters::Pair2& S = expected.S[axis];
        const double left = y[2 * axis], right = y[2 * axis + 1], size = expected.size[axis];
        const double d2 = distances[1 - axis];
        if (d2 > c.cut_gate) continue;
        const double whole =
            -0.5 * d2 - 0.5 * expected.log_det[1 - axis] - 1.5 * filters::kLog2Pi - expected.log_size[axis];
        const auto with = [&](double other, double variance, double log_variance, double inwards) {
            const double alone = other * other / variance;
            if (inwards >= size || inwards <= -c.most_uncovered * size || d2 + alone > c.cut_gate) return;
            const double share = inwards > 0.0 ? logs.cut : logs.uncovered;
            out = log_add(out, share + whole - 0.5 * alone - 0.5 * log_variance);
        };
        with(right, S.rr, expected.log_right[axis], left);
        with(left, S.ll, expected.log_left[axis], -right);
    }
    return out;
}

// ln p(y) of a pair, or kImpossible where it lies outside every gate.
inline double sides_log_density(const std::array<double, 4>& y, const SidesExpected& expected, const Gates& gates,
                                const ScanTerms& terms, const ModelConstants& c) {
    const std::array distances{expected.S[0].squared_distance(y[0], y[1]), expected.S[1].squared_distance(y[2], y[3])};
    const double d2 = distances[0] + distances[1];
    if (d2 > gates.whole && std::min(distances[0], distances[1]) > gates.cut) return kImpossible;
    const double cut = cut_log_density(y, distances, expected, terms.logs, c);
    if (d2 > c.gate) return cut;
    const double nu = c.degrees_of_freedom;
    const double peak = terms.student_constant - 0.5 * (expected.log_det[0] + expected.log_det[1]);
    return log_add(cut, peak - (nu + 4.0) / 2.0 * log1p_of(d2 / nu));
}

// How far a box's left side (axis 0), or its top, may lie from the expected one at most; `more` is what its variance may
// be more than expected.
inline double reach(const SidesExpected& expected, int axis, double more, const Gates& gates, const ModelConstants& c) {
    const double whole = std::sqrt(std::max(gates.whole, gates.cut) * (expected.S[axis].ll + more));
    return std::max(std::max(1.0, c.most_uncovered) * expected.size[axis], whole);
}

}  // namespace jeat::association
