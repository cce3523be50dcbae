// The filter on the road: all tracks, advanced by the boxes that each step of the tracker gave them. What drives it
// is jeat_graph/road/causal.py.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "math.hpp"
#include "road/fleet.hpp"
#include "road/road_state.hpp"

namespace jeat::road {

// Passes over a track's first box, each linearised about what the last one found.
inline constexpr int FIRST_PASSES = 4;
// Steps in which the lens's distortion is undone.
inline constexpr int UNDISTORTION_STEPS = 4;
// Share of its distance that a vehicle's first place may be wrong by, across and along the road.
inline constexpr double FIRST_SHARE_X = 0.2, FIRST_SHARE_Y = 0.5;
// A ray that falls less than this per metre does not meet the road.
inline constexpr double LEAST_FALL = 1e-6;
// A filter that takes a box for whole that is cut off believes in a vehicle that stands in the edge.
inline constexpr double EDGE_SIGMAS = 3.5, EDGE_SHARE = 0.4;
// A sensor's errors count as independent at the latest after so long (s).
inline constexpr double LONGEST_PAUSE_S = 1e3;
// Errors that hardly change between boxes multiply a variance by no more than the inverse.
inline constexpr double LEAST_FORGOTTEN = 1e-3;
// Boxes of a track that have to be whole, and boxes after which its speed counts for its strip.
inline constexpr std::int64_t FIRST_BOXES = 5, TELLS_AFTER = 30;
// Strips along the road, about the road below the camera: how many, how wide (m), vehicles that one remembers, and
// how many of them tell how fast the next will be.
inline constexpr std::size_t STRIPS = 60;
inline constexpr double STRIP_M = 2.0, RECENT = 20.0, ENOUGH = 3.0;

// What is believed of vehicles and boxes: RoadFilterConfig in jeat_graph/road/causal.py, and the fleet.
struct Belief {
    Motion motion;
    double speed_std, strip_std, edge_px, gate, pause, most_beyond;
    std::array<double, 3> size;
    std::array<std::array<double, 3>, 3> size_cov;
    Extremes extremes;
};

// How long a sensor's errors persist (s), and the share of its sizes' variance that does.
struct SensorErrors {
    double memory_s, coloured_share;
};

// A box that a track took in, as the tracker weighed it: centre (px) with variances of its new and standard
// deviations of its persisting errors, ln of width and height with variances.
struct Taken {
    const double *z, *r, *coloured_std, *log_size, *size_var;
};

// Speeds along one strip: how many vehicles have told theirs, mean (m/s) and variance.
class Strip {
public:
    void tell(double speed) {
        count_ = std::min(count_ + 1.0, RECENT);
        const double off = speed - mean_;
        mean_ += off / count_;
        variance_ += (off * (speed - mean_) - variance_) / count_;
    }
    bool knows() const { return count_ >= ENOUGH; }
    double mean() const { return mean_; }
    double variance() const { return variance_; }

private:
    double count_ = 0.0, mean_ = 0.0, variance_ = 0.0;
};

inline std::size_t strip_of(double x) {
    const double at = x / STRIP_M + STRIPS / 2.0;
    return at > 0.0 ? static_cast<std::size_t>(std::min(at, STRIPS - 1.0)) : 0;
}

// The channels of a box, with white errors that tell as much as its own do: one that persists tells (1 - φ) / (1 + φ)
// of what a new one does, φ its correlation with that of `since_s` ago.
inline Box read_box(const Taken& taken, double since_s, const SensorErrors& errors, const Belief& belief,
                    const Camera& camera) {
    const double forget = exp_of(-std::min(since_s, LONGEST_PAUSE_S) / errors.memory_s);
    const double factor = (1.0 + forget) / std::max(1.0 - forget, LEAST_FORGOTTEN), share = errors.coloured_share;
    Box box;
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const double centre = taken.z[axis], extent = exp_of(taken.log_size[axis]);
        const double half_square = 0.25 * extent * extent, persisting = square(taken.coloured_std[axis]);
        box.z[axis] = centre, box.z[axis + 2] = taken.log_size[axis];
        box.R[axis] = taken.r[axis] + factor * persisting;
        box.R[axis + 2] = taken.size_var[axis] * (1.0 - share + share * factor);
        const double spread = std::sqrt(taken.r[axis] + persisting + half_square * taken.size_var[axis]);
        const double margin = belief.edge_px + std::min(EDGE_SIGMAS * spread, EDGE_SHARE * extent);
        const double low = centre - 0.5 * extent, high = centre + 0.5 * extent;
        const bool sees_low = low > margin, sees_high = high < camera.picture[axis] - margin;
        box.mode[axis] = sees_low ? (sees_high ? WHOLE : LOW) : (sees_high ? HIGH : NEITHER);
        if (box.mode[axis] == WHOLE) continue;
        box.R[axis] += half_square * box.R[axis + 2];
        if (box.mode[axis] != NEITHER) box.z[axis] = sees_low ? low : high;
    }
    return box;
}

// A place of the road relative to the camera's (m), from a pixel; false where the ray does not meet the road.
inline bool meets_road(const Camera& camera, double u, double v, double& dx, double& dy) {
    const double d0 = (u - camera.centre[0]) / camera.focal[0], d1 = (v - camera.centre[1]) / camera.focal[1];
    double n0 = d0, n1 = d1;
    for (int k = 0; k < UNDISTORTION_STEPS; ++k) {
        const double gain = camera.distortion(n0 * n0 + n1 * n1);
        n0 = d0 / gain, n1 = d1 / gain;
    }
    const auto& R = camera.rotation;
    const auto ray = [&](std::size_t i) { return n0 * R[0][i] + n1 * R[1][i] + R[2][i]; };
    if (!(ray(2) < -LEAST_FALL)) return false;
    const double reach = -camera.position[2] / ray(2);
    dx = ray(0) * reach, dy = ray(1) * reach;
    return true;
}

class Filter {
public:
    Filter(const Camera& camera, const Belief& belief, std::vector<SensorErrors> errors)
        : camera_(camera), belief_(belief), errors_(std::move(errors)), strips_(STRIPS) {}

    std::size_t sensors() const { return errors_.size(); }

    // Takes in a box that a track was given at time t.
    //
    // One that comes a fraction of its errors' memory after the last one of its sensor has nearly the same error, and
    // tells next to nothing: it is left out.
    void take(double t, std::int64_t track_id, std::size_t sensor, const Taken& taken) {
        const SensorErrors& errors = errors_[sensor];
        const auto found = tracks_.find(track_id);
        if (found == tracks_.end()) {
            enter(t, track_id, sensor, read_box(taken, LONGEST_PAUSE_S, errors, belief_, camera_));
            return;
        }
        Track& track = found->second;
        const double since = t - track.seen[sensor];
        if (since < belief_.pause * errors.memory_s) return;
        predict(track.state, t - track.t, belief_.motion);
        track.t = t;
        const Box box = read_box(taken, since, errors, belief_, camera_);
        if (track.boxes < FIRST_BOXES && (box.mode[0] != WHOLE || box.mode[1] != WHOLE)) {
            tracks_.erase(found);  // it may not have been whole at first either
            return;
        }
        if (!update(track.state, box, belief_.gate, camera_)) return;
        track.seen[sensor] = track.updated = t;
        if (++track.boxes == TELLS_AFTER) strips_[strip_of(track.state.mean[X])].tell(track.state.mean[VY]);
    }

    // A track at time t, not before its own, as road_terms has it; false where it is not known, or of no size that a
    // vehicle has.
    bool read(double t, std::int64_t track_id, double* mean, double* variance) {
        const auto found = tracks_.find(track_id);
        if (found == tracks_.end()) return false;
        Track& track = found->second;
        predict(track.state, t - track.t, belief_.motion);
        track.t = std::max(t, track.t);
        road_terms(track.state, mean, variance);
        return beyond_vehicles(mean + LENGTH, variance + LENGTH, belief_.extremes) <= belief_.most_beyond;
    }

    // Removes tracks without a box for longer than `silence_s`.
    void forget(double t, double silence_s) {
        std::erase_if(tracks_, [&](const auto& one) { return t - one.second.updated > silence_s; });
    }

private:
    struct Track {
        State state;
        double t, updated;
        std::int64_t boxes;
        std::vector<double> seen;  // time of each sensor's last box
    };

    // Begins a track at its first box, if it stands on the road.
    void enter(double t, std::int64_t track_id, std::size_t sensor, const Box& box) {
        State state;
        if (!begin(state, box)) return;
        std::vector<double> seen(errors_.size(), -std::numeric_limits<double>::infinity());
        seen[sensor] = t;
        tracks_.emplace(track_id, Track{state, t, t, 1, std::move(seen)});
    }

    bool begin(State& state, const Box& box) const {
        if (box.mode[1] == LOW || box.mode[1] == NEITHER || box.mode[0] == NEITHER) return false;
        const double bottom = box.mode[1] == WHOLE ? box.z[1] + 0.5 * exp_of(box.z[3]) : box.z[1];
        double dx, dy;
        if (!meets_road(camera_, box.z[0], bottom, dx, dy)) return false;
        const double distance = std::sqrt(dx * dx + dy * dy);
        State prior;
        auto& [m, P] = prior;
        for (std::size_t a = 0; a < 3; ++a) {
            m[LENGTH + a] = belief_.size[a];
            for (std::size_t b = 0; b < 3; ++b) P[LENGTH + a][LENGTH + b] = belief_.size_cov[a][b];
        }
        // From the near end, which stands on the road where the box ends, to the middle.
        const double ahead = 0.5 * belief_.size[0] * dy / distance / distance * std::abs(dy);
        m[X] = camera_.position[0] + dx, m[Y] = camera_.position[1] + dy + ahead;
        P[X][X] = square(FIRST_SHARE_X * distance), P[Y][Y] = square(FIRST_SHARE_Y * distance);
        P[VX][VX] = square(belief_.motion.lateral_std), P[VY][VY] = square(belief_.speed_std);
        P[AY][AY] = square(belief_.motion.acceleration_std);
        if (const Strip& strip = strips_[strip_of(m[X])]; strip.knows())
            m[VY] = strip.mean(), P[VY][VY] = strip.variance() + square(belief_.strip_std);
        state = prior;
        for (int k = 0; k < FIRST_PASSES; ++k) {
            const auto at = state.mean;
            state = prior;
            if (!update_about(at, {0.0, 1.0}, state, box, std::numeric_limits<double>::infinity(), camera_))
                return false;
        }
        return true;
    }

    Camera camera_;
    Belief belief_;
    std::vector<SensorErrors> errors_;
    std::vector<Strip> strips_;
    std::map<std::int64_t, Track> tracks_;
};

}  // namespace jeat::road
