// Signals that come while a long call computes: Python's handlers run, and what they raise ends the call.
#pragma once

#include <chrono>

#include <nanobind/nanobind.h>

#include "interruption.hpp"

namespace jeat {

namespace nb = nanobind;

// While it exists, loops of this thread check for signals some times a second, with the GIL or without.
class HeedsSignals {
public:
    HeedsSignals() { checked() = std::chrono::steady_clock::now(), interruption = check; }
    HeedsSignals(const HeedsSignals&) = delete;
    HeedsSignals& operator=(const HeedsSignals&) = delete;
    ~HeedsSignals() { interruption = nullptr; }

private:
    static std::chrono::steady_clock::time_point& checked() {
        thread_local std::chrono::steady_clock::time_point last;
        return last;
    }
    static void check() {
        constexpr auto kBetween = std::chrono::milliseconds(100);
        const auto now = std::chrono::steady_clock::now();
        if (now - checked() < kBetween) return;
        checked() = now;
        const nb::gil_scoped_acquire acquire;
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
    }
};

}  // namespace jeat
