// Binds the tracker's step.
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "smoothers/histories.hpp"
#include "tracking/step.hpp"

namespace jeat::tracking {

namespace {

using smoothers::Rows;
// Time, identity, mean, variance, posterior, sensors.
using Table = std::tuple<Out<double>, Out<std::int64_t>, Out2<double>, Out2<double>, Out<double>, Out<std::int64_t>>;
using Named = nb::typed<nb::dict, nb::str, nb::any>;

template <class T> Buffer<T> copied(const std::vector<T>& source) {
    Buffer<T> out(source.size());
    std::copy(source.begin(), source.end(), out.data.get());
    return out;
}

template <class T> Out<T> array_of(const std::vector<T>& source) { return handed_over(copied(source)); }
template <class T> Out2<T> array_of(const std::vector<T>& source, std::size_t columns) {
    return handed_over(copied(source), columns ? source.size() / columns : 0, columns);
}

// A tracker of the model: its state, its step, and what it keeps for the smoother.
class Model {
public:
    Model(const nb::object& constants, double width, double height, bool known, double lag_s)
        : state_(constants_of(constants)), step_(state_), smooths_(lag_s >= 0.0), histories_(lag_s) {
        if (known) state_.width = width, state_.height = height, state_.picture_known = true;
    }
    Model(const Model&) = delete;
    Model& operator=(const Model&) = delete;

    void declare_sensor() { state_.declare_sensor(); }

    void take(double t, In<std::int64_t> sensors, In<std::int64_t> numbers, In2<double> boxes, In<double> logits) {
        check_lengths({sensors.size(), numbers.size()});
        check_lengths({boxes.shape(0), logits.size()});
        check(boxes.shape(1) == 4, "boxes have four sides");
        scans_.resize(sensors.size());
        std::size_t at = 0;
        for (std::size_t k = 0; k < sensors.size(); ++k) {
            Scan& scan = scans_[k];
            const auto number = static_cast<std::size_t>(numbers.data()[k]);
            scan.sensor = static_cast<std::size_t>(sensors.data()[k]);
            check(scan.sensor < state_.sensors.size(), "no such sensor");
            check(number <= logits.size() - at, "fewer boxes than said");
            const Sides* const first = reinterpret_cast<const Sides*>(boxes.data()) + at;
            scan.boxes.assign(first, first + number);
            scan.logits.assign(logits.data() + at, logits.data() + at + number);
            at += number;
        }
        check(at == logits.size(), "more boxes than said");
        const nb::gil_scoped_release release;
        Histories* const histories = smooths_ ? &histories_ : nullptr;
        step_.run(t, scans_, reported_, histories);
        takers_.clear();
        for (const Scan& scan : scans_) takers_.insert(takers_.end(), scan.takers.begin(), scan.takers.end());
        Tracks& tracks = state_.tracks;
        living_ = tracks.track_id;
        rows_.clear();
        for (std::size_t i = 0; i < tracks.size(); ++i)
            if (reported_[i])
                rows_.add(t, tracks.track_id[i], tracks.mean_of(i), tracks.covariance_of(i), tracks.real[i], tracks.used[i]);
        step_.end_tracks(histories);
    }

    Table rows() const { return table(rows_); }
    Out<std::int64_t> takers() const { return array_of(takers_); }
    Out<std::int64_t> living() const { return array_of(living_); }
    std::size_t size() const { return state_.tracks.size(); }
    std::int64_t born() const { return state_.next_id - 1; }
    bool boxes_end_at_edge() const { return state_.boxes_end_at_edge(); }

    Table smoothed() { return table(histories_.preview(state_.gaps, state_.constants)); }
    Table drain() {
        Table out = table(histories_.rows());
        histories_.rows().clear();
        return out;
    }
    Table finish() {
        histories_.end(std::vector<std::uint8_t>(histories_.living().size(), 0), state_.gaps, state_.constants);
        return drain();
    }

    Named learnt() const {
        Named out;
        out["p_detect"] = array_of(state_.belief.p_detect);
        out["unseen"] = array_of(state_.belief.unseen);
        out["indifference"] = array_of(state_.belief.indifference);
        out["prior_odds"] = array_of(state_.belief.prior_odds);
        std::vector<double> leftovers;
        for (const Sensor& sensor : state_.sensors) leftovers.push_back(sensor.leftovers);
        out["leftovers"] = array_of(leftovers);
        std::vector<double> at_edge, beyond;
        for (const Sensor& sensor : state_.sensors) at_edge.push_back(sensor.boxes_at_edge), beyond.push_back(sensor.boxes_beyond);
        out["boxes_at_edge"] = array_of(at_edge);
        out["boxes_beyond"] = array_of(beyond);
        out["noise_share"] = state_.belief.noise_share;
        out["log_side_variance"] = array_of(state_.log_side_variance);
        const ProcessNoise& q = state_.process_noise;
        out["process_noise"] = nb::make_tuple(q.jerk, q.growth, q.position, q.size);
        return out;
    }

    // The tracks as they are now, column by column, for tests: (N, width) each.
    Named tracks() {
        Named out;
        state_.tracks.columns([&](const char* name, const auto& column, std::size_t width) {
            using Column = std::remove_cvref_t<decltype(column)>;
            if constexpr (!std::is_same_v<Column, std::vector<Sides>>) out[name] = array_of(column, width);
        });
        return out;
    }

private:
    static Table table(const Rows& rows) {
        return std::make_tuple(array_of(rows.t), array_of(rows.track_id), array_of(rows.mean, 2 * kMotion),
                              array_of(rows.variance, 2 * kMotion), array_of(rows.real), array_of(rows.used));
    }

    State state_;
    Step step_;
    bool smooths_;
    Histories histories_;
    std::vector<Scan> scans_;
    std::vector<std::uint8_t> reported_;
    std::vector<std::int64_t> takers_, living_;
    Rows rows_;
};

}  // namespace

void bind(nb::module_& module) {
    nb::class_<Model>(module, "Model", "The tracker's state and its step; see jeat_graph.tracking.reference.")
        .def(nb::init<const nb::object&, double, double, bool, double>(), nb::arg("constants"), nb::arg("width"),
             nb::arg("height"), nb::arg("known"), nb::arg("lag_s"),
             "constants: a ModelConstants; width, height: of the picture (px), if known; lag_s: of the smoother (s),\n"
             "infinite for whole tracks, negative for none.")
        .def("declare_sensor", &Model::declare_sensor, "Add a sensor that has not looked yet.")
        .def("take", &Model::take, nb::arg("t"), nb::arg("sensors").noconvert(), nb::arg("numbers").noconvert(),
             nb::arg("boxes").noconvert(), nb::arg("logits").noconvert(),
             "Take in the scans of one time t (s): sensors (K,), numbers of boxes of each (K,), all boxes (M, 4) left,\n"
             "top, right, bottom (px), logits of their scores (M,).")
        .def("rows", &Model::rows, "Reported tracks: t, identity, mean (N, 10), variance (N, 10), posterior, sensors.")
        .def("takers", &Model::takers, "Identity of the track that took each box of the last step (M,).")
        .def("living", &Model::living, "Identities of the tracks of the last step, before any ended (N,).")
        .def("size", &Model::size, "Number of living tracks.")
        .def("born", &Model::born, "Number of tracks started so far.")
        .def("boxes_end_at_edge", &Model::boxes_end_at_edge,
             "Whether boxes end at the edge of the picture more often than they reach beyond it.")
        .def("smoothed", &Model::smoothed, "Smoothed rows so far, columns as those of rows.")
        .def("drain", &Model::drain, "Smoothed rows that have become final; they are forgotten.")
        .def("finish", &Model::finish, "The same, all tracks being ended.")
        .def("learnt", &Model::learnt, "What is believed of the sensors and the scene, by name.")
        .def("tracks", &Model::tracks, "Columns of the living tracks, by name.");
}

}  // namespace jeat::tracking
