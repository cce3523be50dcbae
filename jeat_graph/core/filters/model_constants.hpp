// The constants that `Tracker(constants=…)` may change: what they are, their units and sources say filters/model_constants.py.
#pragma once

#include <stdexcept>
#include <string>

#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>

#include "constants.hpp"

namespace jeat::filters {

struct Bounds {
    double low, high;
};

struct ModelConstants {
#define JEAT_ONE(name) double name;
#define JEAT_PAIR(name) Bounds name;
    JEAT_MODEL_CONSTANTS
#undef JEAT_ONE
#undef JEAT_PAIR
};

// Take the constants from a Python object by their names.
inline ModelConstants constants_of(const nanobind::handle& source) {
    ModelConstants c;
#define JEAT_ONE(name) c.name = nanobind::cast<double>(source.attr(#name));
#define JEAT_PAIR(name)                                                                  \
    {                                                                                    \
        const auto pair = nanobind::cast<std::pair<double, double>>(source.attr(#name)); \
        c.name = {pair.first, pair.second};                                              \
    }
    JEAT_MODEL_CONSTANTS
#undef JEAT_ONE
#undef JEAT_PAIR
    return c;
}

}  // namespace jeat::filters
