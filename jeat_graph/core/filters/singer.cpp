#include "filters/singer.hpp"

#include "wide_math.hpp"

namespace jeat::filters {

namespace {

// A number of each axis: what is computed of both is computed side by side.
struct Both {
    double x, y;
};
inline Both operator+(Both a, Both b) { return {a.x + b.x, a.y + b.y}; }
inline Both operator*(double f, Both a) { return {f * a.x, f * a.y}; }

// Call body(i) for i from `First` to `Last`, which are known when it is compiled: no loop is left.
template <int First, int Last, class Body> inline void each(Body body) {
    [&]<int... I>(std::integer_sequence<int, I...>) {
        (body(std::integral_constant<int, First + I>{}), ...);
    }(std::make_integer_sequence<int, Last - First + 1>{});
}

// P <- F P F' + Q of both axes, of whose upper triangles alone.
JEAT_GRAPH_PART void predict_covariances(double* P, const Matrix& F, const Matrix& Q) {
    constexpr int kLast = kStates - 1;
    Both FP[kStates][kStates];
    each<0, kLast>([&](auto i) {
        each<i, kLast>([&](auto j) {
            Both sum{0.0, 0.0};
            each<kDriven[i][0], kDriven[i][1]>([&](auto k) {
                sum = sum + F[i * kStates + k] * Both{P[k * kStates + j], P[kMatrix + k * kStates + j]};
            });
            FP[i][j] = sum;
        });
    });
    each<0, kLast>([&](auto i) {
        each<i, kLast>([&](auto j) {
            Both sum{0.0, 0.0};
            each<kDriven[j][0], kDriven[j][1]>([&](auto k) { sum = sum + F[j * kStates + k] * FP[i][k]; });
            const double q = Q[i * kStates + j];
            const Both out = sum + Both{q, q};
            P[i * kStates + j] = P[j * kStates + i] = out.x;
            P[kMatrix + i * kStates + j] = P[kMatrix + j * kStates + i] = out.y;
        });
    });
}

}  // namespace

JEAT_GRAPH_WIDE JEAT_GRAPH_WHOLE void predict(double* mean, double* covariance, const Discretised& step, double dt,
                                              const Densities& q, const ModelConstants& c) {
    const double growth_of_step = step_growth(mean_growth(mean), dt, c), width = mean[kLogSize],
                 height = mean[kStates + kLogSize];
    Four e{2.0 * growth_of_step, 0.5 * (width + height), width, height};
    take_exp(e);
    const Matrix F = in_perspective(step.F, growth_of_step, e[0]);
    const double size = e[1];
    std::array<double, kMean> predicted{};
    for (int axis = 0; axis < 2; ++axis)
        for (int i = 0; i < kStates; ++i)
            for (int j = kDriven[i][0]; j <= kDriven[i][1]; ++j)
                predicted[axis * kStates + i] += F[i * kStates + j] * mean[axis * kStates + j];
    const double growth = 0.5 * (std::abs(predicted[kGrowth]) + std::abs(predicted[kStates + kGrowth]));
    const double g = std::min(growth, c.fastest_growth);
    const double jerk = q.root_jerk + c.perspective_jerk * g * g * std::sqrt(g);
    const double by_jerk = square(jerk * size), by_walk = q.position * square(size);
    Matrix Q;
    for (int k = 0; k < kMatrix; ++k)
        Q[k] = by_jerk * step.jerk[k] + q.growth * step.growth[k] + q.size * step.size[k] + by_walk * step.position[k];
    predict_covariances(covariance, F, Q);
    for (int axis = 0; axis < 2; ++axis) {
        double* const P = covariance + axis * kMatrix;
        const LastingError error(e[2 + axis], size, q.rho2, c);
        const double forgotten = 1.0 - square(F[kPositionError * kStates + kPositionError]);
        P[kPositionError * kStates + kPositionError] += forgotten * error.position;
        P[kSizeError * kStates + kSizeError] += forgotten * error.size;
    }
    std::copy(predicted.begin(), predicted.end(), mean);
}

}  // namespace jeat::filters
