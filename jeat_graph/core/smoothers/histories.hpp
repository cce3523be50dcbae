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
#include "interruption.hpp"
#include "smoothers/rows.hpp"
#include "smoothers/step_record.hpp"
#include "smoothers/window.hpp"

namespace jeat::smoothers {

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

    // Forget updates of living tracks, of those with these ascending identities up to a time each: nobody wants their
    // rows.
    void forget(std::span<const std::int64_t> track_id, std::span<const double> until, const GapCounts& gaps,
                const ModelConstants& c) {
        std::size_t k = 0;
        for (History& history : living_) {
            while (k < track_id.size() && track_id[k] < history.track_id) ++k;
            if (k == track_id.size()) return;
            if (track_id[k] != history.track_id || history.entries.empty()) continue;
            if (history.entries.front().t <= until[k])
                forget_first(history, window_.weigh(history, until[k], gaps, c), c);
        }
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

    // Most tracks of a detector's weak boxes are never reported: states are smoothed only from the first row on that
    // is to be given out.
    void give_out(History& history, double until, const GapCounts& gaps, const ModelConstants& c, Rows& out,
                  bool forget) {
        if (history.entries.empty()) return;
        const Given given = window_.weigh(history, until, gaps, c);
        window_.smooth(history.entries, c);
        for (const auto& [k, real] : window_.reported()) {
            const Entry& e = history.entries[k];
            out.add(e.t, history.called, window_.mean(k), window_.covariance(k), real, e.used, c);
        }
        if (forget) forget_first(history, given, c);
    }

    static void forget_first(History& history, const Given& given, const ModelConstants& c) {
        std::vector<Entry>& entries = history.entries;
        history.missed = given.missed;
        history.last_later = given.last_later;
        for (std::size_t k = 0; k < given.entries; ++k)
            history.was_real |= entries[k].last_of_step && entries[k].real > c.report;
        entries.erase(entries.begin(), entries.begin() + static_cast<std::ptrdiff_t>(given.entries));
    }

    double lag_s_;
    std::vector<History> living_;
    Rows rows_;
    Window window_;
};

}  // namespace jeat::smoothers
