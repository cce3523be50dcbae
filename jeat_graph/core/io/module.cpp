// Binds the kernels of jeat_graph.io.
#include "arrays.hpp"
#include "io/rounding.hpp"

namespace jeat::io {

void bind(nb::module_& module) {
    module.def(
        "round_significant",
        [](Out<double> values, int digits) {
            check(digits >= 1 && digits <= MOST_POWER, "at least one digit is kept");
            const auto given = span(values);
            const nb::gil_scoped_release release;
            round_significant(given, digits);
        },
        nb::arg("values").noconvert(), nb::arg("digits"),
        "Round (N,) in place to significant decimal digits; zero, NaN and infinity stay.");
}

}  // namespace jeat::io
