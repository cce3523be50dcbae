// The updates of one track that are smoothed together: which rows they give, and the smoothed states of these.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "filters/gap_survival.hpp"
#include "filters/singer.hpp"
#include "smoothers/rows.hpp"
#include "smoothers/state_rts.hpp"
#include "smoothers/step_record.hpp"

namespace jeat::smoothers {

struct History {
    std::int64_t track_id = 0;
    Called called;
    // What had been missed by the last entry that was given out; below 0 before the first.
    double missed = -1.0;
    double last_later = -1.0;  // of the last detection before the first entry
    bool was_real = false;     // whether it was likelier real than not at any entry that was given out
    std::vector<Entry> entries;
};

// What is kept of entries that have been given out.
struct Given {
    std::size_t entries = 0;
    double missed = 0.0;       // by the last of them
    double last_later = -1.0;  // of the last detection among them
};

// A row to be given out: its entry, and the probability that there is an object.
struct Reported {
    std::size_t entry;
    double real;
};

class Window {
public:
    // Find the rows that the entries up to a time give, by what the track turned out to be and how its gaps ended.
    Given weigh(History& history, double until, const GapCounts& gaps, const ModelConstants& c) {
        std::vector<Entry>& entries = history.entries;
        join_times(entries);
        find_gaps(entries);
        find_later(entries, history.last_later);
        reported_.clear();
        const double real_at = first_real(history, c);
        const std::size_t n = entries.size();
        Given given{0, std::max(history.missed, 0.0), history.last_later};
        for (; given.entries < n && entries[given.entries].t <= until; ++given.entries) {
            const std::size_t k = given.entries;
            const Entry& e = entries[k];
            if (!e.last_of_step) continue;
            if (e.later >= 0.0) given.last_later = e.later;
            const double nearer = std::min(e.missed, gap_[k] - given.missed);
            given.missed = e.missed;
            if (gap_[k] == kNotSeenAgain) continue;
            if (k + 1 < n && entries[k + 1].t == e.t) continue;  // a later step of the same time tells more
            double real = e.real;
            if (final_real_ > c.sure) {
                const double already = std::exp(-std::max(real_at - e.t, 0.0) / c.turning_s);
                real = std::max(real, std::min(final_real_, later_[k]) * already);
            }
            real *= gaps.survival(nearer, c);
            if (real > c.report) reported_.push_back({k, real});
        }
        return given;
    }

    // Smooth the states of the rows that `weigh` found.
    void smooth(const std::vector<Entry>& entries, const ModelConstants& c) {
        if (reported_.empty()) return;
        const std::size_t n = entries.size();
        mean_.resize(n);
        covariance_.resize(n);
        mean_[n - 1] = entries[n - 1].mean;
        unfold(entries[n - 1].covariance, covariance_[n - 1].data());
        std::array<double, kCovariance> predicted;
        for (std::size_t k = n - 1; k-- > reported_.front().entry;) {
            const Entry &now = entries[k], &later = entries[k + 1];
            mean_[k] = now.mean;
            unfold(now.covariance, covariance_[k].data());
            unfold(later.predicted_covariance, predicted.data());
            const double growth = filters::mean_growth(now.mean.data());
            const Matrix F = filters::in_perspective(transition(later.dt, c), growth, later.dt, c);
            rts(mean_[k].data(), covariance_[k].data(), F, later.predicted_mean.data(), predicted.data(),
                mean_[k + 1].data(), covariance_[k + 1].data());
        }
    }

    const std::vector<Reported>& reported() const { return reported_; }
    const double* mean(std::size_t entry) const { return mean_[entry].data(); }
    const double* covariance(std::size_t entry) const { return covariance_[entry].data(); }

private:
    // Of steps of one time the last one has what all of them found.
    static void join_times(std::vector<Entry>& entries) {
        for (std::size_t k = 0; k + 1 < entries.size(); ++k) {
            Entry& next = entries[k + 1];
            if (next.t != entries[k].t) continue;
            next.used |= entries[k].used;
            next.confirmed |= entries[k].confirmed;
            if (next.confirmed) next.missed = 0.0;
            next.later = std::max(next.later, entries[k].later);
        }
    }

    // What it turned out to be counts where that is sure; while nobody sees it, its gap must be one that ends well.
    void find_gaps(const std::vector<Entry>& entries) {
        double whole = 0.0;
        bool seen_again = false;
        final_real_ = 0.0;
        gap_.assign(entries.size(), kNotSeenAgain);
        for (std::size_t k = entries.size(); k-- > 0;) {
            const Entry& e = entries[k];
            if (!e.last_of_step) continue;
            if (e.confirmed && !seen_again) final_real_ = e.real, seen_again = true;
            whole = e.confirmed ? 0.0 : std::max(whole, e.missed);
            if (seen_again) gap_[k] = whole;
        }
    }

    // Of a gap both ends must be of an object. Where nothing later is known, what it turned out to be is.
    void find_later(const std::vector<Entry>& entries, double before) {
        const std::size_t n = entries.size();
        later_.assign(n, 1.0);
        double behind = -1.0;
        for (std::size_t k = n; k-- > 0;) {
            if (entries[k].last_of_step && entries[k].later >= 0.0) behind = entries[k].later;
            if (behind >= 0.0) later_[k] = behind;
        }
        for (std::size_t k = 0; k < n; ++k) {
            if (entries[k].last_of_step && entries[k].later >= 0.0) before = entries[k].later;
            if (before >= 0.0) later_[k] = std::min(later_[k], before);
        }
    }

    // When it was first taken for real. What it turned out to be says the less of it the longer it took to turn out.
    static double first_real(const History& history, const ModelConstants& c) {
        double at = history.was_real ? -kNever : kNever;
        for (const Entry& e : history.entries)
            if (e.last_of_step && e.real > c.report) at = std::min(at, e.t);
        return at;
    }

    const Matrix& transition(double dt, const ModelConstants& c) {
        if (dt != dt_) {
            dt_ = dt;
            F_ = filters::discretise(dt, c).F;
        }
        return F_;
    }

    static constexpr double kNotSeenAgain = -1.0, kNever = std::numeric_limits<double>::infinity();
    double dt_ = -1.0, final_real_ = 0.0;
    Matrix F_{};
    std::vector<Reported> reported_;
    std::vector<std::array<double, kMean>> mean_;
    std::vector<std::array<double, kCovariance>> covariance_;
    std::vector<double> gap_;    // of each entry, the whole gap that it lies in
    std::vector<double> later_;  // of each, what comes later says of the detections around it
};

}  // namespace jeat::smoothers
