// What is counted of a track by every sensor; the formulas are in filters/evidence.py.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "filters/columns.hpp"
#include "filters/model_constants.hpp"
#include "math.hpp"

namespace jeat::filters {

struct ScanClock {
    double t, period_s, weight;
    double keep_recent, keep_total;  // share of the sums of logits that a scan keeps
    double full;                     // how much of a look it is, in expected hits

    ScanClock(double t, double period_s, const ModelConstants& c)
        : t(t), period_s(period_s), weight(std::min(1.0, period_s / c.correlation_time_s)),
          keep_recent(exp_of(-period_s / c.smoothing_s)), keep_total(exp_of(-period_s / c.mean_memory_s)),
          full(std::min(1.0, period_s / c.full_scan_s)) {}
};

struct Evidence {
    std::size_t sensors = 0;
    std::vector<double> hits, misses, stationary_hits, stationary_misses, recent, recent_weight, peak, total,
        total_weight;
    std::vector<std::uint8_t> found;
    std::vector<double> overlap, gained, detections;
    std::vector<std::int64_t> owner;
    std::vector<double> born_s, last_s, confirmed_s, missed;

    std::size_t size() const { return owner.size(); }

    template <class Visit> void columns(Visit visit) {
        visit("hits", hits, sensors);
        visit("misses", misses, sensors);
        visit("stationary_hits", stationary_hits, sensors);
        visit("stationary_misses", stationary_misses, sensors);
        visit("recent", recent, sensors);
        visit("recent_weight", recent_weight, sensors);
        visit("peak", peak, sensors);
        visit("total", total, sensors);
        visit("total_weight", total_weight, sensors);
        visit("found", found, sensors);
        visit("overlap", overlap, 1);
        visit("gained", gained, 1);
        visit("detections", detections, 1);
        visit("owner", owner, 1);
        visit("born_s", born_s, 1);
        visit("last_s", last_s, 1);
        visit("confirmed_s", confirmed_s, 1);
        visit("missed", missed, 1);
    }

    void widen() {
        const std::size_t rows = size();
        for (auto* column : {&hits, &misses, &stationary_hits, &stationary_misses, &recent, &recent_weight, &peak,
                             &total, &total_weight})
            widen_rows(*column, rows, sensors, 1);
        widen_rows(found, rows, sensors, 1);
        ++sensors;
    }

    // The evidence of a track that begins at a detection: its score, and no hit beyond. The row is there, of zeros.
    void begin(std::size_t row, double t, std::size_t sensor, double logit, double iou, double weight) {
        const std::size_t at = row * sensors + sensor;
        found[at] = 1;
        recent[at] = total[at] = logit * weight;
        recent_weight[at] = total_weight[at] = weight;
        peak[at] = logit;
        overlap[row] = iou;
        detections[row] = 1.0;
        owner[row] = static_cast<std::int64_t>(sensor);
        born_s[row] = last_s[row] = confirmed_s[row] = t;
    }

    void count_hit(std::size_t row, std::size_t sensor, double logit, double gain, bool stationary, bool confirms,
                   const ScanClock& clock, const ModelConstants& c) {
        const std::size_t at = row * sensors + sensor;
        const bool first = hits[at] <= 0.0 && owner[row] != static_cast<std::int64_t>(sensor);
        hits[at] += clock.weight;
        if (stationary) stationary_hits[at] += clock.weight;
        found[at] = 1;
        recent[at] = recent[at] * clock.keep_recent + logit * clock.weight;
        recent_weight[at] = recent_weight[at] * clock.keep_recent + clock.weight;
        total[at] = total[at] * clock.keep_total + logit * clock.weight;
        total_weight[at] = total_weight[at] * clock.keep_total + clock.weight;
        const double now = recent_weight[at] > 0.0 ? recent[at] / recent_weight[at] : logit;
        const double fallen = peak[at] - clock.period_s / c.peak_decay_s * std::max(peak[at] - now, 0.0);
        peak[at] = first ? now : std::max(fallen, now);
        gained[row] += std::min(gain, c.most_gain);
        detections[row] += 1.0;
        last_s[row] = clock.t;
        if (confirms) confirmed_s[row] = clock.t, missed[row] = 0.0;
    }

    // If a look finds nothing, the detections that were to be expected add up.
    void expect_hit(std::size_t row, double p_detect, double sees, const ScanClock& clock) {
        missed[row] += p_detect * sees * clock.full;
    }

    void count_miss(std::size_t row, std::size_t sensor, double visible, bool stationary, double weight) {
        misses[row * sensors + sensor] += weight * visible;
        if (stationary) stationary_misses[row * sensors + sensor] += weight * visible;
    }

    // Add some rows of another table with as many sensors.
    void append(const Evidence& other, const std::vector<std::uint8_t>& chosen) {
        Evidence& from = const_cast<Evidence&>(other);
        std::vector<std::size_t> rows;
        for (std::size_t r = 0; r < chosen.size(); ++r)
            if (chosen[r]) rows.push_back(r);
        std::vector<void*> sources;
        from.columns([&](const char*, auto& column, std::size_t) { sources.push_back(&column); });
        std::size_t k = 0;
        columns([&](const char*, auto& column, std::size_t width) {
            const auto& source = *static_cast<std::remove_reference_t<decltype(column)>*>(sources[k++]);
            for (const std::size_t r : rows)
                column.insert(column.end(), source.begin() + r * width, source.begin() + (r + 1) * width);
        });
    }
};

}  // namespace jeat::filters
