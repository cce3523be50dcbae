// exp, log, arctan and what follows from them, the same on every machine: the C library's differ in their last bit.
//
// Errors of exp and log are below two units in the last place, of arctan below four; tests compare with NumPy's.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace jeat {

inline constexpr double kLog2E = 1.4426950408889634, kPi = 3.141592653589793;
// ln 2 in two parts, the first with zeros at its end: its product with a whole number is exact.
inline constexpr double kLn2High = 6.93147180369123816490e-01, kLn2Low = 1.90821492927058770002e-10;

// What a bound that only saves work leaves for rounding, as a share.
inline constexpr double kRounding = 1e-6;

// 1/n, and 1/n!, for the series below.
inline constexpr auto kReciprocals = [] {
    std::array<double, 26> out{};
    for (int n = 1; n < 26; ++n) out[static_cast<std::size_t>(n)] = 1.0 / n;
    return out;
}();
inline constexpr auto kInverseFactorials = [] {
    std::array<double, 15> out{};
    double factorial = 1.0;
    for (int n = 0; n < 15; ++n) {
        out[static_cast<std::size_t>(n)] = 1.0 / factorial;
        factorial *= n + 1;
    }
    return out;
}();

// The nearest whole number, of a half the even one, where |x| < 2^51: what is added leaves no digits behind the point.
inline double nearest_whole(double x) {
    constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52
    return (x + kShift) - kShift;
}

// e^x = 2^k e^r, |r| <= ln 2 / 2, by Taylor's series; its even and its odd terms are summed side by side.
inline double exp_of(double x) {
    if (!(x < 709.0)) return x != x ? x : std::numeric_limits<double>::infinity();
    if (x < -708.0) return 0.0;
    const double k = nearest_whole(x * kLog2E);
    const double r = (x - k * kLn2High) - k * kLn2Low, r2 = r * r;
    double even = kInverseFactorials[14], odd = kInverseFactorials[13];
    for (int n = 12; n > 2; n -= 2) {
        even = kInverseFactorials[n] + r2 * even;
        odd = kInverseFactorials[n - 1] + r2 * odd;
    }
    const double sum = 1.0 + (r + r2 * (0.5 + (r * odd + r2 * even)));
    const auto power = static_cast<std::uint64_t>(static_cast<std::int64_t>(k) + 1023) << 52;
    return sum * std::bit_cast<double>(power);
}

// ln x = k ln 2 + ln m, sqrt(1/2) <= m < sqrt(2), by the series of artanh.
inline double log_of(double x) {
    if (!(x > 0.0))
        return x == 0.0 ? -std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
    if (x == std::numeric_limits<double>::infinity()) return x;
    double k = 0.0;
    if (x < std::numeric_limits<double>::min()) x *= 18014398509481984.0, k = -54.0;  // 2^54
    const auto bits = std::bit_cast<std::uint64_t>(x);
    k += static_cast<double>(static_cast<std::int64_t>(bits >> 52) - 1023);
    double m = std::bit_cast<double>((bits & 0x000fffffffffffff) | 0x3ff0000000000000);
    if (m > 1.41421356237309505) {
        m *= 0.5;
        k += 1.0;
    }
    const double s = (m - 1.0) / (m + 1.0), s2 = s * s, s4 = s2 * s2;
    // Every second term of the series, side by side.
    double first = kReciprocals[23], second = kReciprocals[25];
    for (int n = 21; n > 5; n -= 4) {
        second = kReciprocals[n] + s4 * second;
        first = kReciprocals[n - 2] + s4 * first;
    }
    const double sum = s2 * (kReciprocals[3] + (s2 * (kReciprocals[5] + s4 * second) + s4 * first));
    return k * kLn2High + (k * kLn2Low + 2.0 * (s + s * sum));
}

// ln(1 + x), by Kahan's correction of what 1 + x loses.
inline double log1p_of(double x) {
    const double u = 1.0 + x;
    if (u == 1.0) return x;
    return log_of(u) * (x / (u - 1.0));
}

// ln(e^a + e^b).
inline double log_add(double a, double b) {
    const double high = a > b ? a : b, low = a > b ? b : a;
    if (low == -std::numeric_limits<double>::infinity()) return high;
    return high + log1p_of(exp_of(low - high));
}

// 1 / (1 + e^-x).
inline double expit(double x) {
    if (x >= 0.0) return 1.0 / (1.0 + exp_of(-x));
    const double e = exp_of(x);
    return e / (1.0 + e);
}

// arctan x for |x| <= 1, by its series at a quarter of the angle: tan(a/2) = tan a / (1 + sqrt(1 + tan² a)).
inline double atan_of(double x) {
    for (int halved = 0; halved < 2; ++halved) x /= 1.0 + std::sqrt(1.0 + x * x);
    const double x2 = x * x;
    double sum = 0.0;
    for (int n = 25; n > 1; n -= 2) sum = x2 * (kReciprocals[n] - sum);
    return 4.0 * (x - x * sum);
}

// The angle of the finite point (x, y), in [-π, π].
inline double atan2_of(double y, double x) {
    const double across = std::abs(x), up = std::abs(y);
    double angle = 0.0;
    if (up > across) {
        angle = kPi / 2.0 - atan_of(across / up);
    } else if (across > 0.0) {
        angle = atan_of(up / across);
    }
    if (std::signbit(x)) angle = kPi - angle;
    return std::copysign(angle, y);
}

// ln Γ(x) for x > 0: Stirling's series, after moving x to 10 or more.
inline double log_gamma(double x) {
    double product = 1.0;
    while (x < 10.0) product *= x, x += 1.0;
    const double y = 1.0 / (x * x);
    const double series =
        (1.0 / 12 + y * (-1.0 / 360 + y * (1.0 / 1260 + y * (-1.0 / 1680 + y * (1.0 / 1188 - y * 691.0 / 360360))))) /
        x;
    return (x - 0.5) * log_of(x) - x + 0.91893853320467274 + series - log_of(product);
}

// ln B(a, b) = ln Γ(a) + ln Γ(b) - ln Γ(a + b), and four logarithms: computed side by side.
double log_beta(double a, double b);
std::array<double, 4> logs_of(double a, double b, double c, double d);

inline double square(double x) { return x * x; }
inline double clamp(double x, double low, double high) { return x < low ? low : (x > high ? high : x); }

}  // namespace jeat
