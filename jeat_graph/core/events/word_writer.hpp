// What the encoders of jeat_graph/io/events share: their state, and the events they take.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

namespace jeat::events {

// What an encoder keeps from piece to piece; -1 before the first event.
struct EncoderState {
    std::int64_t high = -1;  // upper part of the time (not wrapped)
    std::int64_t low = -1;   // lower part of the time
    std::int64_t row = -1;   // (px)
};

// Events to be written; all four of one length, the times (µs) not below 0.
struct Events {
    std::span<const std::int64_t> t;
    std::span<const std::uint16_t> x, y;
    std::span<const std::uint8_t> p;
};

// Events that were taken, and words that were written.
using Encoded = std::pair<std::size_t, std::size_t>;

}  // namespace jeat::events
