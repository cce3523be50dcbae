// Which track a box belongs to: a log likelihood ratio for each pair; the formulas are in
// association/likelihood_ratio.py.
#pragma once

#include <algorithm>
#include <vector>

#include "association/assignment.hpp"
#include "filters/box_sides.hpp"

namespace jeat::association {

using filters::ModelConstants;
using filters::Sides;
using filters::SidesExpected;

inline constexpr double kLeastPDetect = 0.01, kMostPDetect = 0.99, kLeastPosterior = 0.02;

// What holds for all pairs of one scan.
struct ScanTerms {
    double student_constant, normal_constant, log_body, log_tail, log_clutter;

    ScanTerms(double leftovers, double picture_area, const ModelConstants& c) {
        const double nu = c.degrees_of_freedom;
        student_constant = log_gamma((nu + 4.0) / 2.0) - log_gamma(nu / 2.0) - 2.0 * log_of(nu * kPi);
        normal_constant = -2.0 * filters::kLog2Pi;
        log_body = log1p_of(-c.outlier_share);
        log_tail = log_of(c.outlier_share);
        log_clutter = log_of((leftovers + c.clutter_prior) / (picture_area * c.clutter_size_area));
    }
};

// ln of the scores' likelihood ratio of a track to clutter; q is the box's probability by score.
inline double score_log_ratio(double real, double q, const ModelConstants& c) {
    const double r = std::max(real, kLeastPosterior), clutter = c.clutter_precision;
    const double of_track = r * q + (1.0 - r) * (1.0 - q) + c.score_floor;
    const double of_clutter = clutter * q + (1.0 - clutter) * (1.0 - q) + c.score_floor;
    return log_of(of_track / of_clutter);
}

// ln p(y) of a pair, or a number below every bound where it lies outside the gate.
inline double sides_log_density(const Sides& box, const SidesExpected& expected, const ScanTerms& terms,
                                const ModelConstants& c) {
    const auto y = filters::side_innovations(box, expected.box);
    const double d2 = filters::squared_distance(y, expected.S), wide = filters::squared_distance(y, expected.wide);
    double cut = -1e9;
    if (c.cut_in_association > 0.0)
        for (int axis = 0; axis < 2; ++axis) {
            const filters::Pair2 &S = expected.S[axis], &T = expected.S[1 - axis];
            const double l = y[2 * axis], r = y[2 * axis + 1], other = T.squared_distance(y[2 - 2 * axis], y[3 - 2 * axis]);
            if (other > c.cut_gate) continue;
            const double base = -0.5 * other - 0.5 * log_of(T.determinant()) - filters::kLog2Pi - log_of(expected.size[axis]) - 0.5 * filters::kLog2Pi;
            if (l > 0.0 && l < expected.size[axis] && r * r / S.rr + other < c.cut_gate) cut = log_add(cut, base - 0.5 * r * r / S.rr - 0.5 * log_of(S.rr));
            if (r < 0.0 && -r < expected.size[axis] && l * l / S.ll + other < c.cut_gate) cut = log_add(cut, base - 0.5 * l * l / S.ll - 0.5 * log_of(S.ll));
        }
    const bool whole = std::min(d2, c.outlier_gate * wide) <= c.gate;
    if (!whole && cut < -1e8) return -1e9;
    const double nu = c.degrees_of_freedom;
    const double body = terms.student_constant - 0.5 * expected.log_det - (nu + 4.0) / 2.0 * log1p_of(d2 / nu);
    const double tail = terms.normal_constant - 0.5 * expected.log_det_wide - 0.5 * wide;
    const double all = whole ? log_add(terms.log_body + body, terms.log_tail + tail) : -1e9;
    return cut < -1e8 ? all : log_add(all, log_of(c.cut_in_association) + cut);
}

// How far a box's left side may lie from the expected one at most.
inline double reach(const SidesExpected& expected, const ModelConstants& c) {
    return std::max(c.cut_in_association > 0. ? expected.size[0] : 0., std::sqrt(c.gate * std::max(expected.S[0].ll, expected.wide[0].ll / c.outlier_gate)));
}

}  // namespace jeat::association
