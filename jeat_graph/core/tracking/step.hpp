// One step of the tracker; the definition, stage by stage, is jeat_graph/tracking/reference.py.
//
// Every stage writes what is behind its name in state.hpp. They are in step.cpp, follow.cpp (the camera), associate.cpp,
// update.cpp, and life.cpp.
#pragma once

#include <cstdint>
#include <vector>

#include "tracking/associate.hpp"
#include "tracking/follow.hpp"
#include "tracking/records.hpp"
#include "tracking/scan.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

// The model over the time between two scans; kept while that stays the same.
class TimeStep {
public:
    void set(double dt, const ModelConstants& c);
    double seconds() const { return static_cast<double>(ticks_) / kTicksPerS; }
    const Discretised& motion() const { return motion_; }
    const PresenceTransition& presence() const { return presence_; }

private:
    std::int64_t ticks_ = -1;
    Discretised motion_{};
    PresenceTransition presence_{};
};

class Step {
public:
    explicit Step(State& state) : state_(state), logs_(state.constants) {}

    // Take in all scans of one time (s), at most one of each sensor; `motion`, if known, is that of the camera since its
    // picture before. `reported` is written: which tracks are, before any ends.
    void run(double t, std::vector<Scan>& scans, const PictureMotion* motion, std::vector<std::uint8_t>& reported,
             Record* record);

private:
    void take(double t, Scan& scan, const PictureMotion* motion, double step_s, Record* record);

    State& state_;
    const ShareLogs logs_;
    association::Assignment repeats_;
    TimeStep time_step_;
    CorrectedBoxes corrected_;
    CameraFollower follower_;
    Associator associator_;
    AssociatedPairs pairs_;
    std::vector<std::size_t> free_;  // boxes that no track took
};

}  // namespace jeat::tracking
