// What a track is: the posterior over its hypotheses; the formulas are in filters/object_probability.py.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "constants.hpp"
#include "filters/evidence.hpp"
#include "math.hpp"

namespace jeat::filters {

struct SensorBelief {
    std::vector<double> p_detect, unseen, stationary_unseen, decision_threshold, prior_odds, agreed_mean, agreed_std,
        agreed_share, score_weight, stationary_prior;
    double noise_share;

    // Add a sensor: the weight of its scores, and the prior of what it does not see while it stands.
    void widen(const ModelConstants& c, double weight, double stationary) {
        p_detect.push_back(c.p_detect);
        unseen.push_back(c.unseen_share);
        stationary_unseen.push_back(c.stationary_unseen_share);
        decision_threshold.push_back(0.0);
        prior_odds.push_back(0.0);
        agreed_mean.push_back(0.0);
        agreed_std.push_back(c.agreed_std);
        agreed_share.push_back(0.0);
        score_weight.push_back(weight);
        stationary_prior.push_back(stationary);
    }
};

// What one track is; of each sensor the probabilities that it never sees it, and not while it stands.
struct Posterior {
    double log_odds, noise;
    std::vector<double> unseen, stationary_unseen;
};

class PosteriorRule {
public:
    PosteriorRule(const SensorBelief& sensors, const ModelConstants& c)
        : sensors_(sensors), c_(c), seen_(sensors.p_detect.size()), shared_(seen_.size()), scores_(seen_.size()) {
        for (const double p : sensors.p_detect) {
            a_.push_back(p * c.p_detect_strength);
            b_.push_back((1.0 - p) * c.p_detect_strength);
            log_p_detect_.push_back(log_of(p));
            log_beta_.push_back(log_beta(a_.back(), b_.back()));
        }
        for (const double g : sensors.unseen) {
            log_unseen_.push_back(log_of(g));
            log_not_unseen_.push_back(log1p_of(-g));
        }
        for (const double b : sensors.stationary_unseen) {
            log_stationary_.push_back(log_of(b));
            log_not_stationary_.push_back(log1p_of(-b));
        }
        log_chance_ = log_of(c.chance_hit);
        log_no_chance_ = log1p_of(-c.chance_hit);
        log_shared_ = log_of(c.shared_false);
        log_not_shared_ = log1p_of(-c.shared_false);
        noise_odds_ = log_of(sensors.noise_share / (1.0 - sensors.noise_share));
        out_.unseen.resize(seen_.size());
        out_.stationary_unseen.resize(seen_.size());
    }

    const Posterior& operator()(const Evidence& e, std::size_t row) {
        const std::size_t S = e.sensors, first = row * S;
        double real = 0.0, others = 0.0, priors = 0.0, best_score = -std::numeric_limits<double>::infinity();
        for (std::size_t s = 0; s < S; ++s) {
            const double h = e.hits[first + s], m = e.misses[first + s];
            seen_[s] = log_beta(a_[s] + h, b_[s] + m) - log_beta_[s];
            const double chance = h * log_chance_ + m * log_no_chance_;
            const double hs = e.stationary_hits[first + s], ms = e.stationary_misses[first + s];
            double sees = seen_[s];
            out_.stationary_unseen[s] = 0.0;
            // The detection that began the track is a look, too: a chance hit where the sensor cannot see it.
            const bool began = static_cast<std::size_t>(e.owner[row]) == s;
            const double birth = began ? log_chance_ - log_p_detect_[s] : 0.0;
            if (hs + ms > 0.0) {
                const double moved = h - hs <= 0.0 && m - ms <= 0.0 ? birth : 0.0;
                const double blind = log_stationary_[s] + moved + log_beta(a_[s] + h - hs, b_[s] + m - ms) -
                                     log_beta_[s] + hs * log_chance_ + ms * log_no_chance_;
                sees = log_add(blind, log_not_stationary_[s] + seen_[s]);
                out_.stationary_unseen[s] = exp_of(blind - sees);
            }
            const bool found = e.found[first + s];
            const double prior = found ? sensors_.prior_odds[s] : 0.0;
            scores_[s] = found ? weighed_score(e, row, s) : 0.0;
            // Scores of what a sensor finds by chance are those of clutter; but a track does not begin by chance.
            const double never = log_unseen_[s] + chance + (began ? scores_[s] : 0.0) + birth;
            const double object = log_add(never, log_not_unseen_[s] + sees + scores_[s]);
            out_.unseen[s] = exp_of(never - object);
            shared_[s] = log_add(log_not_shared_ + chance + (began ? prior : 0.0), log_shared_ + seen_[s] + prior);
            best_score = std::max(best_score, scores_[s]);
            real += object;
            priors += prior;
            others += shared_[s];
        }
        const double doubt =
            1.0 / (1.0 + exp_of(clamp(best_score - c_.duplicate_log_odds, -kMostLogOdds, kMostLogOdds)));
        real += c_.duplicate_weight * doubt * log_of(std::max(1.0 - e.overlap[row], kLeastApart));
        double false_object = -std::numeric_limits<double>::infinity();
        for (std::size_t s = 0; s < S; ++s)
            if (e.found[first + s]) false_object = log_add(false_object, others - shared_[s] + seen_[s]);
        const double noise = noise_odds_ - e.gained[row] + priors - sensors_.prior_odds[e.owner[row]];
        const double not_real = log_add(false_object, noise);
        out_.log_odds = real - not_real;
        out_.noise = exp_of(noise - not_real);
        return out_;
    }

    // A track's score by a sensor, once a track.
    double score(const Evidence& e, std::size_t at) const {
        const double mean = e.total[at] / std::max(e.total_weight[at], kLeastSum);
        return c_.peak_share * e.peak[at] + (1.0 - c_.peak_share) * mean;
    }
    // Probability that a sensor does not see a track, by its scans and even odds; some misses may be forgiven.
    double blindness(const Evidence& e, std::size_t at, std::size_t s, double forgiven) const {
        const double h = e.hits[at], m = e.misses[at] - forgiven;
        const double seen = log_beta(a_[s] + h, b_[s] + m) - log_beta_[s];
        return expit(h * log_chance_ + m * log_no_chance_ - seen);
    }

private:
    // A good score that the others contradict says as much as it resembles the scores that they agree with.
    double weighed_score(const Evidence& e, std::size_t row, std::size_t s) const {
        const std::size_t first = row * e.sensors;
        const double z = score(e, first + s), given = sensors_.score_weight[s] * (z - sensors_.decision_threshold[s]);
        const double below = (sensors_.agreed_mean[s] - z) / sensors_.agreed_std[s];
        if (!(given > 0.0) || !(sensors_.agreed_share[s] > 0.0) || !(below > 0.0)) return given;
        double alone = 1.0, silent = 0.0;
        for (std::size_t o = 0; o < e.sensors; ++o) {
            if (o == s) continue;
            const double forgiven = sensors_.stationary_unseen[o] * e.stationary_misses[first + o];
            const double blind = 2.0 * blindness(e, first + o, o, forgiven) - 1.0;
            alone *= 1.0 - std::max(-blind, 0.0);
            silent = std::max(silent, blind);
        }
        return given * (1.0 - sensors_.agreed_share[s] * (1.0 - exp_of(-0.5 * below * below)) * alone * silent);
    }

    const SensorBelief& sensors_;
    const ModelConstants& c_;
    std::vector<double> a_, b_, log_p_detect_, log_beta_, log_unseen_, log_not_unseen_, log_stationary_,
        log_not_stationary_;
    std::vector<double> seen_, shared_, scores_;
    double log_chance_, log_no_chance_, log_shared_, log_not_shared_, noise_odds_;
    Posterior out_;
};

// Sums over tracks from which the sensors are learnt.
struct SensorSums {
    std::vector<double> hits, scans, unseen, seeable, stationary_unseen, stationary, real, not_real;
    std::vector<double> agreed, agreed_score, agreed_square, sees;
    double noise = 0.0, not_object = 0.0;

    explicit SensorSums(std::size_t S)
        : hits(S, 0.0), scans(S, 0.0), unseen(S, 0.0), seeable(S, 0.0), stationary_unseen(S, 0.0), stationary(S, 0.0),
          real(S, 0.0), not_real(S, 0.0), agreed(S, 0.0), agreed_score(S, 0.0), agreed_square(S, 0.0), sees(S, 0.0) {}

    void add(const Evidence& e, PosteriorRule& rule, const ModelConstants& c) {
        for (std::size_t row = 0; row < e.size(); ++row) {
            const Posterior& belief = rule(e, row);
            const double p = expit(belief.log_odds);
            double missed = 0.0;
            const double trust = clamp(e.detections[row] / c.weight_hits, c.weight_bounds.low, c.weight_bounds.high);
            for (std::size_t s = 0; s < e.sensors; ++s) {
                const std::size_t at = row * e.sensors + s;
                const double h = e.hits[at], n = h + e.misses[at];
                missed += e.misses[at];
                const double seen = p * (1.0 - belief.unseen[s]), blind = belief.stationary_unseen[s];
                const double hs = e.stationary_hits[at], ns = hs + e.stationary_misses[at];
                const double weight = seen * std::min(1.0, c.scan_count / std::max(n, kLeastSum));
                hits[s] += weight * (h - blind * hs);
                scans[s] += weight * (n - blind * ns);
                if (ns > kLeastScans) {
                    stationary_unseen[s] += seen * blind;
                    stationary[s] += seen;
                }
                if (n > kLeastScans) {
                    unseen[s] += p * belief.unseen[s];
                    seeable[s] += p;
                }
                if (e.found[at]) {
                    real[s] += trust * p;
                    not_real[s] += trust * (1.0 - p);
                }
            }
            add_agreed(e, row, rule);
            const bool grown = e.last_s[row] > e.born_s[row] || e.gained[row] > 0.0;
            if (grown || missed > kLeastMisses) {
                noise += (1.0 - p) * belief.noise;
                not_object += 1.0 - p;
            }
        }
    }

    // The scores of a track that another sensor finds as well.
    void add_agreed(const Evidence& e, std::size_t row, const PosteriorRule& rule) {
        const std::size_t first = row * e.sensors;
        for (std::size_t s = 0; s < e.sensors; ++s)
            sees[s] = e.hits[first + s] > 0.0 ? 1.0 - rule.blindness(e, first + s, s, 0.0) : 0.0;
        for (std::size_t s = 0; s < e.sensors; ++s) {
            double others = 0.0;
            for (std::size_t o = 0; o < e.sensors; ++o)
                if (o != s) others = std::max(others, sees[o]);
            if (!(e.found[first + s] && others > 0.0)) continue;
            const double weight = others * sees[s] * std::min(1.0, e.hits[first + s] / kLeastScans);
            const double z = rule.score(e, first + s);
            agreed[s] += weight;
            agreed_score[s] += weight * z;
            agreed_square[s] += weight * z * z;
        }
    }
};

inline double beta_share(double hits, double of, double prior, double count) {
    return (hits + count * prior) / (of + count);
}

inline void learn_sensors(const Evidence& ended, const Evidence& living, SensorBelief& sensors,
                          const ModelConstants& c) {
    if (ended.size() + living.size() == 0) return;
    for (int round = 0; round < kRounds; ++round) {
        PosteriorRule rule(sensors, c);
        SensorSums sums(sensors.p_detect.size());
        sums.add(ended, rule, c);
        sums.add(living, rule, c);
        SensorBelief next = sensors;
        // Of a sensor alone the prior is the usual one: what it may not see is about what the others see.
        const bool alone = sensors.p_detect.size() == 1;
        for (std::size_t s = 0; s < sensors.p_detect.size(); ++s) {
            const double stationary_prior = alone ? c.stationary_unseen_share : sensors.stationary_prior[s];
            next.p_detect[s] = clamp(beta_share(sums.hits[s], sums.scans[s], c.p_detect, c.p_detect_count),
                                     c.p_detect_bounds.low, c.p_detect_bounds.high);
            next.unseen[s] = clamp(beta_share(sums.unseen[s], sums.seeable[s], c.unseen_share, c.sensor_count),
                                   c.unseen_bounds.low, c.unseen_bounds.high);
            next.stationary_unseen[s] =
                clamp(beta_share(sums.stationary_unseen[s], sums.stationary[s], stationary_prior, c.sensor_count),
                      c.stationary_unseen_bounds.low, c.stationary_unseen_bounds.high);
            if (const double known = sums.agreed[s]; known > 0.0) {
                const double mean = sums.agreed_score[s] / known, count = c.sensor_count;
                const double squares = std::max(sums.agreed_square[s] - known * mean * mean, 0.0);
                next.agreed_mean[s] = mean;
                next.agreed_std[s] = std::sqrt((count * c.agreed_std * c.agreed_std + squares) / (count + known));
                next.agreed_share[s] = known / (known + count);
            }
            next.prior_odds[s] = log_of((sums.real[s] + c.sensor_count) / (sums.not_real[s] + c.sensor_count));
        }
        next.noise_share = clamp(beta_share(sums.noise, sums.not_object, c.noise_share, c.sensor_count),
                                 c.noise_bounds.low, c.noise_bounds.high);
        sensors = next;
    }
}

}  // namespace jeat::filters
