#include "tracking/follow.hpp"

#include <cmath>

#include "tracking/life.hpp"

namespace jeat::tracking {

namespace {

// A track and its innovations by a sensor of noise rho^2, as the camera's motion is found from them.
CameraTrack camera_track(const double* mean, const double* P, double rho2, const ModelConstants& c) {
    const Sides box = expected_corners(mean);
    const double w = box.width(), h = box.height(), both = std::sqrt(w * h);
    const double Rw = side_variance(w, both, rho2, c), Rh = side_variance(h, both, rho2, c);
    const auto sum = [](const double* Q, int i, int j) {
        return Q[i * kStates + i] + 2.0 * Q[i * kStates + j] + Q[j * kStates + j];
    };
    const double log_width_variance = sum(P, kLogSize, kSizeError) + 2.0 * Rw / (w * w);
    return {(box.left + box.right) / 2.0,
            (box.top + box.bottom) / 2.0,
            w,
            h,
            both,
            sum(P, kPosition, kPositionError) + Rw / 2.0,
            sum(P + kMatrix, kPosition, kPositionError) + Rh / 2.0,
            log_width_variance,
            sum(P + kMatrix, kLogSize, kSizeError) + 2.0 * Rh / (h * h),
            widest_pair(w, log_width_variance)};
}

}  // namespace

void CameraFollower::follow_picture(State& state, std::size_t sensor, const CorrectedBoxes& scan,
                                    const PictureMotion* motion, double step_s) {
    CameraVelocity& camera = state.camera_velocity;
    camera = camera.at(state.t);
    if (!motion || state.t <= camera.picture_s) return;
    const CameraVelocity now = CameraVelocity::after(*motion, state.t);
    Tracks& tracks = state.tracks;
    changes_.clear();
    for (std::size_t i = 0; i < tracks.size(); ++i)
        changes_.push_back(camera_change(tracks.mean_of(i), tracks.evidence.last_s[i], *motion, camera, now, step_s));
    find_surely_there(state, sensor);
    moved_ = tracks_;
    for (std::size_t k = 0; k < moved_.size(); ++k) {
        const CameraChange& change = changes_[rows_[k]];
        moved_[k].x += change.rate[0] * change.elapsed;
        moved_[k].y += change.rate[1] * change.elapsed;
    }
    if (contradicted(tracks_, moved_, scan.boxes, scan.index, state.camera)) return;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        follow(tracks.mean_of(i), tracks.covariance_of(i), changes_[i], *motion, camera, now);
    state.camera_path.follow(camera, now, state.width, state.height, step_s);
    camera = now;
}

void CameraFollower::follow_camera(State& state, std::size_t sensor, const CorrectedBoxes& scan, double dt) {
    if (dt <= 0.0) return;  // no time, no motion
    const ModelConstants& c = state.constants;
    find_surely_there(state, sensor);
    const CameraMotion motion =
        estimate_camera(tracks_, scan.boxes, scan.index, state.width, state.height, dt, state.camera, c);
    if (!motion.known) return;
    const double lasting = (1.0 - exp_of(-dt / c.camera_time_s)) / dt;
    state.camera_path.follow(motion, lasting);
    Tracks& tracks = state.tracks;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        compensate(tracks.mean_of(i), tracks.covariance_of(i), motion, state.width, state.height, lasting);
}

// The tracks that show the camera's motion: really there, and seen lately.
void CameraFollower::find_surely_there(const State& state, std::size_t sensor) {
    const Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    const double rho2 = state.noise(sensor);
    tracks_.clear();
    rows_.clear();
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        if (!(tracks.real[i] > c.report) || !(tracks.evidence.detections[i] > kCameraDetections) ||
            !(unseen_for(state, i) < kCameraAgeS))
            continue;
        rows_.push_back(i);
        tracks_.push_back(camera_track(tracks.mean_of(i), tracks.covariance_of(i), rho2, c));
    }
}

}  // namespace jeat::tracking
