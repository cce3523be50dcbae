// Functions of four numbers give the bits of those of one: on what is ordinary, at the bounds, and on what is no number.
#include "wide_math.hpp"

#include <cstdio>
#include <cstring>
#include <random>
#include <vector>

namespace {

using jeat::Four;

JEAT_GRAPH_WIDE void exps(Four& x) { jeat::take_exp(x); }
JEAT_GRAPH_WIDE void logs(Four& x) { jeat::take_log(x); }
JEAT_GRAPH_WIDE void log_gammas(Four& x) { jeat::take_log_gamma(x); }
JEAT_GRAPH_WIDE void log_adds(Four& a, const Four& b) { jeat::take_log_add(a, b); }

int differences = 0;

void compare(const char* what, double x, double wide, double alone) {
    if (std::memcmp(&wide, &alone, sizeof wide) == 0 || (wide != wide && alone != alone)) return;
    if (++differences < 20) std::printf("%s(%a): %a, alone %a\n", what, x, wide, alone);
}

void compare(const std::vector<double>& values) {
    for (std::size_t k = 0; k + 4 <= values.size(); ++k) {
        const double* const x = &values[k];
        Four e{x[0], x[1], x[2], x[3]}, l = e, a = e;
        const Four b{x[3], x[0], x[1], x[2]};
        Four g{};
        for (int i = 0; i < 4; ++i) g[i] = x[i] > 1e-3 && x[i] < 1e6 ? x[i] : 1.0;
        const Four of = g;
        exps(e), logs(l), log_adds(a, b), log_gammas(g);
        for (int i = 0; i < 4; ++i) {
            compare("exp", x[i], e[i], jeat::exp_of(x[i]));
            compare("log", x[i], l[i], jeat::log_of(x[i]));
            compare("log_add", x[i], a[i], jeat::log_add(x[i], b[i]));
            compare("log_gamma", of[i], g[i], jeat::log_gamma(of[i]));
        }
    }
}

}  // namespace

int main() {
    const double infinity = std::numeric_limits<double>::infinity();
    std::vector<double> values{0.0,
                               -0.0,
                               1.0,
                               -1.0,
                               708.0,
                               709.0,
                               -708.0,
                               -709.0,
                               1e300,
                               -1e300,
                               5e-324,
                               1e-310,
                               infinity,
                               -infinity,
                               std::numeric_limits<double>::quiet_NaN(),
                               1.41421356237309505,
                               10.0,
                               9.999999};
    for (const double x : std::vector(values))
        for (const double way : {-infinity, infinity}) values.push_back(std::nextafter(x, way));
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    for (int n = 0; n < 200000; ++n) {
        values.push_back(normal(random));
        values.push_back(std::ldexp(normal(random), static_cast<int>(random() % 2100) - 1070));
        values.push_back(300.0 * normal(random));
        values.push_back(std::abs(20.0 * normal(random)));
    }
    compare(values);
    std::printf("%d differences of %zu numbers\n", differences, values.size());
    return differences > 0;
}
