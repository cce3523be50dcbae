// A tracker of the model: its state, its step, and what it keeps for the smoother. What Python calls.
#pragma once

#include <cstdint>
#include <optional>
#include <tuple>
#include <vector>

#include "arrays.hpp"
#include "exclusive.hpp"
#include "smoothers/histories.hpp"
#include "tracking/answer.hpp"
#include "tracking/columns.hpp"
#include "tracking/given.hpp"
#include "tracking/step.hpp"
#include "vectors.hpp"

namespace jeat::tracking {

// module.cpp says what the methods do; one thread at a time is in one of them.
class Model {
public:
    Model(const nb::object& constants, double width, double height, bool known, double lag_s);
    Model(const Model& other);
    Model& operator=(const Model&) = delete;

    Exclusive use;

    void declare_sensor(double even_logit, double score_weight, double lasting, std::optional<double> stationary_prior);
    void take(double t, In<std::int64_t> sensors, In<std::int64_t> numbers, In2<double> boxes, In<double> logits,
              const std::optional<In2<double>>& similarity, const std::optional<In<double>>& motion,
              const std::optional<In2<double>>& owners, const std::optional<In2<double>>& box_std);
    void reset(double t);

    // Keep what the last step gave the smoother, for hand_over.
    Record record() { return std::move(record_); }
    // Tell the smoother of a step that nothing can come before any more; of the last one without a record.
    void hand_over(const Record* record, std::optional<In<std::int64_t>> given, std::optional<In<std::int64_t>> label,
                   std::optional<In<double>> share);
    void forget(In<std::int64_t> track_id, In<double> until);
    Table smoothed();
    Table drain();
    // Where a signal ends it, it can be called once more.
    Table finish();

    Moment snapshot() const { return now_; }
    void restore(const Moment& moment) { now_ = moment; }
    // The state by name, or that at a moment; with what the smoother holds.
    Named state(const Moment* moment);
    void set_state(const Named& state);
    void number_on_from(std::int64_t identity);

    Table rows() const { return table(now_.answer.rows); }
    // A copy, for whoever may want the columns later.
    Rows reported() const { return now_.answer.rows; }
    std::tuple<Out2<double>, Out2<double>> states() const;
    std::tuple<Out<double>, Out<double>, Out<double>> fit() const;
    Out<std::int64_t> assigned() const { return array_of(now_.answer.assigned); }
    Out<std::int64_t> living() const { return array_of(now_.answer.living); }
    Out<std::int64_t> identities() const { return array_of(now_.state.tracks.track_id); }
    std::size_t size() const { return now_.state.tracks.size(); }
    std::int64_t born() const { return now_.state.next_id - 1; }
    std::size_t sensors() const { return now_.state.sensors.size(); }
    std::optional<double> time() const { return now_.state.started ? std::optional(now_.state.t) : std::nullopt; }
    std::tuple<double, double> picture() const { return {now_.state.width, now_.state.height}; }
    Out<double> camera_moved() const;
    Out<double> last_scans() const;
    Out2<double> gaps() const { return gaps_of(now_.state.gaps); }
    const ModelConstants& constants() const { return now_.state.constants; }
    bool boxes_end_at_edge() const { return now_.state.boxes_end_at_edge(); }
    Named learnt() const { return learnt_of(now_.state); }
    Named tracks() { return tracks_of(now_.state.tracks); }

private:
    void run(double t, const PictureMotion* moved);
    void write_answer(double t);

    Moment now_;
    Step step_;
    bool smooths_;
    smoothers::Histories histories_;
    Record record_;
    std::vector<smoothers::Called> called_;
    std::vector<Scan> scans_;
    std::vector<std::uint8_t> reported_;
};

}  // namespace jeat::tracking
