// exp, log and what follows from them of four numbers at once: each gives the bits that math.hpp gives of it alone, by
// the same operations in the same order.
//
// They are faster where they are a part of what exists twice (wide.hpp).
#pragma once

#include <cstdint>
#include <limits>

#include "math.hpp"
#include "wide.hpp"

namespace jeat {

#if defined(__GNUC__) && !defined(__clang__)

// Between vectors of one size a cast keeps the bits.
typedef double Four __attribute__((vector_size(32)));

namespace detail {

typedef std::uint64_t FourBits __attribute__((vector_size(32)));

}  // namespace detail

JEAT_GRAPH_PART void take_exp(Four& x) {
    using detail::FourBits;
    constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52: see nearest_whole
    const Four shifted = x * kLog2E + kShift, k = shifted - kShift;
    const Four r = (x - k * kLn2High) - k * kLn2Low, r2 = r * r;
    Four even = kInverseFactorials[14] + Four{}, odd = kInverseFactorials[13] + Four{};
    for (int n = 12; n > 2; n -= 2) {
        even = kInverseFactorials[n] + r2 * even;
        odd = kInverseFactorials[n - 1] + r2 * odd;
    }
    const Four sum = 1.0 + (r + r2 * (0.5 + (r * odd + r2 * even)));
    // The last bits of what was shifted are those of k.
    const auto power = ((FourBits)shifted + 1023) << 52;
    const Four e = sum * (Four)power;
    const Four large = x != x ? x : std::numeric_limits<double>::infinity() + Four{};
    x = x < 709.0 ? (x < -708.0 ? Four{} : e) : large;
}

JEAT_GRAPH_PART void take_log(Four& x) {
    using detail::FourBits;
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const auto tiny = x < std::numeric_limits<double>::min();
    const auto bits = (FourBits)(tiny ? x * 18014398509481984.0 : x);  // 2^54
    // An exponent behind the digits of 2^52 is that number more.
    const Four exponent = (Four)((bits >> 52) | 0x4330000000000000) - 4503599627370496.0;
    Four k = (tiny ? Four{} - 54.0 : Four{}) + (exponent - 1023.0);
    Four m = (Four)((bits & 0x000fffffffffffff) | 0x3ff0000000000000);
    const auto upper = m > 1.41421356237309505;
    m = upper ? m * 0.5 : m;
    k = upper ? k + 1.0 : k;
    const Four s = (m - 1.0) / (m + 1.0), s2 = s * s, s4 = s2 * s2;
    Four first = kReciprocals[23] + Four{}, second = kReciprocals[25] + Four{};
    for (int n = 21; n > 5; n -= 4) {
        second = kReciprocals[n] + s4 * second;
        first = kReciprocals[n - 2] + s4 * first;
    }
    const Four sum = s2 * (kReciprocals[3] + (s2 * (kReciprocals[5] + s4 * second) + s4 * first));
    const Four log = k * kLn2High + (k * kLn2Low + 2.0 * (s + s * sum));
    const Four none = x == 0.0 ? Four{} - kInfinity : Four{} + std::numeric_limits<double>::quiet_NaN();
    x = x > 0.0 ? (x == kInfinity ? x : log) : none;
}

// ln(e^a + e^b), to a.
JEAT_GRAPH_PART void take_log_add(Four& a, const Four& b) {
    const auto greater = a > b;
    const Four high = greater ? a : b, low = greater ? b : a;
    Four x = low - high;
    take_exp(x);
    const Four u = 1.0 + x;
    Four log = u;
    take_log(log);
    const Four sum = high + (u == 1.0 ? x : log * (x / (u - 1.0)));
    a = low == -std::numeric_limits<double>::infinity() ? high : sum;
}

// ln Γ(x) for x > 0.
JEAT_GRAPH_PART void take_log_gamma(Four& x) {
    Four product = Four{} + 1.0;
    for (auto small = x < 10.0; small[0] | small[1] | small[2] | small[3]; small = x < 10.0) {
        product = small ? product * x : product;
        x = small ? x + 1.0 : x;
    }
    const Four y = 1.0 / (x * x);
    const Four series =
        (1.0 / 12 + y * (-1.0 / 360 + y * (1.0 / 1260 + y * (-1.0 / 1680 + y * (1.0 / 1188 - y * 691.0 / 360360))))) /
        x;
    Four log = x;
    take_log(log);
    take_log(product);
    x = (x - 0.5) * log - x + 0.91893853320467274 + series - product;
}

#else

struct Four {
    double of[4];
    double& operator[](int k) { return of[k]; }
    const double& operator[](int k) const { return of[k]; }
};

inline void take_exp(Four& x) {
    for (double& one : x.of) one = exp_of(one);
}
inline void take_log(Four& x) {
    for (double& one : x.of) one = log_of(one);
}
inline void take_log_add(Four& a, const Four& b) {
    for (int k = 0; k < 4; ++k) a[k] = log_add(a[k], b[k]);
}
inline void take_log_gamma(Four& x) {
    for (double& one : x.of) one = log_gamma(one);
}

#endif

}  // namespace jeat
