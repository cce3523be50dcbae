// The tracks follow the camera, by its pictures and by what the boxes of all tracks have in common.
#pragma once

#include <vector>

#include "tracking/scan.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

class CameraFollower {
public:
    // Compensate the tracks for the camera's motion as its newest picture shows it, with the first scan of a time. A
    // motion that the scan's boxes speak against is none. `step_s` is the time of the step before (s).
    void follow_picture(State& state, std::size_t sensor, const CorrectedBoxes& scan, const PictureMotion* motion,
                        double step_s);

    // Estimate what shift and scale all tracks have in common over `dt` (s), and take them along.
    void follow_camera(State& state, std::size_t sensor, const CorrectedBoxes& scan, double dt);

private:
    void find_surely_there(const State& state, std::size_t sensor);

    std::vector<CameraChange> changes_;
    std::vector<CameraTrack> tracks_, moved_;  // that are surely there
    std::vector<std::size_t> rows_;            // of these
};

}  // namespace jeat::tracking
