#include "tracking/associate.hpp"

#include <algorithm>
#include <cmath>

#include "interruption.hpp"
#include "tracking/life.hpp"

namespace jeat::tracking {

namespace {

bool reaches_edge(const Sides& box, const State& state) {
    const double edge = state.constants.edge_px;
    return !(box.left > edge && box.top > edge && box.right < state.width - edge && box.bottom < state.height - edge);
}

// The largest variances of a left (upper) side by axis by the boxes' own spreads; none without any.
std::array<double, 2> most_variance(const CorrectedBoxes& scan, const SpreadNoise& noise) {
    std::array<double, 2> most{};
    for (std::size_t j = 0; j < scan.spreads.size(); ++j) {
        const BySide more = noise.more(scan.spreads[j], scan.boxes[j], {0.0, 0.0});
        for (std::size_t axis = 0; axis < 2; ++axis) most[axis] = std::max(most[axis], more[2 * axis]);
    }
    return most;
}

bool is_owned(const Scan& scan, std::size_t box) { return !scan.owners.empty() && scan.owners[box] >= 0; }

}  // namespace

void Associator::associate(const State& state, const CorrectedBoxes& scan, Scan& given, AssociatedPairs& out) {
    const ModelConstants& c = state.constants;
    const std::size_t n = state.tracks.size();
    const double noise = state.noise(given.sensor);
    const SpreadNoise spread = state.spread_noise(given.sensor);
    given.noise_scale.assign(scan.size(), noise / square(c.side_std));
    for (std::size_t j = 0; j < scan.spreads.size(); ++j)
        given.noise_scale[j] = spread.mean_noise(noise, scan.spreads[j]) / square(c.side_std);
    const double least_of_clutter = weigh_scores(state, given);
    weigh_boxes(scan, given, c, out.confirms);
    order_owners(given);
    find_candidates(state, scan, given, least_of_clutter, out);
    const auto& chosen = assignment_.solve(by_appearance(given), n, scan.size(), c.exact_assignment);
    out.made.clear();
    out.innovation.clear();
    out.by_spread.clear();
    out.pair_of.assign(n, chosen.size());
    out.track_of.assign(scan.size(), n);
    for (const std::size_t k : chosen) {
        const association::Pair& pair = candidates_[k];
        out.pair_of[pair.row] = out.made.size();
        out.track_of[pair.column] = pair.row;
        out.made.push_back(pair);
        out.innovation.push_back(side_innovations(scan.boxes[pair.column], out.expected[pair.row].box));
        if (!scan.spreads.empty())
            out.by_spread.push_back(scan.with_own_spread(out.expected[pair.row], pair.column, spread));
    }
}

// Weigh the boxes' scores; returns the least likelihood of one among clutter.
double Associator::weigh_scores(const State& state, const Scan& given) {
    const ModelConstants& c = state.constants;
    double least = 1.0;
    q_.resize(given.boxes.size());
    of_clutter_.resize(given.boxes.size());
    for (std::size_t j = 0; j < q_.size(); ++j) {
        q_[j] = expit(given.logits[j] - state.belief.decision_threshold[given.sensor]);
        of_clutter_[j] = association::score_likelihood(c.clutter_precision, q_[j], c);
        least = std::min(least, of_clutter_[j]);
    }
    return least;
}

// Which boxes tell that their track is still there, by score and overlap with a better box of the scan.
void Associator::weigh_boxes(const CorrectedBoxes& scan, const Scan& given, const ModelConstants& c,
                             std::vector<std::uint8_t>& confirms) const {
    confirms.resize(scan.size());
    for (std::size_t j = 0; j < scan.size(); ++j) {
        may_be_interrupted();
        double overlap = 0.0;
        scan.index.near(scan.boxes[j], [&](std::size_t other, const Sides& box) {
            if (given.logits[other] > given.logits[j])
                overlap = std::max(overlap, intersection_over_union(scan.boxes[j], box));
        });
        const double odds = q_[j] / (1.0 - q_[j]) * (1.0 - overlap);
        confirms[j] = odds / (1.0 + odds) >= c.confirming;
    }
}

// The pairs that may be made: of a ratio above 1, within the gates.
void Associator::find_candidates(const State& state, const CorrectedBoxes& scan, const Scan& given,
                                 double least_of_clutter, AssociatedPairs& out) {
    const Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    const std::size_t n = tracks.size(), k = given.sensor;
    const double rho2 = state.noise(k);
    const SpreadNoise spread = state.spread_noise(k);
    const std::array<double, 2> most = most_variance(scan, spread);
    const association::ScanTerms terms(state.sensors[k].leftovers, state.width * state.height, c);
    out.expected.resize(n);
    out.p_detect.resize(n);
    candidates_.clear();
    for (std::size_t i = 0; i < n; ++i) {
        may_be_interrupted();
        out.p_detect[i] = own_p_detect(state, i, k);
        out.expected[i] = expected_sides(tracks.mean_of(i), tracks.covariance_of(i), rho2, c);
        const SidesExpected& expected = out.expected[i];
        const double p = clamp(tracks.presence_of(i)[kVisible] * out.p_detect[i], association::kLeastPDetect,
                               association::kMostPDetect);
        const double real = std::max(tracks.real[i], association::kLeastPosterior);
        const double best = (std::max(real, 1.0 - real) + c.score_floor) / least_of_clutter;
        const auto [log_area, log_odds, log_best, unused] =
            logs_of(expected.size[0] * expected.size[1], p / (1.0 - p), best, 1.0);
        const double start = log_odds - (terms.log_clutter - log_area);
        if (tracks.given[i] >= 0) {
            // Its box is given, however far off: that is no reason to doubt that it is real.
            const TrackTerms track{expected, spread, start, real, association::Gates(c)};
            const std::size_t j = box_of(tracks.given[i]);
            if (j < scan.size())
                candidates_.push_back({i, j, std::max(log_ratio(track, scan, j, terms, c), association::kLeastGain)});
            continue;
        }
        // A box that the edge cuts may lie farther off, but is only compared so where the object reaches the edge. What a
        // box with a spread of its own can gain is not known beforehand.
        const TrackTerms track{expected, spread, start, real,
                               reaches_edge(expected.box, state) || !scan.spreads.empty()
                                   ? association::Gates(c)
                                   : association::Gates(expected, start + log_best, terms, c)};
        const double reach = association::reach(expected, 0, most[0], track.gates, c);
        const double above = association::reach(expected, 1, most[1], track.gates, c);
        const auto weigh = [&](std::size_t j, const Sides& box) {
            if (std::abs(box.top - expected.box.top) > above || is_owned(given, j)) return;
            const double gain = log_ratio(track, scan, j, terms, c);
            if (gain > 0.0) candidates_.push_back({i, j, gain});
        };
        scan.index.with_left_in(expected.box.left - reach, expected.box.left + reach, weigh);
    }
}

// ln L of a pair.
double Associator::log_ratio(const TrackTerms& track, const CorrectedBoxes& scan, std::size_t box,
                             const association::ScanTerms& terms, const ModelConstants& c) const {
    const auto y = side_innovations(scan.boxes[box], track.expected.box);
    const Edges cut = unmeasured_sides(y, scan.edges[box]);
    SidesExpected own;
    const SidesExpected* expected = &track.expected;
    if (!scan.spreads.empty()) own = scan.with_own_spread(*expected, box, track.spread), expected = &own;
    if (cut.any()) own = with_cut(*expected, cut, c), expected = &own;
    const double density = association::sides_log_density(y, *expected, track.gates, terms, c);
    if (density <= association::kImpossible) return density;
    const double of_track = association::score_likelihood(track.real, q_[box], c);
    return track.start + density + log_of(of_track / of_clutter_[box]);
}

// The boxes of a scan by their owners, where these are given.
void Associator::order_owners(const Scan& given) {
    owned_.clear();
    for (std::size_t j = 0; j < given.owners.size(); ++j)
        if (given.owners[j] >= 0) owned_.push_back({given.owners[j], j});
    std::sort(owned_.begin(), owned_.end());
}

// The box of an owner; the number of boxes where there is none.
std::size_t Associator::box_of(std::int64_t owner) const {
    const auto at = std::lower_bound(owned_.begin(), owned_.end(), std::pair{owner, std::size_t{0}});
    return at == owned_.end() || at->first != owner ? q_.size() : at->second;
}

// The pairs with the similarity of their appearance, which decides the assignment, not whether there is an object.
const std::vector<association::Pair>& Associator::by_appearance(const Scan& given) {
    if (!given.similarity.data) return candidates_;
    with_appearance_ = candidates_;
    for (association::Pair& pair : with_appearance_)
        if (pair.row < given.similarity.rows)
            pair.gain = std::max(pair.gain + given.similarity[pair.row][pair.column], association::kLeastGain);
    return with_appearance_;
}

}  // namespace jeat::tracking
