// What a step gave out and what the smoother holds, as arrays by name, and back; as saved_state.hpp.
#pragma once

#include <string>
#include <type_traits>
#include <vector>

#include "smoothers/histories.hpp"
#include "tracking/answer.hpp"
#include "tracking/saving.hpp"

namespace jeat::tracking {

using smoothers::Entry;
using smoothers::Histories;
using smoothers::History;

template <class Visitor> void visit_rows(Visitor& v, const std::string& prefix, Rows& table) {
    auto& [t, mean, variance, real, share, track_id, used, label] = table;
    std::size_t rows = track_id.size();
    v.whole(prefix + "rows", rows);
    v.column(prefix + "t", t, rows, 1, Values::any);
    v.column(prefix + "track_id", track_id, rows, 1);
    v.column(prefix + "mean", mean, rows, 2 * kMotion);
    v.column(prefix + "variance", variance, rows, 2 * kMotion);
    v.column(prefix + "real", real, rows, 1);
    v.column(prefix + "used", used, rows, 1);
    v.column(prefix + "label", label, rows, 1);
    v.column(prefix + "share", share, rows, 1, Values::any);
}

template <class Visitor> void visit_answer(Visitor& v, Answer& answer) {
    auto& [rows, mean, covariance, assigned, living, real, nis, noise_scale] = answer;
    visit_rows(v, "answer.", rows);
    std::size_t boxes = assigned.size(), tracks = living.size();
    v.whole("answer.boxes", boxes);
    v.whole("answer.tracks", tracks);
    v.column("answer.state", mean, rows.size(), kMean);
    v.column("answer.covariance", covariance, rows.size(), kCovariance);
    v.column("answer.assigned", assigned, boxes, 1);
    v.column("answer.living", living, tracks, 1);
    v.column("answer.real_of_living", real, tracks, 1);
    v.column("answer.nis", nis, boxes, 1, Values::any);
    v.column("answer.noise_scale", noise_scale, boxes, 1);
}

inline constexpr std::size_t kWide = 2 * smoothers::kHalf;

// The entries of all histories in columns.
struct EntryColumns {
    std::vector<double> t, dt, real, later, missed, predicted_mean, mean, predicted_covariance, covariance;
    std::vector<std::int64_t> used;
    std::vector<std::uint8_t> confirmed, last_of_step;

    void reserve(std::size_t entries) {
        for (auto* one : {&predicted_mean, &mean}) one->reserve(entries * kMean);
        for (auto* one : {&predicted_covariance, &covariance}) one->reserve(entries * kWide);
    }
    void add(Entry& entry) {
        auto& [at, since, posterior, by_later, sensors, sure, gap, last, m0, m1, p0, p1] = entry;
        t.push_back(at), dt.push_back(since), real.push_back(posterior), later.push_back(by_later);
        used.push_back(sensors), confirmed.push_back(sure), missed.push_back(gap), last_of_step.push_back(last);
        predicted_mean.insert(predicted_mean.end(), m0.begin(), m0.end());
        mean.insert(mean.end(), m1.begin(), m1.end());
        predicted_covariance.insert(predicted_covariance.end(), p0.begin(), p0.end());
        covariance.insert(covariance.end(), p1.begin(), p1.end());
    }
    Entry at(std::size_t k) const {
        Entry entry;
        entry.t = t[k], entry.dt = dt[k], entry.real = real[k], entry.later = later[k];
        entry.used = used[k], entry.confirmed = confirmed[k], entry.missed = missed[k],
        entry.last_of_step = last_of_step[k];
        std::copy_n(&predicted_mean[k * kMean], kMean, entry.predicted_mean.begin());
        std::copy_n(&mean[k * kMean], kMean, entry.mean.begin());
        std::copy_n(&predicted_covariance[k * kWide], kWide, entry.predicted_covariance.begin());
        std::copy_n(&covariance[k * kWide], kWide, entry.covariance.begin());
        return entry;
    }
};

template <class Visitor> void visit_histories(Visitor& v, Histories& histories) {
    std::vector<History>& living = histories.living();
    std::vector<std::int64_t> track_id, given, label, counts;
    std::vector<double> share, given_missed, last_later;
    std::vector<std::uint8_t> was_real;
    EntryColumns columns;
    std::size_t expected = 0;
    for (const History& history : living) expected += history.entries.size();
    columns.reserve(expected);
    for (History& history : living) {
        auto& [id, called, out, after, real, entries] = history;
        track_id.push_back(id), given.push_back(called.track_id), label.push_back(called.label);
        share.push_back(called.share), given_missed.push_back(out), last_later.push_back(after);
        was_real.push_back(real);
        counts.push_back(static_cast<std::int64_t>(entries.size()));
        for (Entry& entry : entries) columns.add(entry);
    }
    std::size_t tracks = living.size(), total = columns.t.size();
    v.whole("histories.tracks", tracks);
    v.whole("histories.entries", total);
    v.column("histories.track_id", track_id, tracks, 1);
    v.column("histories.given", given, tracks, 1);
    v.column("histories.label", label, tracks, 1);
    v.column("histories.counts", counts, tracks, 1);
    v.column("histories.share", share, tracks, 1, Values::any);
    v.column("histories.given_missed", given_missed, tracks, 1);
    v.column("histories.last_later", last_later, tracks, 1);
    v.column("histories.was_real", was_real, tracks, 1);
    v.column("histories.t", columns.t, total, 1, Values::any);
    v.column("histories.dt", columns.dt, total, 1);
    v.column("histories.real", columns.real, total, 1);
    v.column("histories.later", columns.later, total, 1);
    v.column("histories.used", columns.used, total, 1);
    v.column("histories.confirmed", columns.confirmed, total, 1);
    v.column("histories.missed", columns.missed, total, 1);
    v.column("histories.last_of_step", columns.last_of_step, total, 1);
    v.column("histories.predicted_mean", columns.predicted_mean, total, kMean);
    v.column("histories.mean", columns.mean, total, kMean);
    v.column("histories.predicted_covariance", columns.predicted_covariance, total, kWide);
    v.column("histories.covariance", columns.covariance, total, kWide);
    visit_rows(v, "final.", histories.rows());
    if constexpr (std::is_same_v<Visitor, StateReader>) {
        living.assign(tracks, {});
        std::size_t at = 0;
        for (std::size_t i = 0; i < tracks; ++i) {
            const auto count = static_cast<std::size_t>(counts[i]);
            StateReader::require(counts[i] >= 0 && count <= total - at, "histories.counts", "do not add up");
            History& history = living[i];
            history.track_id = track_id[i];
            history.called = {given[i], label[i], share[i]};
            history.missed = given_missed[i];
            history.last_later = last_later[i];
            history.was_real = was_real[i] != 0;
            for (std::size_t k = 0; k < count; ++k) history.entries.push_back(columns.at(at + k));
            at += count;
        }
        StateReader::require(at == total, "histories.counts", "do not add up");
    }
}

}  // namespace jeat::tracking
