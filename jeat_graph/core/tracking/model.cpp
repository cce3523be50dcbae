#include "tracking/model.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "constants.hpp"
#include "signals.hpp"
#include "tracking/life.hpp"
#include "tracking/saved_histories.hpp"
#include "tracking/saved_state.hpp"
#include "tracking/state_check.hpp"

namespace jeat::tracking {

namespace {

// Tracks and boxes up to which a step is no long one.
constexpr std::size_t kFewRows = 512;

}  // namespace

Model::Model(const nb::object& constants, double width, double height, bool known, double lag_s)
    : now_{State(constants_of(constants)), {}}, step_(now_.state), smooths_(lag_s >= 0.0), histories_(lag_s) {
    if (known) now_.state.width = width, now_.state.height = height, now_.state.picture_known = true;
}

Model::Model(const Model& other)
    : now_(other.now_), step_(now_.state), smooths_(other.smooths_), histories_(other.histories_),
      record_(other.record_) {}

void Model::declare_sensor(double even_logit, double score_weight, double lasting,
                           std::optional<double> stationary_prior) {
    now_.state.declare_sensor(even_logit, score_weight, lasting,
                              stationary_prior.value_or(now_.state.constants.stationary_unseen_share));
}

void Model::take(double t, In<std::int64_t> sensors, In<std::int64_t> numbers, In2<double> boxes, In<double> logits,
                 const std::optional<In2<double>>& similarity, const std::optional<In<double>>& motion,
                 const std::optional<In2<double>>& owners, const std::optional<In2<double>>& box_std) {
    const Given given{t, sensors, numbers, boxes, logits, similarity, motion, owners, box_std};
    const State& state = now_.state;
    check_given(given, state);
    const std::optional<PictureMotion> moved = motion_of(given);
    fill_scans(given, state, scans_);
    const nb::gil_scoped_release release;
    const auto motion_given = moved ? &*moved : nullptr;
    if (state.tracks.size() + logits.size() <= kFewRows) return run(t, motion_given);
    // A long step is ended by signals, and has not been then.
    const Moment before = now_;
    const HeedsSignals heeds;
    try {
        run(t, motion_given);
    } catch (...) {
        now_ = before;
        throw;
    }
}

void Model::run(double t, const PictureMotion* moved) {
    const State& state = now_.state;
    Record* const record = smooths_ ? &record_ : nullptr;
    const bool is_reset = state.started && t - state.t >= kLongestSilenceS;
    // Time goes on from before the moment that it was to go on from.
    if (!state.started && t < state.t) tracking::reset(now_.state, t);
    record_.begin(t);
    if (is_reset) record_.is_reset = true, tracking::reset(now_.state, t);
    for (Scan& scan : scans_)
        if (is_reset) scan.similarity = {nullptr, 0, 0};
    step_.run(t, scans_, is_reset ? nullptr : moved, reported_, record);
    write_answer(t);
    end_tracks(now_.state, record);
}

void Model::write_answer(double t) {
    Tracks& tracks = now_.state.tracks;
    Answer& answer = now_.answer;
    answer.assigned.clear(), answer.nis.clear(), answer.noise_scale.clear();
    for (const Scan& scan : scans_) {
        answer.assigned.insert(answer.assigned.end(), scan.assigned.begin(), scan.assigned.end());
        answer.nis.insert(answer.nis.end(), scan.nis.begin(), scan.nis.end());
        answer.noise_scale.insert(answer.noise_scale.end(), scan.noise_scale.begin(), scan.noise_scale.end());
    }
    answer.living = tracks.track_id;
    answer.real = tracks.real;
    answer.rows.clear();
    answer.mean.clear(), answer.covariance.clear();
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        if (!reported_[i]) continue;
        const double* const covariance = tracks.covariance_of(i);
        answer.rows.add(t, {tracks.track_id[i]}, tracks.mean_of(i), covariance, tracks.real[i], tracks.used[i],
                        now_.state.constants);
        answer.mean.insert(answer.mean.end(), tracks.mean_of(i), tracks.mean_of(i) + kMean);
        answer.covariance.insert(answer.covariance.end(), covariance, covariance + kCovariance);
    }
}

void Model::reset(double t) {
    check(std::isfinite(t), "no such time");
    tracking::reset(now_.state, t);
    now_.answer = {};
    histories_.end_all(now_.state.gaps, now_.state.constants);
}

void Model::hand_over(const Record* record, std::optional<In<std::int64_t>> given,
                      std::optional<In<std::int64_t>> label, std::optional<In<double>> share) {
    const Record& chosen = record ? *record : record_;
    const std::size_t n = chosen.track_id.size();
    if (given) check_lengths({n, given->size()});
    if (label) check_lengths({n, label->size()});
    if (share) check_lengths({n, share->size()});
    called_.resize(n);
    for (std::size_t i = 0; i < n; ++i)
        called_[i] = {given ? given->data()[i] : chosen.track_id[i], label ? label->data()[i] : -1,
                      share ? share->data()[i] : 0.0};
    const nb::gil_scoped_release release;
    histories_.take(chosen, called_, now_.state.constants);
}

void Model::forget(In<std::int64_t> track_id, In<double> until) {
    check_lengths({track_id.size(), until.size()});
    histories_.forget(span(track_id), span(until), now_.state.gaps, now_.state.constants);
}

Table Model::smoothed() {
    const auto rows = [&] {
        const nb::gil_scoped_release release;
        const HeedsSignals heeds;
        return histories_.preview(now_.state.gaps, now_.state.constants);
    }();
    return table(rows);
}

Table Model::drain() {
    Table out = table(histories_.rows());
    histories_.rows().clear();
    return out;
}

Table Model::finish() {
    {
        const nb::gil_scoped_release release;
        const HeedsSignals heeds;
        histories_.end_all(now_.state.gaps, now_.state.constants);
    }
    return drain();
}

Named Model::state(const Moment* moment) {
    StateWriter writer;
    Moment copy = moment ? *moment : now_;
    visit_state(writer, copy.state);
    visit_answer(writer, copy.answer);
    visit_histories(writer, histories_);
    return Named(writer.out);
}

void Model::set_state(const Named& state) {
    StateReader reader(state);
    Moment read{State(now_.state.constants), {}};
    Histories histories = histories_;
    visit_state(reader, read.state);
    visit_answer(reader, read.answer);
    visit_histories(reader, histories);
    check_state(read.state, read.answer);
    check_histories(histories, read.state, smooths_);
    now_ = std::move(read);
    histories_ = std::move(histories);
}

void Model::number_on_from(std::int64_t identity) { now_.state.next_id = std::max(now_.state.next_id, identity); }

std::tuple<Out2<double>, Out2<double>> Model::states() const {
    return {array_of(now_.answer.mean, kMean), array_of(now_.answer.covariance, kCovariance)};
}

std::tuple<Out<double>, Out<double>, Out<double>> Model::fit() const {
    return {array_of(now_.answer.nis), array_of(now_.answer.noise_scale), array_of(now_.answer.real)};
}

Out<double> Model::camera_moved() const {
    const auto& moved = now_.state.camera_path.moved;
    return array_of(std::vector<double>(moved.begin(), moved.end()));
}

Out<double> Model::last_scans() const {
    std::vector<double> out;
    out.reserve(now_.state.sensors.size());
    for (const Sensor& sensor : now_.state.sensors) out.push_back(sensor.last_scan_s);
    return array_of(out);
}

}  // namespace jeat::tracking
