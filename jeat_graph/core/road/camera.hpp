// A camera over a flat road, as jeat_graph/road/camera.py has it.
#pragma once

#include <array>

namespace jeat::road {

struct Camera {
    // Road to camera; place (m); fx, fy; cx, cy; width, height (px); radial distortion.
    std::array<std::array<double, 3>, 3> rotation;
    std::array<double, 3> position;
    std::array<double, 2> focal, centre, picture;
    double k1, k2;

    // What lies `r2` squared from the axis, in units of the focal length, is moved outwards by this factor.
    double distortion(double r2) const { return 1.0 + k1 * r2 + k2 * r2 * r2; }
    double distortion_slope(double r2) const { return 2.0 * k1 + 4.0 * k2 * r2; }
};

// Direction of a vehicle's long axis: sine and cosine of its heading, which is taken from y towards x.
struct Direction {
    double x, y;
};

}  // namespace jeat::road
