// Motion of the camera between two scans; the formulas are in filters/camera_motion.py.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "constants.hpp"
#include "filters/box_sides.hpp"

namespace jeat::filters {

struct CameraVariance {
    double shift, scale;
    std::array<double, 3> last{};  // the last motion, per second
};

struct CameraMotion {
    bool known = false;
    std::array<double, 3> theta{};
    std::array<double, 2> variance{};  // of the shift
};

// A track that is compared with the boxes, and what was found of it.
struct CameraTrack {
    double x, y, w, h, scale, Sx, Sy, Sw, Sh;
    double widest;  // a box that is wider is no pair
};

inline double widest_pair(double width, double log_width_variance) {
    return exp_of(std::sqrt(kPairingGate * log_width_variance)) * width;
}

namespace detail {

// Invert a symmetric positive definite 3 x 3 matrix.
inline std::array<double, 9> inverse3(const std::array<double, 9>& a) {
    const double c0 = a[4] * a[8] - a[5] * a[7], c1 = a[5] * a[6] - a[3] * a[8], c2 = a[3] * a[7] - a[4] * a[6];
    const double det = a[0] * c0 + a[1] * c1 + a[2] * c2;
    return {c0 / det, (a[2] * a[7] - a[1] * a[8]) / det, (a[1] * a[5] - a[2] * a[4]) / det,
            c1 / det, (a[0] * a[8] - a[2] * a[6]) / det, (a[2] * a[3] - a[0] * a[5]) / det,
            c2 / det, (a[1] * a[6] - a[0] * a[7]) / det, (a[0] * a[4] - a[1] * a[3]) / det};
}

inline double median(std::vector<double> values) {
    const std::size_t n = values.size();
    std::sort(values.begin(), values.end());
    return n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

}  // namespace detail

// Tracks and boxes that are each other's nearest, where the camera moved as expected; (track, box) in order of tracks.
inline std::vector<std::pair<std::size_t, std::size_t>> nearest_pairs(const std::vector<CameraTrack>& tracks,
                                                                      const std::vector<Sides>& boxes,
                                                                      const ByLeft& index,
                                                                      const std::array<double, 3>& moved, double width,
                                                                      double height, double variance) {
    const std::size_t none = boxes.size();
    std::vector<std::size_t> box_of(tracks.size(), none), track_of(boxes.size(), tracks.size());
    std::vector<double> best_track(tracks.size(), kPairingGate), best_box(boxes.size(), kPairingGate);
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        const CameraTrack& t = tracks[i];
        const double allowance = variance * square(t.scale);
        const double x0 = t.x + moved[0] + moved[2] * (t.x - width / 2.0);
        const double y0 = t.y + moved[1] + moved[2] * (t.y - height / 2.0);
        // A box that is near in centre and in ln width has its left side near, too.
        const double dx = std::sqrt(kPairingGate * (t.Sx + allowance));
        const double dy = std::sqrt(kPairingGate * (t.Sy + allowance)) * (1.0 + kRounding), most = t.widest / 2.0;
        index.with_left_in(x0 - dx - most, x0 + dx, [&](std::size_t j, const Sides& b) {
            const double x = (b.left + b.right) / 2.0 - x0, y = (b.top + b.bottom) / 2.0 - y0;
            if (!(std::abs(y) <= dy)) return;
            double d2 = x * x / (t.Sx + allowance) + y * y / (t.Sy + allowance);
            if (d2 >= kPairingGate) return;
            d2 += square(log_of(b.width() / t.w)) / t.Sw + square(log_of(b.height() / t.h)) / t.Sh;
            if (d2 < best_track[i] || (d2 == best_track[i] && j < box_of[i])) best_track[i] = d2, box_of[i] = j;
            if (d2 < best_box[j]) best_box[j] = d2, track_of[j] = i;
        });
    }
    std::vector<std::pair<std::size_t, std::size_t>> out;
    for (std::size_t i = 0; i < tracks.size(); ++i)
        if (box_of[i] != none && track_of[box_of[i]] == i) out.emplace_back(i, box_of[i]);
    return out;
}

// Whether boxes speak against a motion that pictures show: far fewer tracks have one where it `moved` them.
inline bool contradicted(const std::vector<CameraTrack>& tracks, const std::vector<CameraTrack>& moved,
                         const std::vector<Sides>& boxes, const ByLeft& index, const CameraVariance& prior) {
    if (tracks.size() < kLeastWitnesses || boxes.empty()) return false;
    const double variance = std::min(prior.shift * kPairingDeviations, kPairingMost);
    const std::size_t without = nearest_pairs(tracks, boxes, index, {}, 0.0, 0.0, variance).size();
    const std::size_t paired = nearest_pairs(moved, boxes, index, {}, 0.0, 0.0, variance).size();
    return without >= kLeastWitnesses && 10 * paired < kLeastTenths * without;
}

inline CameraMotion estimate_camera(const std::vector<CameraTrack>& tracks, const std::vector<Sides>& boxes,
                                    const ByLeft& index, double width, double height, double dt, CameraVariance& prior,
                                    const ModelConstants& c) {
    CameraMotion out;
    if (tracks.size() < kLeastTracks || boxes.empty()) return out;
    const double variance = std::min(prior.shift * kPairingDeviations, kPairingMost);
    auto pairs = nearest_pairs(tracks, boxes, index, {}, width, height, variance);
    // The camera may have gone on as before: rows of like objects are else taken for their neighbours.
    {
        const std::array<double, 3> again{prior.last[0] * dt, prior.last[1] * dt, prior.last[2] * dt};
        auto moved = nearest_pairs(tracks, boxes, index, again, width, height, variance);
        if (moved.size() > pairs.size()) pairs = std::move(moved);
    }
    if (pairs.size() < kLeastTracks) return out;
    std::vector<std::array<double, 6>> rows;  // y (2), variance (2), place from the middle (2)
    std::vector<double> scales;
    for (const auto& [i, j] : pairs) {
        const CameraTrack& t = tracks[i];
        const Sides& b = boxes[j];
        rows.push_back({(b.left + b.right) / 2.0 - t.x, (b.top + b.bottom) / 2.0 - t.y, t.Sx, t.Sy, t.x - width / 2.0,
                        t.y - height / 2.0});
        scales.push_back(t.scale);
    }
    const double typical = detail::median(scales);
    const double precision[] = {1.0 / (prior.shift * square(typical)), 1.0 / (prior.shift * square(typical)),
                                1.0 / prior.scale};
    std::array<double, 9> covariance{};
    for (int k = 0; k < kReweightings; ++k) {
        std::array<double, 9> information{precision[0], 0, 0, 0, precision[1], 0, 0, 0, precision[2]};
        std::array<double, 3> right{};
        for (const auto& r : rows) {
            double residual[2], d2 = 0.0;
            for (int a = 0; a < 2; ++a) {
                residual[a] = r[a] - out.theta[a] - out.theta[2] * r[4 + a];
                d2 += square(residual[a]) / r[2 + a];
            }
            const double weight = (kReweighting + 2.0) / (kReweighting + d2);
            for (int a = 0; a < 2; ++a) {
                const double w = weight / r[2 + a], place = r[4 + a];
                information[a * 4] += w;
                information[a * 3 + 2] += w * place;
                information[6 + a] += w * place;
                information[8] += w * place * place;
                right[a] += w * r[a];
                right[2] += w * place * r[a];
            }
        }
        covariance = detail::inverse3(information);
        for (int a = 0; a < 3; ++a)
            out.theta[a] =
                covariance[a * 3] * right[0] + covariance[a * 3 + 1] * right[1] + covariance[a * 3 + 2] * right[2];
    }
    out.known = true;
    out.variance = {covariance[0], covariance[4]};
    prior.last = {out.theta[0] / dt, out.theta[1] / dt, out.theta[2] / dt};
    const double keep = c.camera_memory;
    const double shift = (square(out.theta[0]) + covariance[0] + square(out.theta[1]) + covariance[4]) / 2.0;
    prior.shift = clamp(keep * prior.shift + (1.0 - keep) * shift / square(typical), square(c.camera_shift_bounds.low),
                        square(c.camera_shift_bounds.high));
    prior.scale = clamp(keep * prior.scale + (1.0 - keep) * (square(out.theta[2]) + covariance[8]),
                        square(c.camera_scale_bounds.low), square(c.camera_scale_bounds.high));
    return out;
}

inline void compensate(double* mean, double* covariance, const CameraMotion& motion, double width, double height,
                       double lasting) {
    const double middle[] = {width / 2.0, height / 2.0}, scale = motion.theta[2];
    for (int axis = 0; axis < 2; ++axis) {
        double* const m = mean + axis * kStates;
        const double shift = motion.theta[axis] + scale * (m[kPosition] - middle[axis]);
        m[kPosition] += shift;
        m[kVelocity] += lasting * shift;
        m[kLogSize] += scale;
        m[kGrowth] += lasting * scale;
        covariance[axis * kMatrix] += motion.variance[axis];
    }
}

}  // namespace jeat::filters
