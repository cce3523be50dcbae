#include "wide_math.hpp"

namespace jeat {

JEAT_GRAPH_WIDE double log_beta(double a, double b) {
    Four x{a, b, a + b, 10.0};
    take_log_gamma(x);
    return x[0] + x[1] - x[2];
}

JEAT_GRAPH_WIDE std::array<double, 4> logs_of(double a, double b, double c, double d) {
    Four x{a, b, c, d};
    take_log(x);
    return {x[0], x[1], x[2], x[3]};
}

}  // namespace jeat
