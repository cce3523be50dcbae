// What the filter did to every living track, and the smoothed rows that follow from it.
//
// A track's rows are final when it has ended, or with a finite lag when so much time has followed: then the window of
// two lags is smoothed and its older half is given out. So memory does not grow with time.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <vector>

#include "constants.hpp"
#include "filters/gap_survival.hpp"
#include "filters/singer.hpp"
#include "interruption.hpp"
#include "smoothers/state_rts.hpp"

namespace jeat::smoothers {

using filters::GapCounts;
using filters::kCovariance;
using filters::kMean;
using filters::ModelConstants;

// What a track is called in the rows that are given out.
struct Called {
    std::int64_t track_id = 0;  // the identity that was given out for it
    std::int64_t label = -1;    // number of its class, below 0 where there is none
    double share = 0.0;         // of the votes that speak for the class
};

// Rows of a table, in columns.
struct Rows {
    std::vector<double> t, mean, variance, real, share;
    std::vector<std::int64_t> track_id, used, label;

    std::size_t size() const { return track_id.size(); }
    void clear() {
        t.clear(), mean.clear(), variance.clear(), real.clear(), share.clear();
        track_id.clear(), used.clear(), label.clear();
    }
    void add(double at, const Called& called, const double* state, const double* covariance, double probability,
             std::int64_t sensors, const ModelConstants& c) {
        t.push_back(at);
        track_id.push_back(called.track_id);
        label.push_back(called.label);
        share.push_back(called.share);
        real.push_back(probability);
        used.push_back(sensors);
        // Told is the box as detectors have it, and how far that may be from the object.
        const std::size_t first = mean.size();
        mean.resize(first + 2 * filters::kMotion);
        variance.resize(first + 2 * filters::kMotion);
        filters::report_motion(state, covariance, c, mean.data() + first, variance.data() + first);
    }
};

// The upper triangles of both axes' covariances, which are symmetric to the last bit.
inline constexpr int kHalf = kStates * (kStates + 1) / 2;
using Halves = std::array<double, 2 * kHalf>;

inline void halve(const double* covariance, Halves& out) {
    std::size_t to = 0;
    for (int axis = 0; axis < 2; ++axis)
        for (int i = 0; i < kStates; ++i)
            for (int j = i; j < kStates; ++j) out[to++] = covariance[axis * kMatrix + i * kStates + j];
}
inline void unfold(const Halves& halves, double* out) {
    std::size_t from = 0;
    for (int axis = 0; axis < 2; ++axis)
        for (int i = 0; i < kStates; ++i)
            for (int j = i; j < kStates; ++j, ++from)
                out[axis * kMatrix + i * kStates + j] = out[axis * kMatrix + j * kStates + i] = halves[from];
}

// One update of one track.
struct Entry {
    double t, dt;       // time, and since the last update (s)
    double real = 0.0;  // posterior after the step, where this was its last update
    double later = -1.0;  // posterior by what comes later, where a detection was found and that is given
    std::int64_t used = 0;
    bool confirmed = false;  // by a detection of that time
    double missed = 0.0;     // detections that were to be expected since one did; 0 where it is of that time
    bool last_of_step = false;
    std::array<double, kMean> predicted_mean, mean;
    Halves predicted_covariance, covariance;
};

// What the filter did in one step. It is kept apart until no step can come before this one any more.
struct Record {
    double t = 0.0;
    bool is_reset = false;            // all tracks had ended before the step
    std::vector<std::int64_t> track_id;  // of the tracks after it, before any of them ended
    std::vector<std::size_t> tracks;     // how many there were after each scan
    std::vector<std::size_t> known;      // of these, how many had been born before it
    std::vector<std::size_t> sensors;    // whose scan each was
    std::vector<Entry> entries;          // scan by scan, in the order of the tracks
    std::vector<double> growth;          // of each entry's track before its step: its transition follows from that
    std::vector<std::uint8_t> kept;      // which of the tracks live on
    GapCounts gaps, gaps_after;          // before and after tracks ended

    void begin(double time) {
        t = time;
        is_reset = false;
        track_id.clear(), tracks.clear(), known.clear(), sensors.clear(), entries.clear(), growth.clear(), kept.clear();
    }
    // The entries of a scan of so many tracks; more may be born in it.
    Entry* begin_scan(std::size_t number, std::size_t sensor) {
        sensors.push_back(sensor);
        known.push_back(number);
        entries.resize(entries.size() + number);
        tracks.push_back(number);
        return entries.data() + entries.size() - number;
    }
    Entry* grow_scan(std::size_t number) {
        entries.resize(entries.size() + number - tracks.back());
        tracks.back() = number;
        return entries.data() + entries.size() - number;
    }
    Entry* last_scan() { return tracks.empty() ? nullptr : entries.data() + entries.size() - tracks.back(); }
};

struct History {
    std::int64_t track_id = 0;
    Called called;
    // What had been missed by the last entry that was given out; below 0 before the first.
    double missed = -1.0;
    double last_later = -1.0;  // of the last detection before the first entry
    bool was_real = false;     // whether it was likelier real than not at any entry that was given out
    std::vector<Entry> entries;
};

class Histories {
public:
    explicit Histories(double lag_s) : lag_s_(lag_s) {}

    std::vector<History>& living() { return living_; }
    Rows& rows() { return rows_; }

    // Take a step in, in order of time; `called` is of its tracks.
    void take(const Record& record, std::span<const Called> called, const ModelConstants& c) {
        if (record.is_reset) end_all(record.gaps, c);
        check_order(record);
        std::size_t at = 0;
        for (const std::size_t number : record.tracks) {
            while (living_.size() < number) {
                const std::int64_t id = record.track_id[living_.size()];
                living_.emplace_back().track_id = id;
            }
            for (std::size_t i = 0; i < number; ++i) living_[i].entries.push_back(record.entries[at++]);
        }
        for (std::size_t i = 0; i < living_.size(); ++i) living_[i].called = called[i];
        advance(record.t, record.gaps, c);
        end(record.kept, record.gaps_after, c);
    }

    void end_all(const GapCounts& gaps, const ModelConstants& c) {
        end(std::vector<std::uint8_t>(living_.size(), 0), gaps, c);
    }

    // Give out what has become final while tracks live on. Tracks that began together begin to be given out one after
    // the other, within a lag: a step does not smooth all of them.
    void advance(double now, const GapCounts& gaps, const ModelConstants& c) {
        if (!std::isfinite(lag_s_)) return;
        for (History& history : living_)
            if (!history.entries.empty() && history.entries.front().t < now - (1.0 + share_of(history)) * lag_s_)
                give_out(history, now - lag_s_, gaps, c, rows_, true);
    }

    // Give out the rows of tracks that end, and forget them.
    void end(const std::vector<std::uint8_t>& kept, const GapCounts& gaps, const ModelConstants& c) {
        std::size_t to = 0;
        for (std::size_t i = 0; i < living_.size(); ++i) {
            if (kept[i]) {
                if (to != i) std::swap(living_[to], living_[i]);
                ++to;
            } else {
                may_be_interrupted();  // what has been given out until now is so once and for all
                give_out(living_[i], std::numeric_limits<double>::infinity(), gaps, c, rows_, true);
            }
        }
        living_.resize(to);
    }

    // Rows of living tracks as of now; they stay.
    Rows preview(const GapCounts& gaps, const ModelConstants& c) {
        Rows out = rows_;
        for (History& history : living_) {
            may_be_interrupted();
            give_out(history, std::numeric_limits<double>::infinity(), gaps, c, out, false);
        }
        return out;
    }

private:
    // Which share of the second lag a track waits for: of the first window as its identity says, then all of it.
    static double share_of(const History& history) {
        if (history.missed >= 0.0) return 1.0;  // its first rows are out
        const double turns = kGolden * static_cast<double>(history.track_id & kLowBits);
        return turns - std::floor(turns);
    }

    // Whether a step is the one behind the last that was taken in.
    void check_order(const Record& record) const {
        bool fits = living_.size() <= record.track_id.size();
        for (std::size_t i = 0; fits && i < living_.size(); ++i) fits = living_[i].track_id == record.track_id[i];
        if (!fits) throw std::invalid_argument("steps must be handed over once, and in order of time");
    }

    void give_out(History& history, double until, const GapCounts& gaps, const ModelConstants& c, Rows& out,
                  bool forget) {
        std::vector<Entry>& entries = history.entries;
        const std::size_t n = entries.size();
        if (n == 0) return;
        mean_.resize(n);
        covariance_.resize(n);
        mean_[n - 1] = entries[n - 1].mean;
        unfold(entries[n - 1].covariance, covariance_[n - 1].data());
        std::array<double, kCovariance> predicted;
        for (std::size_t k = n - 1; k-- > 0;) {
            const Entry &now = entries[k], &later = entries[k + 1];
            mean_[k] = now.mean;
            unfold(now.covariance, covariance_[k].data());
            unfold(later.predicted_covariance, predicted.data());
            const double growth = filters::mean_growth(now.mean.data());
            const Matrix F = filters::in_perspective(transition(later.dt, c), growth, later.dt, c);
            for (int axis = 0; axis < 2; ++axis) {
                const int m = axis * kStates, p = axis * kMatrix;
                rts_axis(&mean_[k][m], &covariance_[k][p], F, &later.predicted_mean[m], &predicted[p],
                         &mean_[k + 1][m], &covariance_[k + 1][p]);
            }
        }
        // What it turned out to be counts where that is sure; while nobody sees it, its gap must be one that ends well.
        for (std::size_t k = 0; k + 1 < n; ++k)
            if (entries[k + 1].t == entries[k].t) {
                entries[k + 1].used |= entries[k].used;
                entries[k + 1].confirmed |= entries[k].confirmed;
                if (entries[k + 1].confirmed) entries[k + 1].missed = 0.0;
                entries[k + 1].later = std::max(entries[k + 1].later, entries[k].later);
            }
        double final_real = 0.0, whole = 0.0;
        bool seen_again = false;
        gap_.assign(n, kNotSeenAgain);
        for (std::size_t k = n; k-- > 0;) {
            if (!entries[k].last_of_step) continue;
            if (entries[k].confirmed) {
                if (!seen_again) final_real = entries[k].real;
                seen_again = true;
            }
            whole = entries[k].confirmed ? 0.0 : std::max(whole, entries[k].missed);
            if (seen_again) gap_[k] = whole;
        }
        // What it turned out to be says the less of it the longer it took to turn out.
        double real_at = history.was_real ? -kNever : kNever;
        for (const Entry& e : entries)
            if (e.last_of_step && e.real > c.report) real_at = std::min(real_at, e.t);
        // Of a gap both ends must be of an object. Where nothing later is known, what it turned out to be is.
        later_.assign(n, 1.0);
        double behind = -1.0, before = history.last_later;
        for (std::size_t k = n; k-- > 0;) {
            if (entries[k].last_of_step && entries[k].later >= 0.0) behind = entries[k].later;
            if (behind >= 0.0) later_[k] = behind;
        }
        for (std::size_t k = 0; k < n; ++k) {
            if (entries[k].last_of_step && entries[k].later >= 0.0) before = entries[k].later;
            if (before >= 0.0) later_[k] = std::min(later_[k], before);
        }
        std::size_t given = 0;
        double missed_before = std::max(history.missed, 0.0), last_later = history.last_later;
        for (; given < n && entries[given].t <= until; ++given) {
            const Entry& e = entries[given];
            if (!e.last_of_step) continue;
            if (e.later >= 0.0) last_later = e.later;
            const double nearer = std::min(e.missed, gap_[given] - missed_before);
            missed_before = e.missed;
            double real = e.real;
            if (final_real > c.sure) {
                const double already = std::exp(-std::max(real_at - e.t, 0.0) / c.turning_s);
                real = std::max(real, std::min(final_real, later_[given]) * already);
            }
            if (gap_[given] == kNotSeenAgain) continue;
            if (given + 1 < n && entries[given + 1].t == e.t) continue;  // a later step of the same time tells more
            real *= gaps.survival(nearer, c);
            if (real > c.report)
                out.add(e.t, history.called, mean_[given].data(), covariance_[given].data(), real, e.used, c);
        }
        if (!forget) return;
        history.missed = missed_before;
        history.last_later = last_later;
        for (std::size_t k = 0; k < given; ++k)
            history.was_real |= entries[k].last_of_step && entries[k].real > c.report;
        entries.erase(entries.begin(), entries.begin() + static_cast<std::ptrdiff_t>(given));
    }

    const Matrix& transition(double dt, const ModelConstants& c) {
        if (dt != dt_) {
            dt_ = dt;
            F_ = filters::discretise(dt, c).F;
        }
        return F_;
    }

    static constexpr double kNotSeenAgain = -1.0, kNever = std::numeric_limits<double>::infinity();
    double lag_s_, dt_ = -1.0;
    Matrix F_{};
    std::vector<History> living_;
    Rows rows_;
    std::vector<std::array<double, kMean>> mean_;
    std::vector<std::array<double, kCovariance>> covariance_;
    std::vector<double> gap_;    // of each entry, the whole gap that it lies in
    std::vector<double> later_;  // of each, what comes later says of the detections around it
};

}  // namespace jeat::smoothers
