// The state as arrays by name, and back: for files. A visitor walks over all members in one order, so what is written
// is what is read; a member that it does not name does not compile.
#pragma once

#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include "arrays.hpp"
#include "smoothers/histories.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

using smoothers::Entry;
using smoothers::Histories;
using smoothers::History;
using smoothers::Rows;

// What the last step gave out.
struct Answer {
    Rows rows;                                   // of the tracks that are reported
    std::vector<double> mean, covariance;        // states of these
    std::vector<std::int64_t> assigned, living;  // of all boxes; the tracks before any ended
    std::vector<double> real;                    // posteriors of these
    std::vector<double> nis, noise_scale;        // of all boxes
};

// Numbers that may be infinite or none: what has never been.
enum class Values { finite, any };

// Greater numbers than this come from no scan: products of four of them are still finite.
inline constexpr double kMostNumber = 1e70;
// A side of e^50 px, or one that grows so fast, comes from no scan either.
inline constexpr double kMostLogSize = 50.0;
inline constexpr std::size_t kMostRows = std::size_t{1} << 31;

template <class T> Buffer<T> copied(const std::vector<T>& source) {
    Buffer<T> out(source.size());
    std::copy(source.begin(), source.end(), out.data.get());
    return out;
}
template <class T> Out<T> array_of(const std::vector<T>& source) { return handed_over(copied(source)); }
template <class T> Out2<T> array_of(const std::vector<T>& source, std::size_t columns) {
    return handed_over(copied(source), columns ? source.size() / columns : 0, columns);
}

class StateWriter {
public:
    nb::dict out;

    template <class T> void column(const std::string& name, std::vector<T>& values, std::size_t rows, std::size_t width,
                                   Values = Values::finite) {
        (void)rows;
        if constexpr (std::is_same_v<T, Sides>) {
            std::vector<double> flat(values.size() * 4);
            for (std::size_t k = 0; k < values.size(); ++k) {
                const Sides& b = values[k];
                const double sides[] = {b.left, b.top, b.right, b.bottom};
                std::copy(sides, sides + 4, flat.begin() + static_cast<std::ptrdiff_t>(4 * k));
            }
            out[name.c_str()] = array_of(flat, 4 * width);
        } else {
            out[name.c_str()] = array_of(values, width);
        }
    }
    void numbers(const std::string& name, double* values, std::size_t count, Values = Values::finite) {
        out[name.c_str()] = array_of(std::vector<double>(values, values + count));
    }
    template <class T> void whole(const std::string& name, T& value) {
        out[name.c_str()] = array_of(std::vector<std::int64_t>{static_cast<std::int64_t>(value)});
    }
};

// Throws std::invalid_argument, which is ValueError in Python, where something cannot be.
class StateReader {
public:
    explicit StateReader(nb::dict source) : source_(std::move(source)) {}

    template <class T> void column(const std::string& name, std::vector<T>& values, std::size_t rows, std::size_t width,
                                   Values kind = Values::finite) {
        if constexpr (std::is_same_v<T, Sides>) {
            std::vector<double> flat;
            column(name, flat, rows, 4 * width, kind);
            values.resize(flat.size() / 4);
            for (std::size_t k = 0; k < values.size(); ++k)
                values[k] = {flat[4 * k], flat[4 * k + 1], flat[4 * k + 2], flat[4 * k + 3]};
        } else {
            const auto array = of<T>(name);
            require(rows <= kMostRows && array.size() == rows * width, name, "has another length");
            values.assign(array.data(), array.data() + array.size());
            if constexpr (std::is_same_v<T, double>) check_values(name, values.data(), values.size(), kind);
        }
    }
    void numbers(const std::string& name, double* values, std::size_t count, Values kind = Values::finite) {
        const auto array = of<double>(name);
        require(array.size() == count, name, "has another length");
        std::copy(array.data(), array.data() + count, values);
        check_values(name, values, count, kind);
    }
    template <class T> void whole(const std::string& name, T& value) {
        const auto array = of<std::int64_t>(name);
        require(array.size() == 1, name, "has another length");
        if constexpr (std::is_same_v<T, bool>) {
            require(array.data()[0] == 0 || array.data()[0] == 1, name, "is neither true nor false");
        } else {
            require(array.data()[0] >= 0, name, "is below 0");
        }
        value = static_cast<T>(array.data()[0]);
    }
    static void require(bool holds, const std::string& name, const char* what) {
        if (!holds) throw std::invalid_argument(name + " " + what);
    }

private:
    template <class T> nb::ndarray<const T, nb::numpy, nb::c_contig, nb::device::cpu> of(const std::string& name) {
        using Array = nb::ndarray<const T, nb::numpy, nb::c_contig, nb::device::cpu>;
        require(source_.contains(name.c_str()), name, "is missing");
        Array array;
        require(nb::try_cast<Array>(source_[name.c_str()], array, false), name, "is no array of its kind");
        return array;
    }
    static void check_values(const std::string& name, const double* values, std::size_t count, Values kind) {
        if (kind == Values::any) return;
        for (std::size_t k = 0; k < count; ++k)
            require(std::abs(values[k]) <= kMostNumber, name, "holds what is no number of a state");
    }

    nb::dict source_;
};

template <class Visitor, class Table>
void visit_table(Visitor& v, const std::string& prefix, Table& table, std::size_t rows) {
    table.columns([&](const char* name, auto& column, std::size_t width) {
        // Of times is known elsewhere what they may be; they are never multiplied.
        v.column(prefix + name, column, rows, width,
                 std::string_view(name).ends_with("_s") ? Values::any : Values::finite);
    });
}

template <class Visitor> void visit_sensor(Visitor& v, const std::string& prefix, Sensor& sensor) {
    auto& [leftovers, false_boxes, boxes_at_edge, boxes_beyond, period_s, last_scan_s, repetition, even_logit,
           given_weight, given_lasting, mean_spread] = sensor;
    v.numbers(prefix + "leftovers", &leftovers, 1);
    v.numbers(prefix + "false_boxes", &false_boxes, 1);
    v.numbers(prefix + "boxes_at_edge", &boxes_at_edge, 1);
    v.numbers(prefix + "boxes_beyond", &boxes_beyond, 1);
    v.numbers(prefix + "period_s", &period_s, 1, Values::any);
    v.numbers(prefix + "last_scan_s", &last_scan_s, 1, Values::any);
    v.numbers(prefix + "even_logit", &even_logit, 1, Values::any);
    v.numbers(prefix + "given_weight", &given_weight, 1, Values::any);
    v.numbers(prefix + "given_lasting", &given_lasting, 1, Values::any);
    v.numbers(prefix + "mean_spread", &mean_spread, 1, Values::any);
    auto& [boxes, repeated, logits, scans, last_boxes, last_logits, last_had_before, has_last] = repetition;
    std::size_t rows = last_boxes.size();
    v.whole(prefix + "rows", rows);
    v.numbers(prefix + "boxes", boxes.data(), boxes.size());
    v.numbers(prefix + "repeated", repeated.data(), repeated.size());
    auto& [pairs, before, after, before_squared, after_squared, product] = logits;
    v.numbers(prefix + "logits.pairs", &pairs, 1);
    v.numbers(prefix + "logits.before", &before, 1);
    v.numbers(prefix + "logits.after", &after, 1);
    v.numbers(prefix + "logits.before_squared", &before_squared, 1);
    v.numbers(prefix + "logits.after_squared", &after_squared, 1);
    v.numbers(prefix + "logits.product", &product, 1);
    v.whole(prefix + "scans", scans);
    v.column(prefix + "last_boxes", last_boxes, rows, 1);
    v.column(prefix + "last_logits", last_logits, rows, 1);
    v.column(prefix + "last_had_before", last_had_before, rows, 1);
    v.whole(prefix + "has_last", has_last);
}

template <class Visitor> void visit_state(Visitor& v, State& state) {
    auto& [constants, tracks, t, started, next_id, width, height, picture_known, process_noise, camera, camera_velocity,
           camera_path, gaps, belief, offsets, accuracy, log_side_variance, sensors, ended, learnt_s] = state;
    (void)constants;  // the caller's
    std::size_t S = sensors.size(), rows = tracks.size(), ended_rows = ended.size();
    v.whole("sensors", S);
    StateReader::require(S < 64, "sensors", "are too many");
    sensors.resize(S);
    tracks.evidence.sensors = ended.sensors = offsets.sensors = S;
    for (std::size_t k = 0; k < S; ++k) visit_sensor(v, "sensor" + std::to_string(k) + ".", sensors[k]);
    v.whole("tracks", rows);
    visit_table(v, "tracks.", tracks, rows);
    v.whole("ended", ended_rows);
    visit_table(v, "ended.", ended, ended_rows);
    v.numbers("t", &t, 1, Values::any);
    v.whole("started", started);
    v.whole("next_id", next_id);
    v.numbers("width", &width, 1);
    v.numbers("height", &height, 1);
    v.whole("picture_known", picture_known);
    auto& [jerk, growth, position, size] = process_noise;
    v.numbers("process_noise.jerk", &jerk, 1);
    v.numbers("process_noise.growth", &growth, 1);
    v.numbers("process_noise.position", &position, 1);
    v.numbers("process_noise.size", &size, 1);
    auto& [shift, scale, last] = camera;
    v.numbers("camera.shift", &shift, 1);
    v.numbers("camera.scale", &scale, 1);
    v.numbers("camera.last", last.data(), last.size());
    auto& [rate, picture_s, until_s] = camera_velocity;
    v.numbers("camera.centre", rate.centre.data(), rate.centre.size());
    v.numbers("camera.rate", rate.theta.data(), rate.theta.size());
    v.numbers("camera.picture_s", &picture_s, 1, Values::any);
    v.numbers("camera.until_s", &until_s, 1, Values::any);
    auto& [moved, velocity] = camera_path;
    v.numbers("camera.moved", moved.data(), moved.size());
    v.numbers("camera.velocity", velocity.data(), velocity.size());
    auto& [gaps_ended, ended_well] = gaps;
    v.numbers("gaps.ended", gaps_ended.data(), gaps_ended.size());
    v.numbers("gaps.ended_well", ended_well.data(), ended_well.size());
    auto& [p_detect, unseen, stationary_unseen, decision_threshold, prior_odds, agreed_mean, agreed_std, agreed_share,
           score_weight, stationary_prior, noise_share] = belief;
    v.column("belief.agreed_mean", agreed_mean, S, 1);
    v.column("belief.agreed_std", agreed_std, S, 1);
    v.column("belief.agreed_share", agreed_share, S, 1);
    v.column("belief.score_weight", score_weight, S, 1);
    v.column("belief.stationary_prior", stationary_prior, S, 1);
    v.column("belief.p_detect", p_detect, S, 1);
    v.column("belief.unseen", unseen, S, 1);
    v.column("belief.stationary_unseen", stationary_unseen, S, 1);
    v.column("belief.decision_threshold", decision_threshold, S, 1);
    v.column("belief.prior_odds", prior_odds, S, 1);
    v.numbers("belief.noise_share", &noise_share, 1);
    auto& [offset_sensors, weight, total] = offsets;
    (void)offset_sensors;
    v.column("offsets.weight", weight, S * S, 1);
    v.column("offsets.total", total, S * S, 4);
    auto& [pairs, product, lasting] = accuracy;
    v.column("accuracy.pairs", pairs, S * S, 1);
    v.column("accuracy.product", product, S * S, 1);
    v.column("accuracy.lasting", lasting, S, 1);
    v.column("log_side_variance", log_side_variance, S, 1);
    v.numbers("learnt_s", &learnt_s, 1, Values::any);
}

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
