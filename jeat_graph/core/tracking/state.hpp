// State of the tracker: the tracks in columns, and what is learnt of sensors and scene.
//
// Behind each part stands the stage that writes it; step.cpp has them in their order.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "filters/box_sides.hpp"
#include "filters/box_spread.hpp"
#include "filters/camera_motion.hpp"
#include "filters/camera_path.hpp"
#include "filters/columns.hpp"
#include "filters/evidence.hpp"
#include "filters/gap_survival.hpp"
#include "filters/object_probability.hpp"
#include "filters/picture_motion.hpp"
#include "filters/score_calibration.hpp"
#include "filters/sensor_accuracy.hpp"
#include "filters/sensor_offsets.hpp"
#include "filters/visibility.hpp"

namespace jeat::tracking {

using namespace jeat::filters;

// All living tracks, in ascending order of identity; see ReferenceTracks for what the columns are.
struct Tracks {
    std::vector<std::int64_t> track_id, used;
    std::vector<double> mean, covariance;  // predict, follow_camera, update
    std::vector<double> presence;          // predict, count_hits_and_misses
    std::vector<double> recent_hits, recent_misses;
    std::vector<Sides> last_box;  // compare_sensors
    std::vector<double> last_box_s;
    std::vector<double> apart, apart_s;  // compare_sensors
    std::vector<std::uint8_t> has_apart;
    std::vector<double> innovation;  // learn_noise
    std::vector<std::uint8_t> has_innovation;
    std::vector<double> real, log_odds, sees;  // judge
    // Where who is who is given: whose boxes it takes, below 0 for any that are nobody's; and whether more are to come.
    std::vector<std::int64_t> given;    // begin_tracks
    std::vector<std::uint8_t> awaited;  // begin_tracks, update
    Evidence evidence;                  // count_hits_and_misses, compare_overlaps

    std::size_t size() const { return track_id.size(); }
    double* mean_of(std::size_t row) { return mean.data() + row * kMean; }
    const double* mean_of(std::size_t row) const { return mean.data() + row * kMean; }
    double* covariance_of(std::size_t row) { return covariance.data() + row * kCovariance; }
    const double* covariance_of(std::size_t row) const { return covariance.data() + row * kCovariance; }
    double* presence_of(std::size_t row) { return presence.data() + row * kPresences; }
    const double* presence_of(std::size_t row) const { return presence.data() + row * kPresences; }

    template <class Visit> void own_columns(Visit visit) {
        const std::size_t S = evidence.sensors;
        visit("track_id", track_id, 1);
        visit("used", used, 1);
        visit("mean", mean, kMean);
        visit("covariance", covariance, kCovariance);
        visit("presence", presence, kPresences);
        visit("recent_hits", recent_hits, S);
        visit("recent_misses", recent_misses, S);
        visit("last_box", last_box, S);
        visit("last_box_s", last_box_s, S);
        visit("apart", apart, S * S * kCompared);
        visit("apart_s", apart_s, S * S);
        visit("has_apart", has_apart, S * S);
        visit("innovation", innovation, 4);
        visit("has_innovation", has_innovation, 1);
        visit("real", real, 1);
        visit("log_odds", log_odds, 1);
        visit("sees", sees, S);
        visit("given", given, 1);
        visit("awaited", awaited, 1);
    }
    template <class Visit> void columns(Visit visit) {
        own_columns(visit);
        evidence.columns(visit);
    }

    void widen() {
        const std::size_t rows = size(), S = evidence.sensors;
        widen_rows(recent_hits, rows, S, 1);
        widen_rows(recent_misses, rows, S, 1);
        widen_rows(last_box, rows, S, 1);
        widen_rows(last_box_s, rows, S, 1);
        widen_rows(sees, rows, S, 1);
        widen_pairs(apart, rows, S, kCompared);
        widen_pairs(apart_s, rows, S, 1);
        widen_pairs(has_apart, rows, S, 1);
        evidence.widen();
    }
};

// One sensor, beside what SensorBelief and OffsetSums have of it.
struct Sensor {
    double leftovers;                                            // count_clutter
    double false_boxes = 0.0;                                    // count_false_boxes
    double boxes_at_edge = 0.0, boxes_beyond = 0.0;              // begin_scan
    double period_s = std::numeric_limits<double>::quiet_NaN();  // begin_scan
    double last_scan_s = std::numeric_limits<double>::quiet_NaN();
    RepeatCounts repetition;  // begin_scan
    // What the user says of it: the logit of the score at which a box is as likely real as not, NaN where it is to
    // be learnt.
    double even_logit = std::numeric_limits<double>::quiet_NaN();
    // The weight of its scores, NaN where it is to be learnt.
    double given_weight = std::numeric_limits<double>::quiet_NaN();
    // And the variance of what lasts of its errors (sizes²), NaN where it is to be learnt.
    double given_lasting = std::numeric_limits<double>::quiet_NaN();
    // The mean square of the spreads that it gives with its boxes (sizes²), NaN where none is known.
    double mean_spread = std::numeric_limits<double>::quiet_NaN();  // learn_noise
};

struct State {
    ModelConstants constants;
    Tracks tracks;
    double t = 0.0;  // predict
    bool started = false;
    std::int64_t next_id = 1;          // begin_tracks
    double width = 1.0, height = 1.0;  // begin_scan, where the picture is not known
    bool picture_known = false;
    ProcessNoise process_noise;             // learn_noise
    CameraVariance camera;                  // follow_camera
    CameraVelocity camera_velocity;         // follow_picture
    CameraPath camera_path;                 // predict, follow_picture, follow_camera
    GapCounts gaps;                         // count_gaps, end_tracks
    SensorBelief belief;                    // learn
    OffsetSums offsets;                     // compare_sensors
    AccuracySums accuracy;                  // compare_sensors, learn
    std::vector<double> log_side_variance;  // learn_noise
    std::vector<Sensor> sensors;
    Evidence ended;  // end_tracks
    double learnt_s = -std::numeric_limits<double>::infinity();

    explicit State(const ModelConstants& c) : constants(c) {
        process_noise = {2.0 * log_of(c.jerk), 2.0 * log_of(c.growth_noise), 2.0 * log_of(c.position_walk),
                         2.0 * log_of(c.size_walk)};
        camera.shift = square(c.camera_shift_std);
        camera.scale = square(c.camera_scale_std);
        belief.noise_share = c.noise_share;
    }

    // Variances of the sensors' sides as the filter takes them.
    double noise(std::size_t k) const {
        return side_noise(log_side_variance[k], offsets.compared(k), accuracy.lasting[k], constants);
    }
    SpreadNoise spread_noise(std::size_t k) const { return {log_side_variance[k], sensors[k].mean_spread}; }
    std::vector<double> noises() const {
        std::vector<double> out(sensors.size());
        for (std::size_t k = 0; k < out.size(); ++k) out[k] = noise(k);
        return out;
    }

    // Mean of their ln over the sensors that have had a scan.
    double log_scene_variance() const {
        double sum = 0.0, number = 0.0;
        for (std::size_t k = 0; k < sensors.size(); ++k)
            if (!std::isnan(sensors[k].last_scan_s)) sum += log_of(noise(k)), number += 1.0;
        return sum / std::max(number, 1.0);
    }

    // Whether boxes end at the edge of the picture more often than they reach beyond it.
    bool boxes_end_at_edge() const {
        double at = 0.0, beyond = 0.0;
        for (const Sensor& sensor : sensors) at += sensor.boxes_at_edge, beyond += sensor.boxes_beyond;
        return picture_known && at >= beyond;
    }

    void declare_sensor(double even_logit, double score_weight, double given_lasting, double stationary_prior) {
        belief.widen(constants, std::isnan(score_weight) ? 1.0 : score_weight, stationary_prior);
        tracks.widen();
        ended.widen();
        offsets.widen();
        log_side_variance.push_back(2.0 * log_of(constants.side_std));
        Sensor sensor;
        sensor.leftovers = sensor.false_boxes = constants.first_leftovers;
        sensor.even_logit = even_logit;
        sensor.given_weight = score_weight;
        sensor.given_lasting = given_lasting;
        accuracy.widen(std::isnan(given_lasting) ? 0.0 : given_lasting);
        sensors.push_back(std::move(sensor));
    }
};

}  // namespace jeat::tracking
