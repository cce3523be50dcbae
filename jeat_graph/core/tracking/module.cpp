// Binds the tracker's step.
#include <cstdlib>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "smoothers/state_rts.hpp"
#include "tracking/step.hpp"

namespace jeat::tracking {

namespace {

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
    Model(const nb::object& constants, double width, double height, bool known, bool smooths)
        : state_(constants_of(constants)), step_(state_), smooths_(smooths) {
        if (known) state_.width = width, state_.height = height, state_.picture_known = true;
    }
    Model(const Model&) = delete;
    Model& operator=(const Model&) = delete;

    void declare_sensor() { state_.declare_sensor(); }

    // Take in the scans of one time: sensors (K,), number of boxes of each (K,), all boxes and logits.
    void take(double t, In<std::int64_t> sensors, In<std::int64_t> numbers, In2<double> boxes, In<double> logits) {
        scans_.clear();
        std::size_t at = 0;
        for (std::size_t k = 0; k < sensors.size(); ++k) {
            Scan scan;
            scan.sensor = static_cast<std::size_t>(sensors.data()[k]);
            const auto number = static_cast<std::size_t>(numbers.data()[k]);
            check(scan.sensor < state_.sensors.size(), "no such sensor");
            check(at + number <= boxes.shape(0) && at + number <= logits.size(), "fewer boxes than said");
            const Sides* const first = reinterpret_cast<const Sides*>(boxes.data()) + at;
            scan.boxes.assign(first, first + number);
            scan.logits.assign(logits.data() + at, logits.data() + at + number);
            at += number;
            scans_.push_back(std::move(scan));
        }
        nb::gil_scoped_release release;
        step_.run(t, scans_, reported_, smooths_ ? &records_ : nullptr);
        if (smooths_) {
            Moment moment;
            moment.t = t;
            moment.record = records_.size() - 1;
            moment.real = state_.tracks.real;
            moment.used = state_.tracks.used;
            moments_.push_back(std::move(moment));
        }
        takers_.clear();
        for (const Scan& scan : scans_) takers_.insert(takers_.end(), scan.takers.begin(), scan.takers.end());
        living_ = state_.tracks.track_id;
        table(reported_, state_.tracks.mean, state_.tracks.covariance, state_.tracks.track_id, state_.tracks.real,
              state_.tracks.used);
        step_.end_tracks();
    }

    // The rows of the last step: identity, state, variances, posterior, sensors.
    auto rows() const {
        return std::make_tuple(array_of(out_.track_id), array_of(out_.mean, kMean), array_of(out_.variance, kMean),
                               array_of(out_.real), array_of(out_.used));
    }
    Out<std::int64_t> takers() const { return array_of(takers_); }
    Out<std::int64_t> living() const { return array_of(living_); }
    std::size_t size() const { return state_.tracks.size(); }
    std::int64_t born() const { return state_.next_id - 1; }

    // Smoothed rows of the whole: time, identity, state, variances, posterior, sensors.
    auto smoothed() {
        std::vector<double> t_out;
        std::vector<std::int64_t> at_out;
        Table all;
        std::swap(all, out_);
        clear(out_);
        std::vector<double> last(static_cast<std::size_t>(state_.next_id), -1e300), best(last.size(), 0.0);
        std::vector<std::vector<double>> existence(moments_.size());
        for (std::size_t k = 0; k < moments_.size(); ++k) {
            const auto& ids = records_[moments_[k].record].track_id;
            existence[k].resize(ids.size());
            for (std::size_t i = 0; i < ids.size(); ++i) {
                const auto id = static_cast<std::size_t>(ids[i]);
                if (moments_[k].used[i]) last[id] = moments_[k].t;
                best[id] = std::max(best[id], moments_[k].real[i]);
                existence[k][i] = best[id];
            }
        }
        static const int mode = std::getenv("JG") ? std::atoi(std::getenv("JG")) : 0;
        std::vector<double> fin(last.size(), 0.0);
        for (std::size_t k = 0; k < moments_.size(); ++k) {
            const auto& ids = records_[moments_[k].record].track_id;
            for (std::size_t i = 0; i < ids.size(); ++i) if (moments_[k].used[i]) fin[ids[i]] = moments_[k].real[i];
        }
        if (mode) {
            std::vector<double> later(last.size(), 0.0), next(last.size(), 1e300), lb(last.size(), 0.0);
            std::vector<std::vector<double>> prev(moments_.size());
            for (std::size_t k = 0; k < moments_.size(); ++k) {
                const auto& ids = records_[moments_[k].record].track_id;
                prev[k].resize(ids.size());
                for (std::size_t i = 0; i < ids.size(); ++i) { if (moments_[k].used[i]) lb[ids[i]] = moments_[k].t; prev[k][i] = lb[ids[i]]; }
            }
            for (std::size_t k = moments_.size(); k-- > 0;) {
                const auto& ids = records_[moments_[k].record].track_id;
                for (std::size_t i = 0; i < ids.size(); ++i) {
                    const auto id = static_cast<std::size_t>(ids[i]);
                    later[id] = std::max(later[id], moments_[k].real[i]);
                    if (mode == 1) existence[k][i] = std::min(existence[k][i], later[id]);
                    if (mode >= 7) {
                        const double now = moments_[k].real[i];
                        if (mode < 10) existence[k][i] = std::min(existence[k][i], later[id]);
                        if (mode == 10) existence[k][i] = now;
                        if (mode == 11) existence[k][i] = fin[id] > .5 ? std::min(existence[k][i], later[id]) : now;
                        if (mode == 12) existence[k][i] = fin[id] > .9 ? std::max(now, fin[id]) : now;
                        if (mode == 13) existence[k][i] = (now + std::min(existence[k][i], later[id])) / 2;
                        if (mode == 14) existence[k][i] = std::min(now, later[id]) ;
                        if (moments_[k].used[i]) { next[id] = moments_[k].t; }
                        else {
                            const double ub = moments_[k].t - prev[k][i], uf = next[id] - moments_[k].t;
                            const double u = mode >= 7 && mode != 8 && mode != 9 ? std::min(ub, uf) : mode == 8 ? ub + uf : (ub+uf)/2;
                            if (uf < 1e100) existence[k][i] *= state_.gaps.survival(u, state_.constants);
                        }
                    }
                    if (mode == 2) existence[k][i] = std::max(std::min(existence[k][i], later[id]), fin[id]);
                    if (mode == 3) existence[k][i] = fin[id];
                    if (mode == 4) existence[k][i] = std::min(best[id], fin[id] > .5 ? 1.0 : moments_[k].real[i]);
                    if (mode == 5) existence[k][i] = std::min(fin[id] > .5 ? 1.0 : moments_[k].real[i], existence[k][i]);
                    if (mode == 6) existence[k][i] = moments_[k].real[i];
                }
            }
        }
        std::size_t moment = moments_.size();
        std::vector<double> next_mean, next_covariance;
        for (std::size_t number = records_.size(); number-- > 0;) {
            const Record& now = records_[number];
            std::vector<double> mean = now.mean, covariance = now.covariance;
            if (number + 1 < records_.size()) {
                const Record& later = records_[number + 1];
                std::size_t j = 0;
                for (std::size_t i = 0; i < now.track_id.size(); ++i) {
                    while (j < later.track_id.size() && later.track_id[j] < now.track_id[i]) ++j;
                    if (j == later.track_id.size()) break;
                    if (later.track_id[j] != now.track_id[i]) continue;
                    const Matrix F = in_perspective(later.F, &now.mean[i * kMean], later.dt, state_.constants);
                    for (int axis = 0; axis < 2; ++axis) {
                        const std::size_t m = i * kMean + axis * kStates, m2 = j * kMean + axis * kStates;
                        const std::size_t p = i * kCovariance + axis * kMatrix, p2 = j * kCovariance + axis * kMatrix;
                        smoothers::rts_axis(&mean[m], &covariance[p], F, &later.predicted_mean[m2],
                                            &later.predicted_covariance[p2], &next_mean[m2], &next_covariance[p2]);
                    }
                }
            }
            if (moment > 0 && moments_[moment - 1].record == number) {
                --moment;
                const Moment& at = moments_[moment];
                std::vector<std::uint8_t> told(now.track_id.size());
                for (std::size_t i = 0; i < told.size(); ++i)
                    told[i] = existence[moment][i] > state_.constants.report &&
                              at.t <= last[static_cast<std::size_t>(now.track_id[i])];
                const std::size_t before = out_.track_id.size();
                table(told, mean, covariance, now.track_id, existence[moment], at.used, false);
                t_out.resize(out_.track_id.size(), at.t);
                (void)before;
            }
            next_mean = std::move(mean);
            next_covariance = std::move(covariance);
        }
        auto result = std::make_tuple(array_of(t_out), array_of(out_.track_id), array_of(out_.mean, kMean),
                                      array_of(out_.variance, kMean), array_of(out_.real), array_of(out_.used));
        std::swap(all, out_);
        return result;
    }

    nb::dict sensors() const {
        nb::dict out;
        out["p_detect"] = array_of(state_.belief.p_detect);
        out["unseen"] = array_of(state_.belief.unseen);
        out["indifference"] = array_of(state_.belief.indifference);
        out["prior_odds"] = array_of(state_.belief.prior_odds);
        out["noise_share"] = state_.belief.noise_share;
        out["log_side_variance"] = array_of(state_.log_side_variance);
        const ProcessNoise& q = state_.process_noise;
        out["process_noise"] = std::make_tuple(q.jerk, q.growth, q.position, q.size);
        return out;
    }

private:
    struct Table {
        std::vector<std::int64_t> track_id, used;
        std::vector<double> mean, variance, real;
    };
    struct Moment {
        double t = 0.0;
        std::size_t record = 0;
        std::vector<double> real;
        std::vector<std::int64_t> used;
    };

    static void clear(Table& t) {
        t.track_id.clear(), t.used.clear(), t.mean.clear(), t.variance.clear(), t.real.clear();
    }

    void table(const std::vector<std::uint8_t>& told, const std::vector<double>& mean,
               const std::vector<double>& covariance, const std::vector<std::int64_t>& ids,
               const std::vector<double>& real, const std::vector<std::int64_t>& used, bool anew = true) {
        if (anew) clear(out_);
        for (std::size_t i = 0; i < told.size(); ++i) {
            if (!told[i]) continue;
            out_.track_id.push_back(ids[i]);
            out_.used.push_back(used[i]);
            out_.real.push_back(real[i]);
            for (int k = 0; k < kMean; ++k) {
                out_.mean.push_back(mean[i * kMean + k]);
                const int axis = k / kStates, state = k % kStates;
                out_.variance.push_back(covariance[i * kCovariance + axis * kMatrix + state * kStates + state]);
            }
        }
    }

    State state_;
    Step step_;
    bool smooths_;
    std::vector<Scan> scans_;
    std::vector<std::uint8_t> reported_;
    std::vector<std::int64_t> takers_, living_;
    Table out_;
    std::vector<Record> records_;
    std::vector<Moment> moments_;
};

}  // namespace

void bind(nb::module_& module) {
    nb::class_<Model>(module, "Model")
        .def(nb::init<const nb::object&, double, double, bool, bool>(), nb::arg("constants"), nb::arg("width"),
             nb::arg("height"), nb::arg("known"), nb::arg("smooths"))
        .def("declare_sensor", &Model::declare_sensor)
        .def("take", &Model::take, nb::arg("t"), nb::arg("sensors").noconvert(), nb::arg("numbers").noconvert(),
             nb::arg("boxes").noconvert(), nb::arg("logits").noconvert())
        .def("rows", &Model::rows)
        .def("takers", &Model::takers)
        .def("living", &Model::living)
        .def("size", &Model::size)
        .def("born", &Model::born)
        .def("smoothed", &Model::smoothed)
        .def("sensors", &Model::sensors);
}

}  // namespace jeat::tracking
