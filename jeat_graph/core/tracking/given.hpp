// What Python gives a step: arrays, which are checked, and made scans.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "arrays.hpp"
#include "tracking/scan.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

// The scans of one time, as `Model.take` of module.cpp describes them.
struct Given {
    double t;
    const In<std::int64_t>&sensors, &numbers;
    const In2<double>& boxes;
    const In<double>& logits;
    const std::optional<In2<double>>& similarity;
    const std::optional<In<double>>& motion;
    const std::optional<In2<double>>&owners, &box_std;
};

bool finite(std::span<const double> values);

// Throws std::invalid_argument, which is ValueError in Python, where it is nothing that a step can take in.
void check_given(const Given& given, const State& state);

// How the camera moved, if that is given. Throws as check_given does.
std::optional<PictureMotion> motion_of(const Given& given);

// Fills `scans`, which keep their memory from step to step. Throws as check_given does.
void fill_scans(const Given& given, const State& state, std::vector<Scan>& scans);

}  // namespace jeat::tracking
