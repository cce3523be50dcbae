#include "tracking/life.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "interruption.hpp"

namespace jeat::tracking {

namespace {

// The greatest overlaps of boxes that begin tracks with rivals: tracks that are there, and better boxes among them.
class Rivals {
public:
    Rivals(const State& state, const CorrectedBoxes& scan, const std::vector<std::size_t>& free)
        : tracks_(living(state)), boxes_(chosen(scan, free)) {}

    double most(const Sides& box, double logit, const std::vector<double>& logits,
                const std::vector<std::size_t>& free) const {
        double overlap = 0.0;
        const auto take = [&](const Sides& rival) { overlap = std::max(overlap, intersection_over_union(box, rival)); };
        tracks_.near(box, [&](std::size_t, const Sides& rival) { take(rival); });
        boxes_.near(box, [&](std::size_t k, const Sides& rival) {
            if (logits[free[k]] > logit) take(rival);
        });
        return overlap;
    }

private:
    static std::vector<Sides> living(const State& state) {
        const ModelConstants& c = state.constants;
        std::vector<Sides> out;
        for (std::size_t i = 0; i < state.tracks.size(); ++i)
            if (state.tracks.real[i] > c.rival && unseen_for(state, i) < c.rival_age_s)
                out.push_back(corners(state.tracks.mean_of(i)));
        return out;
    }
    static std::vector<Sides> chosen(const CorrectedBoxes& scan, const std::vector<std::size_t>& places) {
        std::vector<Sides> out;
        out.reserve(places.size());
        for (const std::size_t j : places) out.push_back(scan.boxes[j]);
        return out;
    }

    ByLeft tracks_, boxes_;
};

// Count what lasts of how two sensors compare on a track; keep it where the last is old.
void compare_errors(State& state, std::size_t row, std::size_t k, std::size_t other, const Compared& compared) {
    Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    const std::size_t S = state.sensors.size(), at = (row * S + k) * S + other;
    const double age = tracks.has_apart[at] ? state.t - tracks.apart_s[at] : std::numeric_limits<double>::infinity();
    if (age < c.lasting_after_s) return;
    double* const before = tracks.apart.data() + at * kCompared;
    if (age <= c.lasting_within_s) state.accuracy.count(k, other, compared, before);
    std::copy(compared.begin(), compared.end(), before);
    tracks.apart_s[at] = state.t;
    tracks.has_apart[at] = 1;
}

// Share of a predicted box that lies within the picture.
double share_inside(const State& state, std::size_t row) {
    const Sides box = corners(state.tracks.mean_of(row));
    return intersection(box, {0.0, 0.0, state.width, state.height}) / std::max(box.area(), kLeastArea);
}

bool ends(const State& state, std::size_t row) {
    const Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    const double gap = unseen_for(state, row), real = tracks.real[row];
    return !tracks.awaited[row] && (gap > c.longest_gap_s || (real < c.report && gap > c.doubtful_gap_s) ||
                                    (real < c.false_posterior && gap > c.false_gap_s) ||
                                    1.0 - tracks.presence_of(row)[kGone] < c.least_presence ||
                                    (gap > c.outside_gap_s && share_inside(state, row) < c.outside_share));
}

// End the marked tracks: their evidence is kept.
void end(State& state, const std::vector<std::uint8_t>& ends, const std::vector<std::uint8_t>& kept) {
    Evidence& ended = state.ended;
    ended.append(state.tracks.evidence, ends);
    if (const auto most = static_cast<std::size_t>(state.constants.remembered_tracks); ended.size() > most) {
        std::vector<std::uint8_t> last(ended.size(), 1);
        std::fill(last.begin(), last.end() - static_cast<std::ptrdiff_t>(most), 0);
        keep_rows(ended, last);
    }
    keep_rows(state.tracks, kept);
}

}  // namespace

void begin_tracks(State& state, const Scan& given, const CorrectedBoxes& scan, const std::vector<std::size_t>& free,
                  const ScanClock& clock, AssociatedPairs& pairs) {
    if (free.empty()) return;
    Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    const std::size_t n = tracks.size(), k = given.sensor;
    const Rivals rivals(state, scan, free);
    append_rows(tracks, n, free.size());
    const double rho2 = state.noise(k), scene_rho2 = exp_of(state.log_scene_variance());
    const SpreadNoise spread = state.spread_noise(k);
    for (std::size_t f = 0; f < free.size(); ++f) {
        const std::size_t row = n + f, j = free[f];
        may_be_interrupted();
        const double overlap = rivals.most(scan.boxes[j], given.logits[j], given.logits, free);
        const Sides& box = scan.boxes[j];
        const BySide more =
            scan.spreads.empty() ? BySide{} : spread.more(scan.spreads[j], box, {box.width(), box.height()});
        initial_state(box, scan.edges[j], rho2, scene_rho2, more, c, tracks.mean_of(row), tracks.covariance_of(row));
        with_velocity(tracks.mean_of(row), state.camera_velocity);
        tracks.track_id[row] = state.next_id++;
        tracks.given[row] = given.owners.empty() ? -1 : given.owners[j];
        tracks.awaited[row] = !given.owners.empty() && given.awaited[j];
        tracks.used[row] = std::int64_t{1} << k;
        see_presence(tracks.presence_of(row));
        tracks.evidence.begin(row, clock.t, k, given.logits[j], overlap, clock.weight);
        pairs.track_of[j] = row;
    }
}

void compare_sensors(State& state, const Scan& given, const AssociatedPairs& pairs) {
    Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    const std::size_t S = state.sensors.size(), k = given.sensor;
    for (std::size_t other = 0; other < S; ++other) {
        if (other == k) continue;
        const auto expected = state.offsets.mean(k, other, c);
        for (std::size_t j = 0; j < given.boxes.size(); ++j) {
            const std::size_t i = pairs.track_of[j];
            const Sides& before = tracks.last_box[i * S + other];
            const double age = state.t - tracks.last_box_s[i * S + other];
            if (!(before.right > before.left) || age > c.offset_age_s || !(tracks.real[i] > c.report)) continue;
            const double* const m = tracks.mean_of(i);
            const auto d = difference(given.boxes[j], before, m[kVelocity] * age, m[kStates + kVelocity] * age);
            state.offsets.count(k, other, d, expected, c);
            const auto [x, y, width, height] = clipped(d, expected, c);
            compare_errors(state, i, k, other, {x, y, width, height, aspect_sum(given.boxes[j], before, c)});
        }
    }
    for (std::size_t j = 0; j < given.boxes.size(); ++j) {
        tracks.last_box[pairs.track_of[j] * S + k] = given.boxes[j];
        tracks.last_box_s[pairs.track_of[j] * S + k] = state.t;
    }
}

void compare_overlaps(State& state) {
    Tracks& tracks = state.tracks;
    Evidence& evidence = tracks.evidence;
    const auto compared = [&](std::size_t i) {
        return unseen_for(state, i) < kSameTimeS && evidence.overlap[i] != 0.0;
    };
    std::size_t first = 0;
    while (first < tracks.size() && !compared(first)) ++first;
    if (first == tracks.size()) return;
    std::vector<Sides> boxes(tracks.size());
    for (std::size_t i = 0; i < tracks.size(); ++i) boxes[i] = corners(tracks.mean_of(i));
    const ByLeft index(boxes);
    for (std::size_t i = first; i < tracks.size(); ++i) {
        if (!compared(i)) continue;
        may_be_interrupted();
        double most = 0.0;
        index.near(boxes[i], [&](std::size_t j, const Sides& box) {
            if (tracks.log_odds[j] > tracks.log_odds[i] && evidence.detections[j] >= evidence.detections[i])
                most = std::max(most, intersection_over_union(boxes[i], box));
        });
        evidence.overlap[i] = std::min(evidence.overlap[i], most);
    }
}

void judge(State& state) {
    Tracks& tracks = state.tracks;
    PosteriorRule rule(state.belief, state.constants);
    const std::size_t S = state.sensors.size();
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        may_be_interrupted();
        const Posterior& belief = rule(tracks.evidence, i);
        tracks.log_odds[i] = belief.log_odds;
        const bool stationary = is_stationary(tracks.mean_of(i), state.constants);
        for (std::size_t k = 0; k < S; ++k)
            tracks.sees[i * S + k] = (1.0 - belief.unseen[k]) * (stationary ? 1.0 - belief.stationary_unseen[k] : 1.0);
        tracks.real[i] = expit(tracks.log_odds[i]);
    }
}

void count_false_boxes(State& state, const Scan& given) {
    const Tracks& tracks = state.tracks;
    double found = 0.0;
    for (const std::int64_t id : given.assigned) {
        const auto place = std::lower_bound(tracks.track_id.begin(), tracks.track_id.end(), id);
        found += 1.0 - tracks.real[static_cast<std::size_t>(place - tracks.track_id.begin())];
    }
    const double keep = state.constants.clutter_memory;
    double& mean = state.sensors[given.sensor].false_boxes;
    mean = keep * mean + (1.0 - keep) * found;
}

void learn(State& state, double t) {
    if (t - state.learnt_s < state.constants.learn_period_s) return;
    state.learnt_s = t;
    std::vector<double> given(state.sensors.size());
    for (std::size_t k = 0; k < given.size(); ++k) given[k] = state.sensors[k].given_lasting;
    state.accuracy.solve(state.log_side_variance, state.belief.p_detect, given, state.constants);
    learn_sensors(state.ended, state.tracks.evidence, state.belief, state.constants);
}

// A gap begins with the last detection that confirmed the track, and counts what was to be expected since.
void report(const State& state, std::vector<std::uint8_t>& reported) {
    const Tracks& tracks = state.tracks;
    const ModelConstants& c = state.constants;
    reported.resize(tracks.size());
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        const bool here = state.t - tracks.evidence.confirmed_s[i] < kSameTimeS;
        const double survival = state.gaps.survival(here ? 0.0 : tracks.evidence.missed[i], c);
        reported[i] = tracks.real[i] * survival > c.report && (here || share_inside(state, i) > c.inside_share);
    }
}

void end_tracks(State& state, Record* record) {
    Tracks& tracks = state.tracks;
    std::vector<std::uint8_t> marked(tracks.size()), kept(tracks.size());
    bool any = false;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
        marked[i] = ends(state, i);
        kept[i] = !marked[i];
        if (!marked[i]) continue;
        any = true;
        if (tracks.real[i] > state.constants.report) state.gaps.count_loss();
    }
    if (record) record->kept = kept, record->gaps_after = state.gaps;
    if (any) end(state, marked, kept);
}

void reset(State& state, double t) {
    const std::size_t n = state.tracks.size();
    end(state, std::vector<std::uint8_t>(n, 1), std::vector<std::uint8_t>(n, 0));
    if (std::isinf(state.learnt_s)) return;  // nothing has come yet
    for (Sensor& sensor : state.sensors) {
        // It has had no scan since: not for less than the time between two of its scans.
        const double period = std::isnan(sensor.period_s) ? state.constants.first_period_s : sensor.period_s;
        sensor.last_scan_s = t - clamp(state.t - sensor.last_scan_s, period, kLongestAgoS);
    }
    state.learnt_s = t - clamp(state.t - state.learnt_s, 0.0, kLongestAgoS);
    state.t = t;
    state.started = false;
    state.camera_velocity = {};
    state.camera_path = {};
}

double own_p_detect(const State& state, std::size_t row, std::size_t sensor) {
    const ModelConstants& c = state.constants;
    const std::size_t at = row * state.sensors.size() + sensor;
    const double hits = state.tracks.recent_hits[at], misses = state.tracks.recent_misses[at];
    return clamp((state.belief.p_detect[sensor] * c.p_detect_strength + hits) / (c.p_detect_strength + hits + misses),
                 c.track_p_detect_bounds.low, c.track_p_detect_bounds.high);
}

}  // namespace jeat::tracking
