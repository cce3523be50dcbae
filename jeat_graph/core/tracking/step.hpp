// One step: predict, correct boxes, follow picture and camera, associate, update, hits and misses, births, compare sensors,
// posterior, learn, report, end. Every stage writes what is behind its name in state.hpp; the definition, stage by
// stage, is jeat_graph/tracking/reference.py.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <optional>
#include <vector>

#include "arrays.hpp"
#include "association/assignment.hpp"
#include "association/likelihood_ratio.hpp"
#include "constants.hpp"
#include "filters/noise_learning.hpp"
#include "smoothers/histories.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

using smoothers::Record;

// One scan of a sensor.
struct Scan {
    std::size_t sensor = 0;
    std::vector<Sides> boxes;
    std::vector<double> logits;
    // How much more likely each box is of a track than of another by its appearance: ln ratio, (tracks, boxes).
    View2<const double> similarity{nullptr, 0, 0};
    // Where who is who is given: whose each box is, below 0 for nobody's, and whether later ones are the same one's.
    // Empty where the tracker decides. At most one box of a scan has the same owner.
    std::vector<std::int64_t> owners;
    std::vector<std::uint8_t> awaited;
    std::vector<double> later;         // posteriors by what comes later, to the smoother
    std::vector<std::int64_t> assigned;  // written: the track that each box went to
    std::vector<double> nis;           // written: squared distance of its centre, NaN where it began a track
    double noise_scale = 1.0;          // written: variance of the sensor's sides, 1 before anything was learnt
};

class Step {
public:
    explicit Step(State& state) : s_(state), c_(state.constants), logs_(c_) {}

    // Take in all scans of one time, at most one of each sensor; `motion`, if known, is that of the camera since its
    // picture before. `reported` is written.
    void run(double t, std::vector<Scan>& scans, const PictureMotion* motion, std::vector<std::uint8_t>& reported,
             Record* record) {
        std::fill(s_.tracks.used.begin(), s_.tracks.used.end(), 0);
        step_s_ = s_.started ? s_.t : t;
        for (const std::size_t place : order_of(scans)) {
            Scan& scan = scans[place];
            const ScanClock clock = begin_scan(t, scan);
            if (record) write_growth(*record);
            predict(t);
            correct_boxes(scan);
            follow_picture(motion, scan);
            follow_camera(scan);
            if (record) write_predictions(*record, scan.sensor);
            associate(scan);
            count_gaps();
            learn_noise(scan, clock);
            update(record);
            await(scan);
            count_hits_and_misses(scan, clock);
            count_clutter(scan);
            begin_tracks(scan, clock);
            compare_sensors(scan);
            if (record) write_updates(*record, scan);
        }
        compare_overlaps();
        judge();
        count_false_boxes(scans);
        learn(t);
        report(reported);
        if (!record) return;
        record->gaps = s_.gaps;
        record->track_id = s_.tracks.track_id;
        smoothers::Entry* const entries = record->last_scan();
        for (std::size_t i = 0; entries && i < s_.tracks.size(); ++i) {
            entries[i].real = s_.tracks.real[i];
            entries[i].used = s_.tracks.used[i];
            entries[i].confirmed = s_.tracks.evidence.confirmed_s[i] == s_.t;
            entries[i].missed = entries[i].confirmed ? 0.0 : s_.tracks.evidence.missed[i];
            entries[i].last_of_step = true;
        }
    }

    // End the tracks that are false, gone, outside, or unseen for too long; their evidence stays.
    void end_tracks(Record* record) {
        Tracks& tracks = s_.tracks;
        std::vector<std::uint8_t> ends(tracks.size()), kept(tracks.size());
        bool any = false;
        for (std::size_t i = 0; i < tracks.size(); ++i) {
            const double gap = unseen_for(i), real = tracks.real[i];
            ends[i] = !tracks.awaited[i] &&
                      (gap > c_.longest_gap_s || (real < c_.report && gap > c_.doubtful_gap_s) ||
                      (real < c_.false_posterior && gap > c_.false_gap_s) ||
                      1.0 - tracks.presence[i * kPresences + kGone] < c_.least_presence ||
                      (gap > c_.outside_gap_s && share_inside(i) < c_.outside_share));
            kept[i] = !ends[i];
            if (!ends[i]) continue;
            any = true;
            if (real > c_.report) s_.gaps.count_loss();
        }
        if (record) record->kept = kept, record->gaps_after = s_.gaps;
        if (any) end(ends, kept);
    }

    // End all tracks and go on from another time, as if none had passed; what was learnt stays.
    void reset(double t) {
        Tracks& tracks = s_.tracks;
        end(std::vector<std::uint8_t>(tracks.size(), 1), std::vector<std::uint8_t>(tracks.size(), 0));
        if (!s_.started) return;
        for (Sensor& sensor : s_.sensors) {
            // It has had no scan since: not for less than the time between two of its scans.
            const double period = std::isnan(sensor.period_s) ? c_.first_period_s : sensor.period_s;
            sensor.last_scan_s = t - clamp(s_.t - sensor.last_scan_s, period, kLongestAgoS);
        }
        s_.learnt_s = t - clamp(s_.t - s_.learnt_s, 0.0, kLongestAgoS);
        s_.t = t;
        s_.started = false;
        s_.camera_velocity = {};
    }

private:
    // End the marked tracks: their evidence is kept.
    void end(const std::vector<std::uint8_t>& ends, const std::vector<std::uint8_t>& kept) {
        s_.ended.append(s_.tracks.evidence, ends);
        if (const auto most = static_cast<std::size_t>(c_.remembered_tracks); s_.ended.size() > most) {
            std::vector<std::uint8_t> last(s_.ended.size(), 1);
            std::fill(last.begin(), last.end() - static_cast<std::ptrdiff_t>(most), 0);
            keep_rows(s_.ended, last);
        }
        keep_rows(s_.tracks, kept);
    }

    std::vector<std::size_t> order_of(const std::vector<Scan>& scans) const {
        std::vector<std::size_t> order(scans.size());
        std::iota(order.begin(), order.end(), std::size_t{0});
        std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
            const double va = s_.noise(scans[a].sensor), vb = s_.noise(scans[b].sensor);
            if (va != vb) return va < vb;
            if (scans[a].logits != scans[b].logits) return scans[a].logits < scans[b].logits;
            for (std::size_t k = 0; k < scans[a].boxes.size(); ++k) {
                const Sides &x = scans[a].boxes[k], &y = scans[b].boxes[k];
                const double left[] = {x.left, x.top, x.right, x.bottom}, right[] = {y.left, y.top, y.right, y.bottom};
                for (int i = 0; i < 4; ++i)
                    if (left[i] != right[i]) return left[i] < right[i];
            }
            return a < b;
        });
        return order;
    }

    ScanClock begin_scan(double t, const Scan& scan) {
        Sensor& sensor = s_.sensors[scan.sensor];
        if (!s_.picture_known) {
            for (const Sides& box : scan.boxes) {
                s_.width = std::max(s_.width, box.right);
                s_.height = std::max(s_.height, box.bottom);
            }
        }
        if (!std::isnan(sensor.last_scan_s)) {
            const double since = t - sensor.last_scan_s;
            sensor.period_s = std::isnan(sensor.period_s)
                                  ? since
                                  : kPeriodMemory * sensor.period_s + (1.0 - kPeriodMemory) * since;
        }
        sensor.last_scan_s = t;
        if (s_.picture_known)
            for (const Sides& box : scan.boxes) {
                const double out = std::max(std::max(-box.left, -box.top), std::max(box.right - s_.width, box.bottom - s_.height));
                sensor.boxes_beyond += out > c_.edge_px;
                sensor.boxes_at_edge += edges_of(box, s_.width, s_.height, c_).any();
            }
        sensor.repetition.count(scan.boxes, scan.logits, c_);
        s_.belief.decision_threshold[scan.sensor] =
            std::isnan(sensor.even_logit) ? sensor.repetition.decision_threshold(c_) : sensor.even_logit;
        const double period = std::isnan(sensor.period_s) ? c_.first_period_s : sensor.period_s;
        return {t, period, c_};
    }

    void predict(double t) {
        const double dt = s_.started ? t - s_.t : 0.0;
        s_.t = t;
        s_.started = true;
        const auto ticks = static_cast<std::int64_t>(std::nearbyint(dt * filters::kTicksPerS));
        if (ticks != ticks_) {
            ticks_ = ticks;
            step_ = discretise(static_cast<double>(ticks) / filters::kTicksPerS, c_);
            presence_step_ = presence_transition(static_cast<double>(ticks) / filters::kTicksPerS, c_);
        }
        if (dt <= 0.0) return;
        const Densities densities(s_.process_noise, exp_of(s_.log_scene_variance()));
        Tracks& tracks = s_.tracks;
        for (std::size_t i = 0; i < tracks.size(); ++i) {
            with_camera(tracks.mean_of(i), s_.camera_velocity, dt, [&] {
                filters::predict(tracks.mean_of(i), tracks.covariance_of(i), step_, dt, densities, c_);
            });
            predict_presence(tracks.presence.data() + i * kPresences, presence_step_);
        }
    }

    void correct_boxes(const Scan& scan) {
        const auto offset = s_.offsets.offset(scan.sensor, s_.noises(), c_);
        boxes_.clear();
        edges_.clear();
        const Sensor& sensor = s_.sensors[scan.sensor];
        const bool ends = s_.picture_known && sensor.boxes_at_edge >= sensor.boxes_beyond;
        for (const Sides& box : scan.boxes) {
            boxes_.push_back(corrected(box, offset));
            edges_.push_back(ends ? edges_of(box, s_.width, s_.height, c_) : Edges{});
        }
        index_.emplace(boxes_);
    }

    // Once a time: with its first scan. A motion that its boxes speak against is none.
    void follow_picture(const PictureMotion* motion, const Scan& scan) {
        CameraVelocity& camera = s_.camera_velocity;
        camera = camera.at(s_.t);
        if (!motion || s_.t <= camera.picture_s) return;
        const CameraVelocity now = CameraVelocity::after(*motion, s_.t);
        Tracks& tracks = s_.tracks;
        changes_.clear();
        for (std::size_t i = 0; i < tracks.size(); ++i)
            changes_.push_back(camera_change(tracks.mean_of(i), tracks.evidence.last_s[i], *motion, camera, now, step_s_));
        see_sure_tracks(s_.noise(scan.sensor));
        moved_tracks_ = camera_tracks_;
        for (std::size_t k = 0; k < moved_tracks_.size(); ++k) {
            const CameraChange& change = changes_[sure_rows_[k]];
            moved_tracks_[k].x += change.rate[0] * change.elapsed;
            moved_tracks_[k].y += change.rate[1] * change.elapsed;
        }
        if (contradicted(camera_tracks_, moved_tracks_, boxes_, *index_, s_.camera)) return;
        for (std::size_t i = 0; i < tracks.size(); ++i)
            follow(tracks.mean_of(i), tracks.covariance_of(i), changes_[i], *motion, camera, now);
        camera = now;
    }

    // The tracks that show the camera's motion: really there, and seen lately.
    void see_sure_tracks(double rho2) {
        Tracks& tracks = s_.tracks;
        camera_tracks_.clear();
        sure_rows_.clear();
        for (std::size_t i = 0; i < tracks.size(); ++i) {
            if (!(tracks.real[i] > c_.report) || !(tracks.evidence.detections[i] > kCameraDetections) ||
                !(unseen_for(i) < kCameraAgeS))
                continue;
            const double *m = tracks.mean_of(i), *P = tracks.covariance_of(i);
            const Sides box = expected_corners(m);
            const double w = box.width(), h = box.height(), both = std::sqrt(w * h);
            const double Rw = side_variance(w, both, rho2, c_), Rh = side_variance(h, both, rho2, c_);
            const auto sum = [](const double* Q, int i, int j) { return Q[i * kStates + i] + 2.0 * Q[i * kStates + j] + Q[j * kStates + j]; };
            sure_rows_.push_back(i);
            const double log_width_variance = sum(P, kLogSize, kSizeError) + 2.0 * Rw / (w * w);
            camera_tracks_.push_back({(box.left + box.right) / 2.0, (box.top + box.bottom) / 2.0, w, h, both,
                                      sum(P, kPosition, kPositionError) + Rw / 2.0,
                                      sum(P + kMatrix, kPosition, kPositionError) + Rh / 2.0,
                                      log_width_variance,
                                      sum(P + kMatrix, kLogSize, kSizeError) + 2.0 * Rh / (h * h),
                                      widest_pair(w, log_width_variance)});
        }
    }

    void follow_camera(const Scan& scan) {
        Tracks& tracks = s_.tracks;
        const double rho2 = s_.noise(scan.sensor), dt = static_cast<double>(ticks_) / filters::kTicksPerS;
        if (ticks_ <= 0) return;  // no time, no motion
        see_sure_tracks(rho2);
        const CameraMotion motion = estimate_camera(camera_tracks_, boxes_, *index_, s_.width, s_.height, dt, s_.camera, c_);
        if (!motion.known) return;
        const double lasting = (1.0 - exp_of(-dt / c_.camera_time_s)) / dt;
        for (std::size_t i = 0; i < tracks.size(); ++i)
            compensate(tracks.mean_of(i), tracks.covariance_of(i), motion, s_.width, s_.height, lasting);
    }

    void associate(Scan& scan) {
        Tracks& tracks = s_.tracks;
        const std::size_t n = tracks.size(), k = scan.sensor;
        const double rho2 = s_.noise(k);
        scan.noise_scale = rho2 / square(c_.side_std);
        expected_.resize(n);
        p_detect_.resize(n);
        q_.resize(boxes_.size());
        of_clutter_.resize(boxes_.size());
        double least_of_clutter = 1.0;
        for (std::size_t j = 0; j < boxes_.size(); ++j) {
            q_[j] = expit(scan.logits[j] - s_.belief.decision_threshold[k]);
            of_clutter_[j] = association::score_likelihood(c_.clutter_precision, q_[j], c_);
            least_of_clutter = std::min(least_of_clutter, of_clutter_[j]);
        }
        const association::ScanTerms terms(s_.sensors[k].leftovers, s_.width * s_.height, c_);
        const ByLeft& index = *index_;
        weigh_boxes(scan, index);
        order_owners(scan);
        pairs_.clear();
        for (std::size_t i = 0; i < n; ++i) {
            may_be_interrupted();
            p_detect_[i] = own_p_detect(i, k);
            expected_[i] = expected_sides(tracks.mean_of(i), tracks.covariance_of(i), rho2, c_);
            const SidesExpected& expected = expected_[i];
            const double p = clamp(tracks.presence[i * kPresences + kVisible] * p_detect_[i],
                                   association::kLeastPDetect, association::kMostPDetect);
            const double clutter = terms.log_clutter - log_of(expected.size[0] * expected.size[1]);
            const double real = std::max(tracks.real[i], association::kLeastPosterior);
            const double start = log_of(p / (1.0 - p)) - clutter;
            // A box that the edge cuts may lie farther off, but is only compared so where the object reaches the edge.
            const double best = (std::max(real, 1.0 - real) + c_.score_floor) / least_of_clutter;
            const association::Gates gates = reaches_edge(expected.box)
                                                 ? association::Gates(c_)
                                                 : association::Gates(expected, start + log_of(best), terms, c_);
            const double reach = association::reach(expected, 0, gates, c_), above = association::reach(expected, 1, gates, c_);
            const auto gain_of = [&](std::size_t j) {
                const auto y = side_innovations(boxes_[j], expected.box);
                const Edges cut = unmeasured_sides(y, edges_[j]);
                const double density = cut.any()
                                           ? association::sides_log_density(y, with_cut(expected, cut, c_), terms, c_)
                                           : association::sides_log_density(y, expected, terms, c_);
                if (density <= association::kImpossible) return density;
                const double of_track = association::score_likelihood(real, q_[j], c_);
                return start + density + log_of(of_track / of_clutter_[j]);
            };
            if (tracks.given[i] >= 0) {
                // Its box is given, however far off: that is no reason to doubt that it is real.
                const std::size_t j = box_of(tracks.given[i]);
                if (j < boxes_.size()) pairs_.push_back({i, j, std::max(gain_of(j), association::kLeastGain)});
                continue;
            }
            index.with_left_in(expected.box.left - reach, expected.box.left + reach, [&](std::size_t j, const Sides& box) {
                if (std::abs(box.top - expected.box.top) > above || is_owned(scan, j)) return;
                const double gain = gain_of(j);
                if (gain > 0.0) pairs_.push_back({i, j, gain});
            });
        }
        made_ = assignment_.solve(by_appearance(scan), n, boxes_.size(), c_.exact_assignment);
    }

    bool reaches_edge(const Sides& box) const {
        return !(box.left > c_.edge_px && box.top > c_.edge_px && box.right < s_.width - c_.edge_px &&
                 box.bottom < s_.height - c_.edge_px);
    }

    // The boxes of a scan by their owners, where these are given.
    void order_owners(const Scan& scan) {
        owned_.clear();
        for (std::size_t j = 0; j < scan.owners.size(); ++j)
            if (scan.owners[j] >= 0) owned_.push_back({scan.owners[j], j});
        std::sort(owned_.begin(), owned_.end());
    }
    std::size_t box_of(std::int64_t owner) const {
        const auto at = std::lower_bound(owned_.begin(), owned_.end(), std::pair{owner, std::size_t{0}});
        return at == owned_.end() || at->first != owner ? boxes_.size() : at->second;
    }
    static bool is_owned(const Scan& scan, std::size_t j) { return !scan.owners.empty() && scan.owners[j] >= 0; }

    // Which boxes tell that their track is still there, by score and overlap with a better box of the scan.
    void weigh_boxes(const Scan& scan, const ByLeft& index) {
        confirms_.resize(boxes_.size());
        for (std::size_t j = 0; j < boxes_.size(); ++j) {
            may_be_interrupted();
            double overlap = 0.0;
            index.near(boxes_[j], [&](std::size_t other, const Sides& box) {
                if (scan.logits[other] > scan.logits[j])
                    overlap = std::max(overlap, intersection_over_union(boxes_[j], box));
            });
            const double odds = q_[j] / (1.0 - q_[j]) * (1.0 - overlap);
            confirms_[j] = odds / (1.0 + odds) >= c_.confirming;
        }
    }

    // The pairs with the similarity of their appearance, which decides the assignment, not whether there is an object.
    const std::vector<association::Pair>& by_appearance(const Scan& scan) {
        if (!scan.similarity.data) return pairs_;
        with_appearance_ = pairs_;
        for (association::Pair& pair : with_appearance_)
            if (pair.row < scan.similarity.rows)
                pair.gain = std::max(pair.gain + scan.similarity[pair.row][pair.column], association::kLeastGain);
        return with_appearance_;
    }

    void count_gaps() {
        Tracks& tracks = s_.tracks;
        for (const std::size_t k : made_) {
            const std::size_t i = pairs_[k].row;
            const double gap = tracks.evidence.missed[i];
            if (!(tracks.real[i] > c_.report) || !(gap > 0.0) || !confirms_[pairs_[k].column]) continue;
            s_.gaps.count_end(gap, intersection_over_union(expected_[i].box, boxes_[pairs_[k].column]) >= c_.gap_overlap);
        }
    }

    void learn_noise(const Scan& scan, const ScanClock& clock) {
        Tracks& tracks = s_.tracks;
        InnovationSums sums;
        innovations_.clear();
        for (const std::size_t k : made_) {
            const std::size_t i = pairs_[k].row;
            const auto& y = innovations_.emplace_back(side_innovations(boxes_[pairs_[k].column], expected_[i].box));
            const Innovation e = normalised_innovation(y, expected_[i], c_);
            double* const before = tracks.innovation.data() + i * 4;
            if (edges_[pairs_[k].column].any()) {
                tracks.has_innovation[i] = 0;
                continue;
            }
            if (tracks.evidence.detections[i] > c_.noise_hits && tracks.real[i] > c_.report)
                sums.add(e, before, tracks.has_innovation[i], c_);
            std::copy(e.begin(), e.end(), before);
            tracks.has_innovation[i] = 1;
        }
        filters::learn_noise(sums, clock.period_s, s_.log_side_variance[scan.sensor], s_.process_noise, c_);
    }

    void update(Record* record) {
        Tracks& tracks = s_.tracks;
        smoothers::Entry* const entries = record ? record->last_scan() : nullptr;
        for (std::size_t m = 0; m < made_.size(); ++m) {
            const std::size_t i = pairs_[made_[m]].row;
            const Edges cut = unmeasured_sides(innovations_[m], edges_[pairs_[made_[m]].column]);
            const SidesExpected expected = cut.any() ? with_cut(expected_[i], cut, c_) : expected_[i];
            std::array<double, 4> left_over = innovations_[m];
            // To the smoother a side that shows again is part of the prediction: the states before did not know of it.
            if (filters::uncover_sides(tracks.mean_of(i), tracks.covariance_of(i), left_over, expected, cut, logs_, c_) && record)
                write_prediction(entries[i], i);
            filters::update(tracks.mean_of(i), tracks.covariance_of(i), innovations_[m], left_over, expected, cut, logs_, c_);
        }
    }

    // Of the tracks whose boxes are given, whether more are to come.
    void await(const Scan& scan) {
        if (scan.owners.empty()) return;
        for (const std::size_t k : made_) s_.tracks.awaited[pairs_[k].row] = scan.awaited[pairs_[k].column];
    }

    void count_hits_and_misses(const Scan& scan, const ScanClock& clock) {
        Tracks& tracks = s_.tracks;
        const std::size_t n = tracks.size(), S = s_.sensors.size(), k = scan.sensor;
        taken_by_.assign(boxes_.size(), n);
        pair_of_.assign(n, pairs_.size());
        for (const std::size_t p : made_) {
            taken_by_[pairs_[p].column] = pairs_[p].row;
            pair_of_[pairs_[p].row] = p;
        }
        const double keep = exp_of(-clock.weight * c_.correlation_time_s / c_.track_p_detect_memory_s);
        for (std::size_t i = 0; i < n; ++i) {
            double* const presence = tracks.presence.data() + i * kPresences;
            double &hits = tracks.recent_hits[i * S + k], &misses = tracks.recent_misses[i * S + k];
            hits *= keep;
            misses *= keep;
            const bool stationary = is_stationary(i);
            tracks.evidence.expect_hit(i, p_detect_[i], tracks.sees[i * S + k], clock);
            if (pair_of_[i] == pairs_.size()) {
                const double visible = presence[kVisible];
                miss_presence(presence, stationary ? p_detect_[i] * (1.0 - s_.belief.stationary_unseen[k]) : p_detect_[i]);
                tracks.evidence.count_miss(i, k, visible, stationary, clock.weight);
                misses += clock.weight * visible;
            } else {
                const association::Pair& pair = pairs_[pair_of_[i]];
                see_presence(presence);
                tracks.evidence.count_hit(i, k, scan.logits[pair.column], pair.gain, stationary,
                                          confirms_[pair.column], clock, c_);
                hits += clock.weight;
                tracks.used[i] |= std::int64_t{1} << k;
            }
        }
    }

    void count_clutter(const Scan& scan) {
        free_.clear();
        for (std::size_t j = 0; j < boxes_.size(); ++j)
            if (taken_by_[j] == s_.tracks.size()) free_.push_back(j);
        double& mean = s_.sensors[scan.sensor].leftovers;
        mean = c_.clutter_memory * mean + (1.0 - c_.clutter_memory) * static_cast<double>(free_.size());
    }

    void begin_tracks(Scan& scan, const ScanClock& clock) {
        Tracks& tracks = s_.tracks;
        const std::size_t n = tracks.size(), k = scan.sensor;
        rivals_.clear();
        for (std::size_t i = 0; i < n && !free_.empty(); ++i)
            if (tracks.real[i] > c_.rival && unseen_for(i) < c_.rival_age_s) rivals_.push_back(corners(tracks.mean_of(i)));
        const ByLeft rivals(rivals_);
        free_boxes_.clear();
        for (const std::size_t j : free_) free_boxes_.push_back(boxes_[j]);
        const ByLeft among(free_boxes_);
        append_rows(tracks, n, free_.size());
        const double rho2 = s_.noise(k);
        for (std::size_t f = 0; f < free_.size(); ++f) {
            const std::size_t row = n + f, j = free_[f];
            may_be_interrupted();
            double overlap = 0.0;
            rivals.near(boxes_[j], [&](std::size_t, const Sides& rival) {
                overlap = std::max(overlap, intersection_over_union(boxes_[j], rival));
            });
            among.near(boxes_[j], [&](std::size_t g, const Sides& box) {
                if (scan.logits[free_[g]] > scan.logits[j])
                    overlap = std::max(overlap, intersection_over_union(boxes_[j], box));
            });
            initial_state(boxes_[j], edges_[j], rho2, exp_of(s_.log_scene_variance()), c_, tracks.mean_of(row), tracks.covariance_of(row));
            with_velocity(tracks.mean_of(row), s_.camera_velocity);
            tracks.track_id[row] = s_.next_id++;
            tracks.given[row] = scan.owners.empty() ? -1 : scan.owners[j];
            tracks.awaited[row] = !scan.owners.empty() && scan.awaited[j];
            tracks.used[row] = std::int64_t{1} << k;
            see_presence(tracks.presence.data() + row * kPresences);
            tracks.evidence.begin(row, clock.t, k, scan.logits[j], overlap, clock.weight);
            taken_by_[j] = row;
        }
        scan.nis.assign(boxes_.size(), std::numeric_limits<double>::quiet_NaN());
        for (std::size_t m = 0; m < made_.size(); ++m) {
            const association::Pair& pair = pairs_[made_[m]];
            scan.nis[pair.column] = centre_distance(innovations_[m], expected_[pair.row]);
        }
        scan.assigned.resize(boxes_.size());
        for (std::size_t j = 0; j < boxes_.size(); ++j) scan.assigned[j] = tracks.track_id[taken_by_[j]];
    }

    void compare_sensors(const Scan& scan) {
        Tracks& tracks = s_.tracks;
        const std::size_t S = s_.sensors.size(), k = scan.sensor;
        for (std::size_t other = 0; other < S; ++other) {
            if (other == k) continue;
            const auto expected = s_.offsets.mean(k, other, c_);
            for (std::size_t j = 0; j < scan.boxes.size(); ++j) {
                const std::size_t i = taken_by_[j];
                const Sides& before = tracks.last_box[i * S + other];
                const double age = s_.t - tracks.last_box_s[i * S + other];
                if (!(before.right > before.left) || age > c_.offset_age_s || !(tracks.real[i] > c_.report)) continue;
                const double* const m = tracks.mean_of(i);
                const auto d = difference(scan.boxes[j], before, m[kVelocity] * age, m[kStates + kVelocity] * age);
                s_.offsets.count(k, other, d, expected, c_);
                compare_errors(i, k, other, clipped(d, expected, c_));
            }
        }
        for (std::size_t j = 0; j < scan.boxes.size(); ++j) {
            tracks.last_box[taken_by_[j] * S + k] = scan.boxes[j];
            tracks.last_box_s[taken_by_[j] * S + k] = s_.t;
        }
    }

    // Count what lasts of the differences of two sensors; keep this one where the last is old.
    void compare_errors(std::size_t row, std::size_t k, std::size_t other, const std::array<double, 4>& d) {
        Tracks& tracks = s_.tracks;
        const std::size_t S = s_.sensors.size(), at = (row * S + k) * S + other;
        const double age = tracks.has_apart[at] ? s_.t - tracks.apart_s[at] : std::numeric_limits<double>::infinity();
        if (age < c_.lasting_after_s) return;
        double* const before = tracks.apart.data() + at * 4;
        if (age <= c_.lasting_within_s) s_.accuracy.count(k, other, product_of(d, before));
        std::copy(d.begin(), d.end(), before);
        tracks.apart_s[at] = s_.t;
        tracks.has_apart[at] = 1;
    }

    // Keep of each track that was found now the least overlap ever with a better one.
    void compare_overlaps() {
        Tracks& tracks = s_.tracks;
        const auto compared = [&](std::size_t i) {
            return unseen_for(i) < kSameTimeS && tracks.evidence.overlap[i] != 0.0;
        };
        std::size_t first = 0;
        while (first < tracks.size() && !compared(first)) ++first;
        if (first == tracks.size()) return;
        tracks_boxes_.resize(tracks.size());
        for (std::size_t i = 0; i < tracks.size(); ++i) tracks_boxes_[i] = corners(tracks.mean_of(i));
        const ByLeft index(tracks_boxes_);
        for (std::size_t i = first; i < tracks.size(); ++i) {
            if (!compared(i)) continue;
            may_be_interrupted();
            double most = 0.0;
            index.near(tracks_boxes_[i], [&](std::size_t j, const Sides& box) {
                if (tracks.log_odds[j] > tracks.log_odds[i] && tracks.evidence.detections[j] >= tracks.evidence.detections[i])
                    most = std::max(most, intersection_over_union(tracks_boxes_[i], box));
            });
            tracks.evidence.overlap[i] = std::min(tracks.evidence.overlap[i], most);
        }
    }

    void judge() {
        Tracks& tracks = s_.tracks;
        PosteriorRule rule(s_.belief, c_);
        const std::size_t S = s_.sensors.size();
        for (std::size_t i = 0; i < tracks.size(); ++i) {
            may_be_interrupted();
            const Posterior& belief = rule(tracks.evidence, i);
            tracks.log_odds[i] = belief.log_odds;
            const bool stationary = is_stationary(i);
            for (std::size_t k = 0; k < S; ++k)
                tracks.sees[i * S + k] = (1.0 - belief.unseen[k]) * (stationary ? 1.0 - belief.stationary_unseen[k] : 1.0);
            tracks.real[i] = expit(tracks.log_odds[i]);
        }
    }

    // Keep the mean number of a sensor's boxes a scan that are of nothing real.
    void count_false_boxes(const std::vector<Scan>& scans) {
        const Tracks& tracks = s_.tracks;
        for (const Scan& scan : scans) {
            double found = 0.0;
            for (const std::int64_t id : scan.assigned) {
                const auto place = std::lower_bound(tracks.track_id.begin(), tracks.track_id.end(), id);
                found += 1.0 - tracks.real[static_cast<std::size_t>(place - tracks.track_id.begin())];
            }
            double& mean = s_.sensors[scan.sensor].false_boxes;
            mean = c_.clutter_memory * mean + (1.0 - c_.clutter_memory) * found;
        }
    }

    void learn(double t) {
        if (t - s_.learnt_s < c_.learn_period_s) return;
        s_.learnt_s = t;
        std::vector<double> given(s_.sensors.size());
        for (std::size_t k = 0; k < given.size(); ++k) given[k] = s_.sensors[k].given_lasting;
        s_.accuracy.solve(s_.log_side_variance, s_.belief.p_detect, given, c_);
        learn_sensors(s_.ended, s_.tracks.evidence, s_.belief, c_);
    }

    void report(std::vector<std::uint8_t>& reported) {
        Tracks& tracks = s_.tracks;
        reported.resize(tracks.size());
        for (std::size_t i = 0; i < tracks.size(); ++i) {
            const bool here = s_.t - tracks.evidence.confirmed_s[i] < kSameTimeS;
            const double survival = s_.gaps.survival(here ? 0.0 : tracks.evidence.missed[i], c_);
            reported[i] = tracks.real[i] * survival > c_.report && (here || share_inside(i) > c_.inside_share);
        }
    }

    // A track's own P_D by a sensor.
    double own_p_detect(std::size_t row, std::size_t k) const {
        const std::size_t at = row * s_.sensors.size() + k;
        const double hits = s_.tracks.recent_hits[at], misses = s_.tracks.recent_misses[at];
        return clamp((s_.belief.p_detect[k] * c_.p_detect_strength + hits) / (c_.p_detect_strength + hits + misses),
                     c_.track_p_detect_bounds.low, c_.track_p_detect_bounds.high);
    }

    void write_growth(Record& record) {
        for (std::size_t i = 0; i < s_.tracks.size(); ++i) record.growth.push_back(mean_growth(s_.tracks.mean_of(i)));
    }
    void write_predictions(Record& record, std::size_t sensor) {
        Tracks& tracks = s_.tracks;
        smoothers::Entry* const entries = record.begin_scan(tracks.size(), sensor);
        for (std::size_t i = 0; i < tracks.size(); ++i) begin_entry(entries[i], i, static_cast<double>(ticks_) / filters::kTicksPerS);
    }
    void write_updates(Record& record, const Scan& scan) {
        Tracks& tracks = s_.tracks;
        const std::size_t before = record.tracks.back();
        smoothers::Entry* const entries = record.grow_scan(tracks.size());
        record.growth.resize(record.entries.size(), 0.0);
        for (std::size_t i = before; i < tracks.size(); ++i) begin_entry(entries[i], i, 0.0);
        for (std::size_t i = 0; i < tracks.size(); ++i) {
            std::copy_n(tracks.mean_of(i), kMean, entries[i].mean.begin());
            smoothers::halve(tracks.covariance_of(i), entries[i].covariance);
        }
        for (std::size_t j = 0; j < scan.later.size(); ++j) entries[taken_by_[j]].later = scan.later[j];
    }
    void begin_entry(smoothers::Entry& entry, std::size_t row, double dt) {
        entry.t = s_.t;
        entry.dt = dt;
        write_prediction(entry, row);
    }
    void write_prediction(smoothers::Entry& entry, std::size_t row) {
        std::copy_n(s_.tracks.mean_of(row), kMean, entry.predicted_mean.begin());
        smoothers::halve(s_.tracks.covariance_of(row), entry.predicted_covariance);
    }

    // Whether a track stands, as far as is known.
    bool is_stationary(std::size_t row) {
        const double* const m = s_.tracks.mean_of(row);
        const double area = exp_of(m[kLogSize] + m[kStates + kLogSize]);
        return square(m[kVelocity]) + square(m[kStates + kVelocity]) < square(c_.stationary_speed) * area;
    }

    double unseen_for(std::size_t row) const { return s_.t - s_.tracks.evidence.last_s[row]; }
    double share_inside(std::size_t row) {
        const Sides box = corners(s_.tracks.mean_of(row));
        return intersection(box, {0.0, 0.0, s_.width, s_.height}) / std::max(box.area(), kLeastArea);
    }

    State& s_;
    const ModelConstants& c_;
    std::int64_t ticks_ = -1;
    Discretised step_{};
    PresenceTransition presence_step_{};
    association::Assignment assignment_;
    std::vector<association::Pair> pairs_, with_appearance_;
    std::vector<std::size_t> made_, free_, taken_by_, pair_of_;
    std::vector<SidesExpected> expected_;
    std::vector<double> p_detect_, q_, of_clutter_;
    std::vector<std::uint8_t> confirms_;  // of the scan's boxes
    std::vector<std::array<double, 4>> innovations_;  // of the pairs that are made
    const ShareLogs logs_;
    std::optional<ByLeft> index_;  // of boxes_
    std::vector<Sides> boxes_, rivals_, free_boxes_, tracks_boxes_;
    std::vector<CameraTrack> camera_tracks_, moved_tracks_;
    std::vector<std::size_t> sure_rows_;
    std::vector<CameraChange> changes_;
    double step_s_ = 0.0;  // time of the last step (s)
    std::vector<Edges> edges_;  // of the scan's boxes
    std::vector<std::pair<std::int64_t, std::size_t>> owned_;  // owners of the scan's boxes, in order
};

}  // namespace jeat::tracking
