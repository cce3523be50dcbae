// What the loops that decode words of events share: their state, and the steps that they all make.
//
// Every loop knows the time from words of their own or from the events, leaves out what has no time yet or
// lies outside the picture, keeps the times in order, and counts what was wrong.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace jeat::events {

// A time that steps ahead by more than this (µs) is remarked on: a camera's clock does not do so.
inline constexpr std::int64_t JUMP_US = 10'000'000;
// A single time that leaps ahead by more than this (µs), and that the next one takes back, is no time.
inline constexpr std::int64_t LEAP_US = 1'000'000;
// So many events one word may stand for, and so much room a loop asks for before it takes one.
inline constexpr std::size_t MOST_OF_A_WORD = 32;
// A clock that stands whole in each event has so many bits (µs) and begins again after 71 min.
inline constexpr int CLOCK_BITS = 32;
// So many words are waited for at most, for the time after one that leaps.
inline constexpr std::size_t MOST_AHEAD = std::size_t{1} << 20;

// What a loop keeps from block to block. Times are in µs; -1 where none is known.
struct DecoderState {
    std::int64_t filled = 0;     // events in the room
    std::int64_t triggers = 0;   // edges in their room
    std::int64_t last = -1;      // the latest time so far, which no later event lies before
    std::int64_t previous = -1;  // own time of the events before
    std::int64_t high = -1;      // counter of the time's upper bits, or the clock
    std::int64_t wraps = 0;      // how often it began again
    std::int64_t low = 0;        // low bits of the time
    std::int64_t row = -1;       // row of the events that follow
    std::int64_t base = 0;       // first column of the next group
    std::int64_t polarity = 0;   // of the groups that follow
    std::int64_t outside = 0;    // the counts of `Damage` in jeat_graph/io/events/reader.py
    std::int64_t backwards = 0;
    std::int64_t held = 0;
    std::int64_t held_from_us = -1;
    std::int64_t late_us = 0;
    std::int64_t unknown = 0;
    std::int64_t untimed = 0;
    std::int64_t jumps = 0;
    std::int64_t leaps = 0;
    bool ended = false;  // whether no words follow those that are given
    bool waits = false;  // whether the loop stopped for words that are not there yet
};

// Room for events; all four of one length.
struct Columns {
    std::span<std::int64_t> t;
    std::span<std::uint16_t> x, y;
    std::span<std::uint8_t> p;
};

// Room for edges of external signals; all three of one length.
struct Triggers {
    std::span<std::int64_t> t;
    std::span<std::uint8_t> channel, value;
};

// First column and row outside the picture (px).
struct Limits {
    std::int64_t width, height;
};

// What a leap of a counter may be: none, a lone one, or not known before more words are read.
enum class Leap { none, lone, open };

// Tells a counter of `full` values that began again from one that stepped back by a fault.
constexpr bool wraps(std::int64_t old, std::int64_t now, std::int64_t full) {
    const std::int64_t quarter = full / 4;
    return old >= full - quarter && now < quarter;
}

// Whether a counter of the time above `low_bits` (µs) steps ahead by more than `LEAP_US`.
constexpr bool leaps(std::int64_t now, std::int64_t old, int low_bits) {
    return old >= 0 && now - old > LEAP_US >> low_bits;
}

// Tells a lone leap, which the value after it takes back to where the counter was, and counts it. As the
// counter does not begin again there, it would run backwards: no sound file has such a leap, and a gap in a
// recording is none. `old`, `now` and `after` are the values before the leap, of it and after it (-1 if none
// has come yet), `full` the number of values, `left` the words that are there from the one that leaps on.
inline Leap kind_of_leap(std::int64_t old, std::int64_t now, std::int64_t after, std::int64_t full, std::size_t left,
                         DecoderState& state) {
    if (after < 0 && !state.ended && left < MOST_AHEAD) {
        state.waits = true;
        return Leap::open;
    }
    if (old <= after && after - old < now - after && !wraps(now, after, full)) {
        ++state.leaps;
        return Leap::lone;
    }
    return Leap::none;
}

// Counts events that get the latest time `last` in place of their own time `t`, which lies before it.
inline void hold(std::int64_t count, std::int64_t t, std::int64_t last, DecoderState& state) {
    if (state.held == 0) state.held_from_us = t;
    state.held += count;
    state.late_us = std::max(state.late_us, last - t);
}

// How often a counter of `bits` of the time above `low_bits` (µs) began again; a jump ahead is remarked on.
inline std::int64_t turns_of_counter(std::int64_t now, std::int64_t old, std::int64_t turns, int bits, int low_bits,
                                     DecoderState& state) {
    if (wraps(old, now, std::int64_t{1} << bits)) return turns + 1;
    if (old >= 0 && now - old > JUMP_US >> low_bits) ++state.jumps;
    return turns;
}

// How often a clock of `CLOCK_BITS` began again; a jump and a step back are remarked on. To be asked where it
// does neither go on nor stand still, by at most `LEAP_US`: most events have no need.
inline std::int64_t turns_of_clock(std::int64_t now, std::int64_t old, std::int64_t turns, DecoderState& state) {
    if (now < old) {
        if (wraps(old, now, std::int64_t{1} << CLOCK_BITS)) return turns + 1;
        ++state.backwards;
    } else if (old >= 0 && now - old > JUMP_US) {
        ++state.jumps;
    }
    return turns;
}

// Whether an event has a time and lies in the picture; if not, it is counted among those left out.
inline bool is_kept(std::int64_t x, std::int64_t y, bool timed, const Limits& limits, DecoderState& state) {
    if (!timed) {
        ++state.untimed;
        return false;
    }
    if (x >= limits.width || y >= limits.height) {
        ++state.outside;
        return false;
    }
    return true;
}

inline void put_event(const Columns& out, std::size_t row, std::int64_t t, std::int64_t x, std::int64_t y,
                      std::int64_t polarity) {
    out.t[row] = t;
    out.x[row] = static_cast<std::uint16_t>(x);
    out.y[row] = static_cast<std::uint16_t>(y);
    out.p[row] = static_cast<std::uint8_t>(polarity);
}

inline void put_edge(const Triggers& triggers, std::size_t row, std::int64_t t, std::int64_t channel,
                     std::int64_t value) {
    triggers.t[row] = t;
    triggers.channel[row] = static_cast<std::uint8_t>(channel);
    triggers.value[row] = static_cast<std::uint8_t>(value);
}

}  // namespace jeat::events
