// Binds the kernels of jeat_graph.road.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "exclusive.hpp"
#include "road/causal.hpp"
#include "road/chain_rows.hpp"

namespace jeat::road {

namespace {

using Two = std::pair<double, double>;
using In1D = In<double>;
using In2D = In2<double>;

std::array<double, 3> three(const double* at) { return {at[0], at[1], at[2]}; }

Camera camera_of(In2D rotation, In1D position, Two focal, Two centre, Two picture, Two distortion) {
    check(rotation.shape(0) == 3 && rotation.shape(1) == 3 && position.size() == 3, "rotation (3, 3), position (3,)");
    Camera out;
    for (std::size_t i = 0; i < 3; ++i) out.rotation[i] = three(rotation.data() + 3 * i);
    out.position = three(position.data());
    out.focal = {focal.first, focal.second}, out.centre = {centre.first, centre.second};
    out.picture = {picture.first, picture.second};
    out.k1 = distortion.first, out.k2 = distortion.second;
    return out;
}

Extremes extremes_of(In3<double> extremes) {
    check(extremes.shape(0) == 2 && extremes.shape(1) == 2 && extremes.shape(2) == 3, "extremes (2, 2, 3)");
    const double* const at = extremes.data();
    return {three(at), three(at + 3), three(at + 6), three(at + 9)};
}

Motion motion_of(const nb::handle& config) {
    const auto take = [&](const char* name) { return nb::cast<double>(config.attr(name)); };
    return {take("acceleration_std"), take("acceleration_s"), take("lateral_std"), take("lateral_s")};
}

Belief belief_of(const nb::handle& config, In1D size, In2D size_cov, In3<double> extremes) {
    check(size.size() == 3 && size_cov.shape(0) == 3 && size_cov.shape(1) == 3, "size (3,), its covariance (3, 3)");
    const auto take = [&](const char* name) { return nb::cast<double>(config.attr(name)); };
    Belief out{motion_of(config),    take("speed_std"),  take("strip_std"),
               take("edge_px"),      take("gate"),       take("pause"),
               take("most_beyond"),  three(size.data()), {},
               extremes_of(extremes)};
    for (std::size_t i = 0; i < 3; ++i) out.size_cov[i] = three(size_cov.data() + 3 * i);
    return out;
}

// A filter that one thread uses at a time.
struct Shared {
    Filter filter;
    Exclusive use;
};

Filter filter_of(const Camera& camera, const nb::object& config, In1D size, In2D size_cov, In3<double> extremes,
                 In2D errors) {
    check(errors.shape(1) == 2, "two errors for each sensor");
    std::vector<SensorErrors> of_sensors;
    of_sensors.reserve(errors.shape(0));
    for (std::size_t s = 0; s < errors.shape(0); ++s)
        of_sensors.push_back({errors.data()[2 * s], errors.data()[2 * s + 1]});
    return Filter(camera, belief_of(config, size, size_cov, extremes), std::move(of_sensors));
}

void check_rows(std::initializer_list<std::size_t> rows, std::initializer_list<std::size_t> widths, std::size_t width) {
    check_lengths(rows);
    for (const std::size_t one : widths) check(one == width, "rows of another width than expected");
}

void take(Shared& shared, double t, In<std::int64_t> track_ids, In<std::int64_t> sensors, In2D z, In2D r,
          In2D coloured_std, In2D log_size, In2D size_var) {
    check_rows({track_ids.size(), sensors.size(), z.shape(0), r.shape(0), coloured_std.shape(0), log_size.shape(0),
                size_var.shape(0)},
               {z.shape(1), r.shape(1), coloured_std.shape(1), log_size.shape(1), size_var.shape(1)}, 2);
    const Exclusive::Hold hold(shared.use);
    Filter& filter = shared.filter;
    for (const std::int64_t sensor : span(sensors))
        check(sensor >= 0 && static_cast<std::size_t>(sensor) < filter.sensors(), "no such sensor");
    const nb::gil_scoped_release release;
    for (std::size_t k = 0; k < track_ids.size(); ++k) {
        const Taken taken{z.data() + 2 * k, r.data() + 2 * k, coloured_std.data() + 2 * k, log_size.data() + 2 * k,
                          size_var.data() + 2 * k};
        filter.take(t, track_ids.data()[k], static_cast<std::size_t>(sensors.data()[k]), taken);
    }
}

std::tuple<Out<std::int64_t>, Out2<double>, Out2<double>> read(Shared& shared, double t, In<std::int64_t> track_ids) {
    const Exclusive::Hold hold(shared.use);
    Filter& filter = shared.filter;
    const std::size_t room = track_ids.size();
    Buffer<std::int64_t> known(room);
    Buffer<double> mean(room * STATES), variance(room * STATES);
    std::size_t count = 0;
    for (const std::int64_t one : span(track_ids)) {
        if (!filter.read(t, one, &mean.data[count * STATES], &variance.data[count * STATES])) continue;
        known[count++] = one;
    }
    known.used = count;
    return {handed_over(std::move(known)), handed_over(std::move(mean), count, STATES),
            handed_over(std::move(variance), count, STATES)};
}

// A state in NumPy's arrays while a kernel changes it.
class Borrowed {
public:
    Borrowed(Out<double> mean, Out2<double> cov) : mean_(mean), cov_(cov) {
        check(mean.size() == STATES && cov.shape(0) == STATES && cov.shape(1) == STATES, "a state has 8 components");
        std::copy_n(mean.data(), STATES, state.mean.begin());
        for (std::size_t r = 0; r < STATES; ++r) std::copy_n(cov.data() + r * STATES, STATES, state.cov[r].begin());
    }
    Borrowed(const Borrowed&) = delete;
    Borrowed& operator=(const Borrowed&) = delete;
    ~Borrowed() {
        std::copy_n(state.mean.begin(), STATES, mean_.data());
        for (std::size_t r = 0; r < STATES; ++r) std::copy_n(state.cov[r].begin(), STATES, cov_.data() + r * STATES);
    }
    State state;

private:
    Out<double> mean_;
    Out2<double> cov_;
};

bool update_by(Out<double> mean, Out2<double> cov, In1D z, In1D R, In<std::int64_t> mode, double gate,
               const Camera& camera) {
    check(z.size() == CHANNELS && R.size() == CHANNELS && mode.size() == 2, "a box has 4 channels and 2 axes");
    Box box;
    std::copy_n(z.data(), CHANNELS, box.z.begin());
    std::copy_n(R.data(), CHANNELS, box.R.begin());
    box.mode = {mode.data()[0], mode.data()[1]};
    Borrowed borrowed(mean, cov);
    return update(borrowed.state, box, gate, camera);
}

std::pair<Out2<double>, Out2<double>> terms_of(In2D means, In3<double> covs) {
    check_rows({means.shape(0), covs.shape(0)}, {means.shape(1), covs.shape(1), covs.shape(2)}, STATES);
    const std::size_t rows = means.shape(0);
    Buffer<double> mean(rows * STATES), variance(rows * STATES);
    State state;
    for (std::size_t k = 0; k < rows; ++k) {
        std::copy_n(means.data() + k * STATES, STATES, state.mean.begin());
        for (std::size_t r = 0; r < STATES; ++r)
            std::copy_n(covs.data() + (k * STATES + r) * STATES, STATES, state.cov[r].begin());
        road_terms(state, &mean.data[k * STATES], &variance.data[k * STATES]);
    }
    return {handed_over(std::move(mean), rows, STATES), handed_over(std::move(variance), rows, STATES)};
}

bool linearise_boxes(const Camera& camera, In2D place, In2D way, In1D size, In2D z, In2<std::int64_t> mode,
                     Out3<double> slopes, Out2<double> residual) {
    check_rows({place.shape(0), way.shape(0), z.shape(0), mode.shape(0), slopes.shape(0), residual.shape(0)},
               {place.shape(1), way.shape(1), mode.shape(1)}, 2);
    check_rows({}, {z.shape(1), slopes.shape(1), residual.shape(1)}, CHANNELS);
    check(slopes.shape(2) == UNKNOWNS && size.size() == 3, "slopes (N, 4, 5) and a size (3,)");
    const nb::gil_scoped_release release;
    return linearise(camera, view2(place), view2(way), size.data(), view2(z), view2(mode), span(slopes),
                     view2(residual));
}

Boxes boxes_of(In1D t, In2D white, In2D coloured, In2<std::int64_t> mode, In<std::int64_t> group, In1D memory_s,
               In1D weight) {
    check_rows({t.size(), white.shape(0), coloured.shape(0), mode.shape(0), group.size(), weight.size()},
               {white.shape(1), coloured.shape(1)}, CHANNELS);
    check(mode.shape(1) == 2, "boxes have two axes");
    for (const std::int64_t one : span(group))
        check(one >= 0 && static_cast<std::size_t>(one) < memory_s.size(), "no such sensor");
    return {span(t), view2(white), view2(coloured), view2(mode), span(group), span(memory_s), span(weight)};
}

double whiten_columns(Out3<double> columns, In1D t, In2D white, In2D coloured, In2<std::int64_t> mode,
                      In<std::int64_t> group, In1D memory_s, In1D weight) {
    const Boxes boxes = boxes_of(t, white, coloured, mode, group, memory_s, weight);
    check_rows({t.size(), columns.shape(0)}, {columns.shape(1)}, CHANNELS);
    const nb::gil_scoped_release release;
    return whiten(boxes, columns.shape(2), columns.data());
}

void fill_chain_rows(In1D keys, In<std::int64_t> bounds, In1D t, In2D white, In2D coloured, In2<std::int64_t> mode,
                     In<std::int64_t> group, In1D memory_s, In1D weight, In3<double> slopes, In2D right, In1D jerk,
                     Out3<double> out, Out<std::int64_t> counts, Out<double> logs) {
    const Boxes boxes = boxes_of(t, white, coloured, mode, group, memory_s, weight);
    const std::size_t n = MOTION + CHANNELS * memory_s.size(), pairs = counts.size();
    check_lengths({keys.size(), bounds.size(), pairs + 1});
    check_rows({pairs, out.shape(0), logs.size()}, {out.shape(2)}, 2 * n + SIZES + 1);
    check_rows({t.size(), slopes.shape(0), right.shape(0)}, {slopes.shape(1), right.shape(1)}, CHANNELS);
    check(slopes.shape(2) == UNKNOWNS && jerk.size() == 2, "slopes (N, 4, 5) and two jerks");
    check(bounds.data()[0] == 0 && static_cast<std::size_t>(bounds.data()[pairs]) == t.size(), "bounds hold all boxes");
    for (std::size_t s = 0; s < pairs; ++s) {
        const std::int64_t between = bounds.data()[s + 1] - bounds.data()[s];
        check(between >= 0, "bounds in order");
        check(n + CHANNELS * static_cast<std::size_t>(between) <= out.shape(1), "room for all rows");
    }
    const nb::gil_scoped_release release;
    for (std::size_t s = 0; s < pairs; ++s) {
        const Pair pair{keys.data()[s],
                        keys.data()[s + 1],
                        static_cast<std::size_t>(bounds.data()[s]),
                        static_cast<std::size_t>(bounds.data()[s + 1]),
                        {out.data() + s * out.shape(1) * out.shape(2), out.shape(1), out.shape(2)}};
        const auto [count, log_determinant] = pair_rows(pair, boxes, slopes.data(), view2(right), span(jerk));
        counts.data()[s] = static_cast<std::int64_t>(count);
        logs.data()[s] = log_determinant;
    }
}

}  // namespace

void bind(nb::module_& module) {
    const auto whole = [](const char* name) { return nb::arg(name).noconvert(); };
    nb::class_<Camera>(module, "Camera", "A camera over a flat road; see jeat_graph.road.camera.")
        .def(
            "__init__",
            [](Camera* self, In2D rotation, In1D position, Two focal, Two centre, Two picture, Two distortion) {
                new (self) Camera(camera_of(rotation, position, focal, centre, picture, distortion));
            },
            whole("rotation"), whole("position"), nb::arg("focal"), nb::arg("centre"), nb::arg("picture"),
            nb::arg("distortion"),
            "rotation: road to camera (3, 3); position (3,) in m; focal: fx, fy; centre: cx, cy; picture: width and\n"
            "height (px); distortion: k1, k2.");
    nb::class_<Shared>(module, "Filter", "All tracks on the road; see jeat_graph.road.causal.")
        .def(
            "__init__",
            [](Shared* self, const Camera& camera, const nb::object& config, In1D size, In2D size_cov,
               In3<double> extremes,
               In2D errors) { new (self) Shared{filter_of(camera, config, size, size_cov, extremes, errors), {}}; },
            nb::arg("camera"), nb::arg("config"), whole("size"), whole("size_cov"), whole("extremes"), whole("errors"),
            "config: a RoadFilterConfig; size (3,), size_cov (3, 3): of a vehicle not seen yet; extremes: of the fleet;\n"
            "errors (S, 2): correlation time of each sensor's errors (s), share of its sizes' variance that persists.")
        .def(
            "take", take, nb::arg("t"), whole("track_ids"), whole("sensors"), whole("z"), whole("r"),
            whole("coloured_std"), whole("log_size"), whole("size_var"),
            "Take in what tracks were given at time t (s): centres z (M, 2) with variances r of their new and standard\n"
            "deviations of their persisting errors (px), log_size (M, 2) with variances.")
        .def(
            "read", read, nb::arg("t"), whole("track_ids"),
            "States at time t (s) of those of the tracks (N,) that stand on the road and are vehicles: identities (K,),\n"
            "means (K, 8) and variances (K, 8) as road_terms has them.")
        .def(
            "forget",
            [](Shared& shared, double t, double silence_s) {
                const Exclusive::Hold hold(shared.use);
                shared.filter.forget(t, silence_s);
            },
            nb::arg("t"), nb::arg("silence_s"), "Remove tracks without a box for longer than silence_s.");
    module.def(
        "predict",
        [](Out<double> mean, Out2<double> cov, double dt, const nb::object& config) {
            Borrowed borrowed(mean, cov);
            predict(borrowed.state, dt, motion_of(config));
        },
        whole("mean"), whole("cov"), nb::arg("dt"), nb::arg("config"),
        "Predict a state (8,) and its covariance (8, 8) by dt (s) in place; config: a RoadFilterConfig.");
    module.def(
        "update", update_by, whole("mean"), whole("cov"), whole("z"), whole("R"), whole("mode"), nb::arg("gate"),
        nb::arg("camera"),
        "Take a box into a state in place: channels z (4,) with variances R (4,), mode (2,). False, with the state as\n"
        "it was, where the vehicle is not in front of the camera.");
    module.def(
        "road_terms", terms_of, whole("means"), whole("covs"),
        "States (N, 8) with covariances (N, 8, 8) as tables of the road have them: x, y (m), speed (m/s), heading\n"
        "from y towards x (rad), acceleration along the way (m/s²), length, width, height (m), and variances (N, 8).");
    module.def(
        "beyond_vehicles",
        [](In1D size, In1D variance, In3<double> extremes) {
            check(size.size() == 3 && variance.size() == 3, "a size is length, width and height");
            return beyond_vehicles(size.data(), variance.data(), extremes_of(extremes));
        },
        whole("size"), whole("variance"), whole("extremes"), "See jeat_graph.road.fleet.");
    module.def("linearise", linearise_boxes, nb::arg("camera"), whole("place"), whole("way"), whole("size"), whole("z"),
               whole("mode"), whole("slopes"), whole("residual"), "See jeat_graph.road.box_channels.");
    module.def("whiten", whiten_columns, whole("columns"), whole("t"), whole("white"), whole("coloured"), whole("mode"),
               whole("group"), whole("memory_s"), whole("weight"), "See jeat_graph.road.box_errors.");
    module.def("chain_rows", fill_chain_rows, whole("keys"), whole("bounds"), whole("t"), whole("white"),
               whole("coloured"), whole("mode"), whole("group"), whole("memory_s"), whole("weight"), whole("slopes"),
               whole("right"), whole("jerk"), whole("out"), whole("counts"), whole("logs"),
               "See jeat_graph.road.chain_rows.");
}

}  // namespace jeat::road
