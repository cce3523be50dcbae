// Presence as a Markov chain: visible, hidden, gone; the formulas are in filters/visibility.py.
#pragma once

#include <array>

#include "constants.hpp"
#include "filters/model_constants.hpp"
#include "filters/singer.hpp"

namespace jeat::filters {

using PresenceTransition = std::array<double, kPresences * kPresences>;

inline PresenceTransition presence_transition(double dt, const ModelConstants& c) {
    const double hide = c.visible_to_hidden, leave = c.visible_to_gone;
    const double show = c.hidden_to_visible, vanish = c.hidden_to_gone;
    const PresenceTransition rates{-hide - leave, hide, leave, show, -show - vanish, vanish, 0.0, 0.0, 0.0};
    return exponential<kPresences>(rates, dt, std::max(hide + leave, show + vanish));
}

inline void predict_presence(double* presence, const PresenceTransition& T) {
    double out[kPresences] = {};
    for (int i = 0; i < kPresences; ++i)
        for (int j = 0; j < kPresences; ++j) out[j] += presence[i] * T[i * kPresences + j];
    std::copy(out, out + kPresences, presence);
}

inline void see_presence(double* presence) {
    presence[kVisible] = 1.0;
    presence[kHidden] = presence[kGone] = 0.0;
}

inline void miss_presence(double* presence, double p_detect) {
    presence[kVisible] *= 1.0 - p_detect;
    const double sum = presence[kVisible] + presence[kHidden] + presence[kGone];
    for (int k = 0; k < kPresences; ++k) presence[k] /= sum;
}

}  // namespace jeat::filters
