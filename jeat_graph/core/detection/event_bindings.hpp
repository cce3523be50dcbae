// Binds the kernels of jeat_graph.detection that work on events: their windows, noise and background.
#pragma once

#include "arrays.hpp"

namespace jeat::detection {

using Whole = In<std::int32_t>;
using Release = nb::gil_scoped_release;

void bind_background(nb::module_& module);
void bind_noise(nb::module_& module);
void bind_windows(nb::module_& module);

}  // namespace jeat::detection
