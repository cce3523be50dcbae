#include "tracking/columns.hpp"

#include <algorithm>
#include <array>
#include <type_traits>
#include <vector>

#include "vectors.hpp"

namespace jeat::tracking {

Table table(const Rows& rows) {
    return std::make_tuple(array_of(rows.t), array_of(rows.track_id), array_of(rows.mean, 2 * kMotion),
                           array_of(rows.variance, 2 * kMotion), array_of(rows.real), array_of(rows.used),
                           array_of(rows.label), array_of(rows.share));
}

Scans scans_of(const Record& record, const ModelConstants& c) {
    std::vector<double> transitions, predicted, predicted_covariance, mean, covariance;
    std::array<double, kCovariance> whole;
    double dt = 0.0;
    Matrix still = filters::discretise(dt, c).F;
    for (std::size_t k = 0; k < record.entries.size(); ++k) {
        const smoothers::Entry& entry = record.entries[k];
        if (entry.dt != dt) dt = entry.dt, still = filters::discretise(dt, c).F;
        const Matrix F = filters::in_perspective(still, record.growth[k], dt, c);
        transitions.insert(transitions.end(), F.begin(), F.end());
        predicted.insert(predicted.end(), entry.predicted_mean.begin(), entry.predicted_mean.end());
        smoothers::unfold(entry.predicted_covariance, whole.data());
        predicted_covariance.insert(predicted_covariance.end(), whole.begin(), whole.end());
        mean.insert(mean.end(), entry.mean.begin(), entry.mean.end());
        smoothers::unfold(entry.covariance, whole.data());
        covariance.insert(covariance.end(), whole.begin(), whole.end());
    }
    const std::vector<std::int64_t> sensors(record.sensors.begin(), record.sensors.end());
    const std::vector<std::int64_t> tracks(record.tracks.begin(), record.tracks.end());
    const std::vector<std::int64_t> known(record.known.begin(), record.known.end());
    return {array_of(sensors),
            array_of(tracks),
            array_of(known),
            array_of(transitions, kMatrix),
            array_of(predicted, kMean),
            array_of(predicted_covariance, kCovariance),
            array_of(mean, kMean),
            array_of(covariance, kCovariance)};
}

Fields fields_of(const Record& record) {
    std::vector<double> real, missed;
    std::vector<std::int64_t> used;
    std::vector<std::uint8_t> confirmed;
    // Of every scan that has it: tracks keep their places from scan to scan.
    std::vector<double> later(record.track_id.size(), -1.0);
    std::size_t at = 0;
    for (const std::size_t number : record.tracks)
        for (std::size_t i = 0; i < number; ++i) later[i] = std::max(later[i], record.entries[at++].later);
    for (std::size_t k = record.entries.size() - record.track_id.size(); k < record.entries.size(); ++k) {
        const smoothers::Entry& entry = record.entries[k];
        real.push_back(entry.real), used.push_back(entry.used);
        confirmed.push_back(entry.confirmed), missed.push_back(entry.missed);
    }
    return {record.t,         record.is_reset,       array_of(real), array_of(used), array_of(confirmed),
            array_of(missed), array_of(record.kept), array_of(later)};
}

Out2<double> gaps_of(const GapCounts& gaps) {
    std::vector<double> both(gaps.ended.begin(), gaps.ended.end());
    both.insert(both.end(), gaps.ended_well.begin(), gaps.ended_well.end());
    return array_of(both, filters::kGapBins);
}

Named learnt_of(const State& state) {
    Named out;
    out["p_detect"] = array_of(state.belief.p_detect);
    out["unseen"] = array_of(state.belief.unseen);
    out["stationary_unseen"] = array_of(state.belief.stationary_unseen);
    out["agreed_mean"] = array_of(state.belief.agreed_mean);
    out["agreed_std"] = array_of(state.belief.agreed_std);
    out["agreed_share"] = array_of(state.belief.agreed_share);
    out["score_weight"] = array_of(state.belief.score_weight);
    out["stationary_prior"] = array_of(state.belief.stationary_prior);
    out["decision_threshold"] = array_of(state.belief.decision_threshold);
    out["prior_odds"] = array_of(state.belief.prior_odds);
    const auto of_sensors = [&](double Sensor::* member) {
        std::vector<double> values;
        values.reserve(state.sensors.size());
        for (const Sensor& sensor : state.sensors) values.push_back(sensor.*member);
        return array_of(values);
    };
    out["leftovers"] = of_sensors(&Sensor::leftovers);
    out["false_boxes"] = of_sensors(&Sensor::false_boxes);
    out["boxes_at_edge"] = of_sensors(&Sensor::boxes_at_edge);
    out["boxes_beyond"] = of_sensors(&Sensor::boxes_beyond);
    out["noise_share"] = state.belief.noise_share;
    out["log_scene_variance"] = state.started ? state.log_scene_variance() : 0.0;
    std::vector<double> noise = state.noises();
    for (double& variance : noise) variance = log_of(variance);
    out["log_side_variance"] = array_of(noise);
    out["lasting"] = array_of(state.accuracy.lasting);
    std::vector<double> gains;
    gains.reserve(state.sensors.size());
    for (std::size_t k = 0; k < state.sensors.size(); ++k) gains.push_back(state.spread_noise(k).gain);
    out["log_own_variance"] = array_of(state.log_side_variance);
    out["spread_gain"] = array_of(gains);
    std::vector<double> offsets;
    for (std::size_t k = 0; k < state.sensors.size(); ++k) {
        const auto offset = state.offsets.offset(k, state.noises(), state.constants);
        offsets.insert(offsets.end(), offset.begin(), offset.end());
    }
    out["offsets"] = array_of(offsets, 4);
    const ProcessNoise& q = state.process_noise;
    out["process_noise"] = nb::make_tuple(q.jerk, q.growth, q.position, q.size);
    return out;
}

Named tracks_of(Tracks& tracks) {
    Named out;
    tracks.columns([&](const char* name, const auto& column, std::size_t width) {
        using Column = std::remove_cvref_t<decltype(column)>;
        if constexpr (!std::is_same_v<Column, std::vector<Sides>>) out[name] = array_of(column, width);
    });
    return out;
}

}  // namespace jeat::tracking
