// What single values of a state that is read back must be; state_check.hpp says which. All throw std::invalid_argument.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "tracking/saving.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

// ln of a variance, or of a density, that no scene has comes from no learning.
inline constexpr double kMostLogVariance = 100.0;
// Mean squares of spreads beyond these are of no bounds that anybody chooses.
inline constexpr double kLeastSpread = 1e-12, kMostSpread = 1e12;
// Sums of so many scans come from no recording.
inline constexpr double kMostCount = 1e15;
// Of shares and sums that are computed, by which they may miss what they are exactly.
inline constexpr double kShareRounding = 1e-9;
inline constexpr std::int64_t kMostIdentities = std::int64_t{1} << 62;

inline void require(bool holds, const std::string& name, const char* what) { StateReader::require(holds, name, what); }

// Whether a covariance can be one: of the correlations, with a rounding's worth on the diagonal, a Cholesky factor exists.
inline bool is_covariance(const double* P) {
    constexpr double kRounding = 1e-6;
    std::array<double, kStates> std{};
    for (int i = 0; i < kStates; ++i) {
        if (!(P[i * kStates + i] > 0.0)) return false;
        std[i] = std::sqrt(P[i * kStates + i]);
    }
    Matrix L{};
    for (int i = 0; i < kStates; ++i)
        for (int j = 0; j <= i; ++j) {
            const double a = P[i * kStates + j] / std[i] / std[j], b = P[j * kStates + i] / std[i] / std[j];
            if (!(std::abs(a) <= 1.0 + kRounding) || !(std::abs(a - b) <= kRounding)) return false;
            double rest = a;
            for (int k = 0; k < j; ++k) rest -= L[i * kStates + k] * L[j * kStates + k];
            if (i == j) {
                rest += kRounding;
                if (!(rest > 0.0)) return false;
                L[i * kStates + i] = std::sqrt(rest);
            } else {
                L[i * kStates + j] = rest / L[j * kStates + j];
            }
        }
    return true;
}

inline void check_motion(const std::string& name, const std::vector<double>& mean,
                         const std::vector<double>& covariance) {
    for (std::size_t k = 0; k < mean.size(); ++k) {
        const std::size_t place = k % kStates;
        if (place == kLogSize || place == kGrowth || place == kSizeError)
            require(std::abs(mean[k]) <= kMostLogSize, name, "holds what is no size");
    }
    for (std::size_t k = 0; k < covariance.size(); k += kMatrix)
        require(is_covariance(&covariance[k]), name, "holds what is no covariance");
}

inline void check_identities(const std::string& name, const std::vector<std::int64_t>& ids, std::int64_t next_id) {
    std::int64_t before = 0;
    for (const std::int64_t id : ids) {
        require(id > before && id < next_id, name, "are not those that were given out");
        before = id;
    }
}

template <class Values> void check_between(const std::string& name, const Values& values, double low, double high) {
    for (const double value : values) require(value >= low && value <= high, name, "holds what is out of its range");
}
inline void check_between(const std::string& name, double value, double low, double high) {
    check_between(name, std::array{value}, low, high);
}
template <class Values> void check_counts(const std::string& name, const Values& values) {
    check_between(name, values, 0.0, kMostCount);
}
inline void check_flags(const std::string& name, const std::vector<std::uint8_t>& flags) {
    for (const std::uint8_t flag : flags) require(flag <= 1, name, "is neither true nor false");
}
// Of probabilities whose logarithm is taken, and that of what they leave.
template <class Values> void check_unsure(const std::string& name, const Values& values) {
    for (const double p : values) require(p > 0.0 && p < 1.0, name, "holds what is no probability");
}
inline void check_sensors(const std::string& name, const std::vector<std::int64_t>& used, std::size_t sensors) {
    for (const std::int64_t bits : used)
        require(bits >= 0 && (bits >> sensors) == 0, name, "are sensors that are not there");
}
// A time that has been, or none.
inline void check_past(const std::string& name, double time, double now) {
    require(!(time > now) && time < std::numeric_limits<double>::infinity(), name, "is no time that has been");
}

}  // namespace jeat::tracking
