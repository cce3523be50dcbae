// Binds the tracker's step.
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "association/heaps.hpp"
#include "constants.hpp"
#include "exclusive.hpp"
#include "signals.hpp"
#include "smoothers/histories.hpp"
#include "tracking/life.hpp"
#include "tracking/state_check.hpp"
#include "tracking/step.hpp"

namespace jeat::tracking {

namespace {

using smoothers::Called;
// Time, identity, mean, variance, posterior, sensors, number of the class, its share.
using Table = std::tuple<Out<double>, Out<std::int64_t>, Out2<double>, Out2<double>, Out<double>, Out<std::int64_t>,
                         Out<std::int64_t>, Out<double>>;
using Named = nb::typed<nb::dict, nb::str, nb::object>;

// Tracks and boxes up to which a step is no long one.
constexpr std::size_t kFewRows = 512;

bool finite(std::span<const double> values) {
    for (const double value : values)
        if (!std::isfinite(value)) return false;
    return true;
}

// What is not known is NaN.
bool none_below_0(std::span<const double> values) {
    for (const double value : values)
        if (value < 0.0 || std::isinf(value)) return false;
    return true;
}

// All that the next step depends on, and what the last one gave.
struct Moment {
    State state;
    Answer answer;
};

using Scans = std::tuple<Out<std::int64_t>, Out<std::int64_t>, Out<std::int64_t>, Out2<double>, Out2<double>,
                         Out2<double>, Out2<double>, Out2<double>>;

Scans scans_of(const Record& record, const ModelConstants& c) {
    std::vector<double> transitions, predicted, predicted_covariance, mean, covariance;
    std::array<double, kCovariance> whole;
    double dt = 0.0;
    Matrix still = filters::discretise(dt, c).F;
    for (std::size_t k = 0; k < record.entries.size(); ++k) {
        const smoothers::Entry& entry = record.entries[k];
        if (entry.dt != dt) dt = entry.dt, still = filters::discretise(dt, c).F;
        const Matrix F = filters::in_perspective(still, record.growth[k], dt, c);
        transitions.insert(transitions.end(), F.begin(), F.end());
        predicted.insert(predicted.end(), entry.predicted_mean.begin(), entry.predicted_mean.end());
        smoothers::unfold(entry.predicted_covariance, whole.data());
        predicted_covariance.insert(predicted_covariance.end(), whole.begin(), whole.end());
        mean.insert(mean.end(), entry.mean.begin(), entry.mean.end());
        smoothers::unfold(entry.covariance, whole.data());
        covariance.insert(covariance.end(), whole.begin(), whole.end());
    }
    const std::vector<std::int64_t> sensors(record.sensors.begin(), record.sensors.end());
    const std::vector<std::int64_t> tracks(record.tracks.begin(), record.tracks.end());
    const std::vector<std::int64_t> known(record.known.begin(), record.known.end());
    return {array_of(sensors),
            array_of(tracks),
            array_of(known),
            array_of(transitions, kMatrix),
            array_of(predicted, kMean),
            array_of(predicted_covariance, kCovariance),
            array_of(mean, kMean),
            array_of(covariance, kCovariance)};
}

using Fields = std::tuple<double, bool, Out<double>, Out<std::int64_t>, Out<std::uint8_t>, Out<double>,
                          Out<std::uint8_t>, Out<double>>;

Fields fields_of(const Record& record) {
    std::vector<double> real, missed;
    std::vector<std::int64_t> used;
    std::vector<std::uint8_t> confirmed;
    // Of every scan that has it: tracks keep their places from scan to scan.
    std::vector<double> later(record.track_id.size(), -1.0);
    std::size_t at = 0;
    for (const std::size_t number : record.tracks)
        for (std::size_t i = 0; i < number; ++i) later[i] = std::max(later[i], record.entries[at++].later);
    for (std::size_t k = record.entries.size() - record.track_id.size(); k < record.entries.size(); ++k) {
        const smoothers::Entry& entry = record.entries[k];
        real.push_back(entry.real), used.push_back(entry.used);
        confirmed.push_back(entry.confirmed), missed.push_back(entry.missed);
    }
    return {record.t,         record.is_reset,       array_of(real), array_of(used), array_of(confirmed),
            array_of(missed), array_of(record.kept), array_of(later)};
}

// Gaps that outlasted each bin, and of these those that ended well.
Out2<double> gaps_of(const GapCounts& gaps) {
    std::vector<double> both(gaps.ended.begin(), gaps.ended.end());
    both.insert(both.end(), gaps.ended_well.begin(), gaps.ended_well.end());
    return array_of(both, filters::kGapBins);
}

Table table(const Rows& rows) {
    return std::make_tuple(array_of(rows.t), array_of(rows.track_id), array_of(rows.mean, 2 * kMotion),
                           array_of(rows.variance, 2 * kMotion), array_of(rows.real), array_of(rows.used),
                           array_of(rows.label), array_of(rows.share));
}

// A tracker of the model: its state, its step, and what it keeps for the smoother.
class Model {
public:
    Model(const nb::object& constants, double width, double height, bool known, double lag_s)
        : now_{State(constants_of(constants)), {}}, step_(now_.state), smooths_(lag_s >= 0.0), histories_(lag_s) {
        if (known) now_.state.width = width, now_.state.height = height, now_.state.picture_known = true;
    }
    Model(const Model& other)
        : now_(other.now_), step_(now_.state), smooths_(other.smooths_), histories_(other.histories_),
          record_(other.record_) {}
    Model& operator=(const Model&) = delete;

    Exclusive use;

    void declare_sensor(double even_logit, double score_weight, double lasting,
                        std::optional<double> stationary_prior) {
        now_.state.declare_sensor(even_logit, score_weight, lasting,
                                  stationary_prior.value_or(now_.state.constants.stationary_unseen_share));
    }

    void take(double t, In<std::int64_t> sensors, In<std::int64_t> numbers, In2<double> boxes, In<double> logits,
              const std::optional<In2<double>>& similarity, const std::optional<In<double>>& motion,
              const std::optional<In2<double>>& owners, const std::optional<In2<double>>& box_std) {
        State& state = now_.state;
        check(std::isfinite(t), "no such time");
        check(!state.started || t >= state.t, "a time before that of the last step");
        check_lengths({sensors.size(), numbers.size()});
        check_lengths({boxes.shape(0), logits.size()});
        check(finite(span(boxes)) && finite(span(logits)), "boxes and logits are finite");
        check(boxes.shape(1) == 4, "boxes have four numbers");
        if (similarity) check(similarity->shape(0) == state.tracks.size(), "another number of tracks is compared");
        if (similarity) check_lengths({similarity->shape(1), logits.size()});
        if (similarity) check(finite(span(*similarity)), "similarities are finite");
        if (owners) check_lengths({owners->shape(0), logits.size()});
        if (owners)
            check(owners->shape(1) == 3, "owners are given with whether more of theirs are to come, and a posterior");
        if (owners) check(finite(span(*owners)), "owners are finite");
        if (box_std) check_lengths({box_std->shape(0), logits.size()});
        if (box_std) check(box_std->shape(1) == 4, "spreads have four numbers");
        if (box_std) check(none_below_0(span(*box_std)), "spreads are not below 0");
        std::optional<PictureMotion> moved;
        if (motion) {
            check_lengths({motion->size(), kMotionNumbers});
            moved = PictureMotion::of(motion->data());
            check(moved->span_s > 0.0 && finite(span(*motion)), "a motion takes time");
        }
        scans_.resize(sensors.size());
        std::size_t at = 0;
        for (std::size_t k = 0; k < sensors.size(); ++k) {
            Scan& scan = scans_[k];
            const auto number = static_cast<std::size_t>(numbers.data()[k]);
            scan.sensor = static_cast<std::size_t>(sensors.data()[k]);
            check(scan.sensor < state.sensors.size(), "no such sensor");
            check(number <= logits.size() - at, "fewer boxes than said");
            scan.boxes.clear(), scan.spreads.clear();
            for (std::size_t j = at; j < at + number; ++j) {
                const double* const box = boxes.data() + 4 * j;
                scan.boxes.push_back({box[0], box[1], box[0] + box[2], box[1] + box[3]});
                if (box_std)
                    scan.spreads.push_back(
                        filters::spread_squares(box_std->data() + 4 * j, box[2], box[3], state.constants));
            }
            scan.logits.assign(logits.data() + at, logits.data() + at + number);
            scan.similarity = {nullptr, 0, 0};
            if (similarity) scan.similarity = {similarity->data() + at, similarity->shape(0), similarity->shape(1)};
            scan.owners.clear(), scan.awaited.clear(), scan.later.clear();
            for (std::size_t j = at; owners && j < at + number; ++j) {
                scan.owners.push_back(static_cast<std::int64_t>(owners->data()[3 * j]));
                scan.awaited.push_back(owners->data()[3 * j + 1] > 0.0);
                scan.later.push_back(owners->data()[3 * j + 2]);
            }
            at += number;
        }
        check(at == logits.size(), "more boxes than said");
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
    void run(double t, const PictureMotion* moved) {
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

    // Keep what the last step gave the smoother, for hand_over.
    Record record() { return std::move(record_); }
    Out2<double> gaps() const { return gaps_of(now_.state.gaps); }
    const ModelConstants& constants() const { return now_.state.constants; }
    bool boxes_end_at_edge() const { return now_.state.boxes_end_at_edge(); }

    // Tell the smoother of a step that nothing can come before any more; of the last one without a record.
    void hand_over(const Record* record, std::optional<In<std::int64_t>> given, std::optional<In<std::int64_t>> label,
                   std::optional<In<double>> share) {
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

    void forget(In<std::int64_t> track_id, In<double> until) {
        check_lengths({track_id.size(), until.size()});
        histories_.forget(span(track_id), span(until), now_.state.gaps, now_.state.constants);
    }

    void reset(double t) {
        check(std::isfinite(t), "no such time");
        tracking::reset(now_.state, t);
        now_.answer = {};
        histories_.end_all(now_.state.gaps, now_.state.constants);
    }

    Moment snapshot() const { return now_; }
    void restore(const Moment& moment) { now_ = moment; }
    void number_on_from(std::int64_t identity) { now_.state.next_id = std::max(now_.state.next_id, identity); }

    // The state by name, or that at a moment; with what the smoother holds.
    Named state(const Moment* moment) {
        StateWriter writer;
        Moment copy = moment ? *moment : now_;
        visit_state(writer, copy.state);
        visit_answer(writer, copy.answer);
        visit_histories(writer, histories_);
        return Named(writer.out);
    }
    void set_state(const Named& state) {
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

    Table rows() const { return table(now_.answer.rows); }
    // A copy, for whoever may want the columns later.
    Rows reported() const { return now_.answer.rows; }
    std::tuple<Out2<double>, Out2<double>> states() const {
        return {array_of(now_.answer.mean, kMean), array_of(now_.answer.covariance, kCovariance)};
    }
    Out<std::int64_t> assigned() const { return array_of(now_.answer.assigned); }
    Out<std::int64_t> living() const { return array_of(now_.answer.living); }
    std::tuple<Out<double>, Out<double>, Out<double>> fit() const {
        return {array_of(now_.answer.nis), array_of(now_.answer.noise_scale), array_of(now_.answer.real)};
    }
    Out<std::int64_t> identities() const { return array_of(now_.state.tracks.track_id); }
    std::size_t size() const { return now_.state.tracks.size(); }
    std::int64_t born() const { return now_.state.next_id - 1; }
    std::size_t sensors() const { return now_.state.sensors.size(); }
    std::optional<double> time() const { return now_.state.started ? std::optional(now_.state.t) : std::nullopt; }
    std::tuple<double, double> picture() const { return {now_.state.width, now_.state.height}; }
    Out<double> camera_moved() const {
        const auto& moved = now_.state.camera_path.moved;
        return array_of(std::vector<double>(moved.begin(), moved.end()));
    }
    Out<double> last_scans() const {
        std::vector<double> out;
        for (const Sensor& sensor : now_.state.sensors) out.push_back(sensor.last_scan_s);
        return array_of(out);
    }

    Table smoothed() {
        const auto rows = [&] {
            const nb::gil_scoped_release release;
            const HeedsSignals heeds;
            return histories_.preview(now_.state.gaps, now_.state.constants);
        }();
        return table(rows);
    }
    Table drain() {
        Table out = table(histories_.rows());
        histories_.rows().clear();
        return out;
    }
    // Where a signal ends it, it can be called once more.
    Table finish() {
        {
            const nb::gil_scoped_release release;
            const HeedsSignals heeds;
            histories_.end_all(now_.state.gaps, now_.state.constants);
        }
        return drain();
    }

    Named learnt() const {
        const State& state = now_.state;
        Named out;
        out["p_detect"] = array_of(state.belief.p_detect);
        out["unseen"] = array_of(state.belief.unseen);
        out["stationary_unseen"] = array_of(state.belief.stationary_unseen);
        out["agreed_mean"] = array_of(state.belief.agreed_mean);
        out["agreed_std"] = array_of(state.belief.agreed_std);
        out["agreed_share"] = array_of(state.belief.agreed_share);
        out["score_weight"] = array_of(state.belief.score_weight);
        out["stationary_prior"] = array_of(state.belief.stationary_prior);
        out["decision_threshold"] = array_of(state.belief.decision_threshold);
        out["prior_odds"] = array_of(state.belief.prior_odds);
        std::vector<double> leftovers;
        for (const Sensor& sensor : state.sensors) leftovers.push_back(sensor.leftovers);
        out["leftovers"] = array_of(leftovers);
        std::vector<double> false_boxes;
        for (const Sensor& sensor : state.sensors) false_boxes.push_back(sensor.false_boxes);
        out["false_boxes"] = array_of(false_boxes);
        std::vector<double> at_edge, beyond;
        for (const Sensor& sensor : state.sensors)
            at_edge.push_back(sensor.boxes_at_edge), beyond.push_back(sensor.boxes_beyond);
        out["boxes_at_edge"] = array_of(at_edge);
        out["boxes_beyond"] = array_of(beyond);
        out["noise_share"] = state.belief.noise_share;
        out["log_scene_variance"] = state.started ? state.log_scene_variance() : 0.0;
        std::vector<double> noise = state.noises();
        for (double& variance : noise) variance = log_of(variance);
        out["log_side_variance"] = array_of(noise);
        out["lasting"] = array_of(state.accuracy.lasting);
        std::vector<double> gains;
        for (std::size_t k = 0; k < state.sensors.size(); ++k) gains.push_back(state.spread_noise(k).gain);
        out["log_own_variance"] = array_of(state.log_side_variance);
        out["spread_gain"] = array_of(gains);
        std::vector<double> offsets;
        for (std::size_t k = 0; k < state.sensors.size(); ++k) {
            const auto offset = state.offsets.offset(k, state.noises(), state.constants);
            offsets.insert(offsets.end(), offset.begin(), offset.end());
        }
        out["offsets"] = array_of(offsets, 4);
        const ProcessNoise& q = state.process_noise;
        out["process_noise"] = nb::make_tuple(q.jerk, q.growth, q.position, q.size);
        return out;
    }

    // The tracks as they are now, column by column, for tests: (N, width) each.
    Named tracks() {
        Named out;
        now_.state.tracks.columns([&](const char* name, const auto& column, std::size_t width) {
            using Column = std::remove_cvref_t<decltype(column)>;
            if constexpr (!std::is_same_v<Column, std::vector<Sides>>) out[name] = array_of(column, width);
        });
        return out;
    }

private:
    void write_answer(double t) {
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

    Moment now_;
    Step step_;
    bool smooths_;
    Histories histories_;
    Record record_;
    std::vector<Called> called_;
    std::vector<Scan> scans_;
    std::vector<std::uint8_t> reported_;
};

}  // namespace

void bind(nb::module_& module) {
    module.def(
        "kept_boxes",
        [](In2<double> boxes, In<double> scores, const nb::object& constants) {
            check_lengths({boxes.shape(0), scores.size()});
            check(boxes.shape(1) == 4 && finite(span(boxes)) && finite(span(scores)),
                  "boxes have four sides, and scores");
            const auto number = [&](const char* name) { return nb::cast<double>(constants.attr(name)); };
            const double on_one_spot = number("most_on_one_spot"), overlap = number("spot_overlap");
            const double touching = number("most_touching");
            const std::span<const Sides> sides(reinterpret_cast<const Sides*>(boxes.data()), boxes.shape(0));
            const auto kept = [&] {
                const nb::gil_scoped_release release;
                const HeedsSignals heeds;
                return association::kept_boxes(sides, span(scores), on_one_spot, overlap, touching);
            }();
            return array_of(kept);
        },
        nb::arg("boxes").noconvert(), nb::arg("scores").noconvert(), nb::arg("constants"),
        "Places (K,) of the boxes (M, 4) left, top, right, bottom (px) with scores (M,) that count; see\n"
        "jeat_graph.association.heaps.");
    nb::class_<Record>(module, "Record", "What the filter did in a step, for the smoother.")
        .def(
            "track_ids", [](const Record& record) { return array_of(record.track_id); },
            "Identities of the tracks after it, before any ended (N,).")
        .def(
            "__deepcopy__", [](const Record& record, const nb::object&) { return new Record(record); }, nb::arg("memo"),
            "The same once more.")
        .def(
            "scans", [](const Record& record, const Model& model) { return scans_of(record, model.constants()); },
            nb::arg("model"),
            "Scan by scan, in the order they were taken in: index of the sensor (K,), number of tracks after it (K,),\n"
            "and of those among them that had been born before (K,); of these, one scan after the other, the transition (E, 49) from the record before, both axes in one, and mean\n"
            "(E, 14) and covariance (E, 98) before the update, and after it.")
        .def(
            "fields", &fields_of,
            "Time (s), whether all tracks had ended before; of the tracks (N,) their posterior, the sensors that found\n"
            "them, whether one of these confirms that they are there, the detections missed since, and whether they live on.")
        .def(
            "gaps", [](const Record& record) { return gaps_of(record.gaps); },
            "Gaps that outlasted each bin, and those that ended well (2, 9), before tracks ended.")
        .def("gaps_after", [](const Record& record) { return gaps_of(record.gaps_after); }, "The same after it.");
    nb::class_<Moment>(module, "Moment", "All that the next step depends on; the smoother is no part of it.")
        .def(
            "__deepcopy__", [](const Moment& moment, const nb::object&) { return new Moment(moment); }, nb::arg("memo"),
            "The same once more.")
        .def(
            "identities", [](const Moment& moment) { return array_of(moment.state.tracks.track_id); },
            "Identities of the living tracks (N,).")
        .def(
            "born", [](const Moment& moment) { return moment.state.next_id - 1; },
            "Number of tracks started before it.");
    nb::class_<Rows>(module, "Rows", "The tracks that a step reports.")
        .def("columns", &table, "As Model.rows has them, also after later steps.");
    nb::class_<Model>(module, "Model", "The tracker's state and its step; see jeat_graph.tracking.reference.")
        .def(nb::init<const nb::object&, double, double, bool, double>(), nb::arg("constants"), nb::arg("width"),
             nb::arg("height"), nb::arg("known"), nb::arg("lag_s"),
             "constants: a ModelConstants; width, height: of the picture (px), if known; lag_s: of the smoother (s),\n"
             "infinite for whole tracks, negative for none.")
        .def(
            "declare_sensor", exclusive(&Model::declare_sensor),
            nb::arg("even_logit") = std::numeric_limits<double>::quiet_NaN(),
            nb::arg("score_weight") = std::numeric_limits<double>::quiet_NaN(),
            nb::arg("lasting") = std::numeric_limits<double>::quiet_NaN(), nb::arg("stationary_prior") = nb::none(),
            "Add a sensor that has had no scan yet. even_logit: of the score at which a box is as likely real as not,\n"
            "NaN where it is to be learnt; score_weight: of its scores as evidence, NaN likewise; lasting: variance of what lasts of\n"
            "its errors (sizes²), NaN where it is to be learnt; stationary_prior: share of objects that it does not see while\n"
            "they stand, by what the sensor is.")
        .def(
            "take", exclusive(&Model::take), nb::arg("t"), nb::arg("sensors").noconvert(),
            nb::arg("numbers").noconvert(), nb::arg("boxes").noconvert(), nb::arg("logits").noconvert(),
            nb::arg("similarity").noconvert() = nb::none(), nb::arg("motion").noconvert() = nb::none(),
            nb::arg("owners").noconvert() = nb::none(), nb::arg("box_std").noconvert() = nb::none(),
            "Take in the scans of one time t (s): sensors (K,), numbers of boxes of each (K,), all boxes (M, 4) left,\n"
            "top, width, height (px), logits of their scores (M,); similarity (N, M): how much more likely each box is of a\n"
            "living track than of another by what both look like, as ln of the ratio; motion (11,): of the camera since\n"
            "its picture before, see jeat_graph.filters.picture_motion.PictureMotion; owners (M, 3): whose each box is,\n"
            "where that is given, below 0 for nobody's, at most one box of a scan each, and 1 where more of its owner's are\n"
            "to come, and the posterior of an object there by what comes later, for the smoother, below 0 where it is not\n"
            "known. A track of an owner takes no box but its own, and lives as long as it is awaited; box_std (M, 4): standard\n"
            "deviations of left, top, right, bottom by the detector (px), NaN where unknown.")
        .def("record", exclusive(&Model::record), "What the last step gave the smoother; once.")
        .def(
            "hand_over", exclusive(&Model::hand_over), nb::arg("record").none() = nb::none(),
            nb::arg("given").noconvert() = nb::none(), nb::arg("label").noconvert() = nb::none(),
            nb::arg("share").noconvert() = nb::none(),
            "Tell the smoother of a step (of the last one without a record), in order of time: the identity given out\n"
            "for each of its tracks (N,), the number of its class, below 0 for none, and the share of its votes.")
        .def("forget", exclusive(&Model::forget), nb::arg("track_id").noconvert(), nb::arg("until").noconvert(),
             "Have no smoothed rows of tracks, by ascending identities (K,), up to a time (K,) each (s).")
        .def("reset", exclusive(&Model::reset), nb::arg("t"),
             "End all tracks and go on from another time (s), as if none had passed; what was learnt stays.")
        .def("snapshot", exclusive(&Model::snapshot), "A copy of all that the next step depends on.")
        .def("restore", exclusive(&Model::restore), nb::arg("moment"), "Go back to a snapshot of this model.")
        .def("number_on_from", exclusive(&Model::number_on_from), nb::arg("identity"),
             "Give no new track a smaller identity.")
        .def("state", exclusive(&Model::state), nb::arg("moment").none() = nb::none(),
             "Everything as arrays by name, the smoother's too; that at a moment, if one is given.")
        .def("set_state", exclusive(&Model::set_state), nb::arg("state"),
             "Go on from what state() returned. ValueError: it is not what a model can be in; nothing is changed then.")
        .def("rows", exclusive(&Model::rows),
             "Reported tracks: t, identity, mean (N, 10), variance (N, 10), posterior, sensors, class, its share.")
        .def("reported", exclusive(&Model::reported), "What rows() returns, to be made columns when they are wanted.")
        .def("states", exclusive(&Model::states),
             "Their states: means (N, 14), and covariances (N, 98): two axes of 7 x 7.")
        .def("fit", exclusive(&Model::fit),
             "Of the boxes of the last step the squared distance of the centre (M,), NaN where it began a track, and\n"
             "the scale of the sensor's noise (M,); the posteriors (N,) of the tracks in living().")
        .def("identities", exclusive(&Model::identities), "Identities of the living tracks (N,).")
        .def("sensors", exclusive(&Model::sensors), "Number of sensors.")
        .def("time", exclusive(&Model::time), "Time of the last step (s); None before the first.")
        .def("picture", exclusive(&Model::picture), "Width and height of the picture (px), as far as is known.")
        .def("camera_moved", exclusive(&Model::camera_moved),
             "How far the camera's motion has taken a point at rest (2,) (px).")
        .def("last_scans", exclusive(&Model::last_scans), "Time of each sensor's last scan (s), NaN before it.")
        .def(
            "__deepcopy__",
            [](Model& model, const nb::object&) {
                const Exclusive::Hold hold(model.use);
                return new Model(model);
            },
            nb::arg("memo"), "A model of its own in the same state.")
        .def("assigned", exclusive(&Model::assigned),
             "Identity of the track that each box of the last step was assigned to (M,).")
        .def("living", exclusive(&Model::living), "Identities of the tracks of the last step, before any ended (N,).")
        .def("size", exclusive(&Model::size), "Number of living tracks.")
        .def("born", exclusive(&Model::born), "Number of tracks started so far.")
        .def("boxes_end_at_edge", exclusive(&Model::boxes_end_at_edge),
             "Whether boxes end at the edge of the picture more often than they reach beyond it.")
        .def("smoothed", exclusive(&Model::smoothed), "Smoothed rows so far, columns as those of rows.")
        .def("drain", exclusive(&Model::drain), "Smoothed rows that have become final; they are forgotten.")
        .def("finish", exclusive(&Model::finish), "The same, all tracks being ended.")
        .def("gaps", exclusive(&Model::gaps), "Gaps that outlasted each bin, and those that ended well (2, 9).")
        .def("learnt", exclusive(&Model::learnt), "What is believed of the sensors and the scene, by name.")
        .def("tracks", exclusive(&Model::tracks), "Columns of the living tracks, by name.");
}

}  // namespace jeat::tracking
