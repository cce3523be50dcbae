#include "tracking/step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "filters/noise_learning.hpp"
#include "tracking/life.hpp"
#include "tracking/update.hpp"

namespace jeat::tracking {

namespace {

// Whether the boxes of one scan come before those of another one.
bool before(const std::vector<Sides>& a, const std::vector<Sides>& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(), [](const Sides& x, const Sides& y) {
        return std::array{x.left, x.top, x.right, x.bottom} < std::array{y.left, y.top, y.right, y.bottom};
    });
}

// The places of scans: the most exact sensor first, equals by what they see.
std::vector<std::size_t> order_of_scans(const State& state, const std::vector<Scan>& scans) {
    std::vector<std::size_t> order(scans.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        const double va = state.noise(scans[a].sensor), vb = state.noise(scans[b].sensor);
        if (va != vb) return va < vb;
        if (scans[a].logits != scans[b].logits) return scans[a].logits < scans[b].logits;
        if (before(scans[a].boxes, scans[b].boxes)) return true;
        return !before(scans[b].boxes, scans[a].boxes) && a < b;
    });
    return order;
}

// How much a sensor's scores count: as given, or as learnt where others can contradict them. With one sensor alone
// nothing else tells what is real: there its scores count in full.
double score_weight(const State& state, const Sensor& sensor) {
    if (!std::isnan(sensor.given_weight)) return sensor.given_weight;
    const auto seen = [](const Sensor& one) { return one.repetition.scans > 0; };
    const bool alone = std::count_if(state.sensors.begin(), state.sensors.end(), seen) < 2;
    return alone ? 1.0 : sensor.repetition.meaning(state.constants);
}

// Take notice of a scan: the sensor's period, its decision threshold, the picture and its edges.
ScanClock begin_scan(State& state, double t, const Scan& scan, association::Assignment& repeats) {
    const ModelConstants& c = state.constants;
    Sensor& sensor = state.sensors[scan.sensor];
    for (const Sides& box : scan.boxes) {
        if (state.picture_known) {
            const double out_left = std::max(-box.left, -box.top);
            const double out = std::max(out_left, std::max(box.right - state.width, box.bottom - state.height));
            sensor.boxes_beyond += out > c.edge_px;
            sensor.boxes_at_edge += edges_of(box, state.width, state.height, c).any();
        } else {
            state.width = std::max(state.width, box.right);
            state.height = std::max(state.height, box.bottom);
        }
    }
    if (!std::isnan(sensor.last_scan_s)) {
        const double since = t - sensor.last_scan_s;
        sensor.period_s =
            std::isnan(sensor.period_s) ? since : kPeriodMemory * sensor.period_s + (1.0 - kPeriodMemory) * since;
    }
    sensor.last_scan_s = t;
    sensor.repetition.count(scan.boxes, scan.logits, repeats, c);
    state.belief.decision_threshold[scan.sensor] =
        std::isnan(sensor.even_logit) ? sensor.repetition.decision_threshold(c) : sensor.even_logit;
    state.belief.score_weight[scan.sensor] = score_weight(state, sensor);
    const double period = std::isnan(sensor.period_s) ? c.first_period_s : sensor.period_s;
    return {t, period, c};
}

// Predict states and presence to a time.
void predict(State& state, double t, TimeStep& step) {
    const ModelConstants& c = state.constants;
    const double dt = state.started ? t - state.t : 0.0;
    state.t = t;
    state.started = true;
    step.set(dt, c);
    if (dt <= 0.0) return;
    state.camera_path.predict(step.motion().F, state.camera_velocity, state.width, state.height, dt);
    const Densities densities(state.process_noise, exp_of(state.log_scene_variance()));
    Tracks& tracks = state.tracks;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        double* const mean = tracks.mean_of(i);
        with_camera(mean, state.camera_velocity, dt,
                    [&] { filters::predict(mean, tracks.covariance_of(i), step.motion(), dt, densities, c); });
        predict_presence(tracks.presence_of(i), step.presence());
    }
}

// The boxes as the sensors have them on the average, and which sides end at the edge. A detector whose boxes end at the
// edge more often than they reach beyond is taken to cut them there.
void correct_boxes(const State& state, const Scan& scan, CorrectedBoxes& out) {
    const ModelConstants& c = state.constants;
    const Correction correction(state.offsets.offset(scan.sensor, state.noises(), c));
    const Sensor& sensor = state.sensors[scan.sensor];
    const bool cuts = state.picture_known && sensor.boxes_at_edge >= sensor.boxes_beyond;
    out.boxes.clear();
    out.edges.clear();
    out.spreads = scan.spreads;
    for (const Sides& box : scan.boxes) {
        out.boxes.push_back(correction.corrected(box));
        out.edges.push_back(cuts ? edges_of(box, state.width, state.height, c) : Edges{});
    }
    out.index = ByLeft(out.boxes);
}

// The track that each box of a scan went to, and how far from it the box lay.
void assigned_tracks(const State& state, const AssociatedPairs& pairs, Scan& scan) {
    scan.nis.assign(scan.boxes.size(), std::numeric_limits<double>::quiet_NaN());
    for (std::size_t m = 0; m < pairs.made.size(); ++m)
        scan.nis[pairs.made[m].column] = centre_distance(pairs.innovation[m], pairs.expected_of(m));
    scan.assigned.resize(scan.boxes.size());
    for (std::size_t j = 0; j < scan.boxes.size(); ++j) scan.assigned[j] = state.tracks.track_id[pairs.track_of[j]];
}

}  // namespace

void TimeStep::set(double dt, const ModelConstants& c) {
    const auto ticks = static_cast<std::int64_t>(std::nearbyint(dt * kTicksPerS));
    if (ticks == ticks_) return;
    ticks_ = ticks;
    motion_ = discretise(seconds(), c);
    presence_ = presence_transition(seconds(), c);
}

void Step::run(double t, std::vector<Scan>& scans, const PictureMotion* motion, std::vector<std::uint8_t>& reported,
               Record* record) {
    std::fill(state_.tracks.used.begin(), state_.tracks.used.end(), 0);
    const double step_s = state_.started ? state_.t : t;
    for (const std::size_t place : order_of_scans(state_, scans)) take(t, scans[place], motion, step_s, record);
    compare_overlaps(state_);
    judge(state_);
    for (const Scan& scan : scans) count_false_boxes(state_, scan);
    learn(state_, t);
    report(state_, reported);
    if (record) record_step(state_, *record);
}

void Step::take(double t, Scan& scan, const PictureMotion* motion, double step_s, Record* record) {
    const std::size_t sensor = scan.sensor;
    const ScanClock clock = begin_scan(state_, t, scan, repeats_);
    if (record) record_growth(state_, *record);
    predict(state_, t, time_step_);
    correct_boxes(state_, scan, corrected_);
    follower_.follow_picture(state_, sensor, corrected_, motion, step_s);
    follower_.follow_camera(state_, sensor, corrected_, time_step_.seconds());
    if (record) record_predictions(state_, sensor, time_step_.seconds(), *record);
    associator_.associate(state_, corrected_, scan, pairs_);
    count_gaps(state_, corrected_, pairs_);
    learn_noise(state_, sensor, corrected_, pairs_, clock);
    update(state_, corrected_, pairs_, logs_, record);
    await_more(state_, scan, pairs_);
    count_hits_and_misses(state_, scan, pairs_, clock);
    count_clutter(state_, sensor, pairs_, free_);
    begin_tracks(state_, scan, corrected_, free_, clock, pairs_);
    assigned_tracks(state_, pairs_, scan);
    compare_sensors(state_, scan, pairs_);
    if (record) record_updates(state_, scan, pairs_, *record);
}

}  // namespace jeat::tracking
