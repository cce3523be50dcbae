// EVT 3.0, whose words jeat_graph/io/events/evt3.py describes.
#pragma once

#include <array>
#include <bit>
#include <cstring>

#include "events/decoding.hpp"
#include "events/evt3_block.hpp"
#include "events/evt3_groups.hpp"
#include "wide.hpp"

namespace jeat::events::evt3 {

inline constexpr int HIGH_BITS = 12, LOW_BITS = 12;
inline constexpr std::int64_t SIDE = 0x7FF, BITS = 0xFFF;

// What leap from `high` the time of word `k` is, by the next time.
inline Leap leap_of(std::span<const std::uint16_t> words, std::size_t k, std::int64_t high, DecoderState& state) {
    const std::int64_t now = words[k] & BITS;
    if (!leaps(now, high, LOW_BITS)) return Leap::none;
    std::int64_t after = -1;
    for (std::size_t j = k + 1; j < words.size(); ++j) {
        if (words[j] >> 12 == TIME_HIGH) {
            after = words[j] & BITS;
            break;
        }
    }
    return kind_of_leap(high, now, after, std::int64_t{1} << HIGH_BITS, words.size() - k, state);
}

// The state of the loop in registers, and what each kind of word does to it.
class Decoder {
public:
    Decoder(DecoderState& state, const Columns& out, const Triggers& triggers, const Limits& limits)
        : state_(state), out_(out), triggers_(triggers), limits_(limits), n_(static_cast<std::size_t>(state.filled)),
          m_(static_cast<std::size_t>(state.triggers)), high_(state.high), low_(state.low), turns_(state.wraps),
          row_(state.row), base_(state.base), polarity_(state.polarity), last_(state.last), previous_(state.previous),
          time_(time()), late_from_(n_) {}

    std::size_t decode(std::span<const std::uint16_t> words) {
        std::size_t k = 0;
        while (k < words.size()) {
            k = take_plain(words, k);
            if (k == words.size() || !take(words, k)) return k;
            ++k;
        }
        return k;
    }

    void save() {
        leave_time();
        state_.filled = static_cast<std::int64_t>(n_);
        state_.triggers = static_cast<std::int64_t>(m_);
        state_.high = high_;
        state_.low = low_;
        state_.wraps = turns_;
        state_.row = row_;
        state_.base = base_;
        state_.polarity = polarity_;
        state_.last = last_;
        state_.previous = previous_;
    }

private:
    // Takes plain words (see evt3_block.hpp), up to another one or the end of the room; returns the next one.
    std::size_t take_plain(std::span<const std::uint16_t> words, std::size_t k) {
        std::array<std::uint16_t, BLOCK_WORDS> end;
        while (k < words.size() && high_ >= 0 && row_ >= 0 && time_ == last_) {
            const std::uint16_t* block = words.data() + k;
            if (words.size() - k < BLOCK_WORDS) {
                end.fill(UNUSED << 12);
                std::memcpy(end.data(), block, (words.size() - k) * sizeof(std::uint16_t));
                block = end.data();
            }
            const std::size_t taken = take_block(block);
            k += taken;
            if (taken < BLOCK_WORDS) break;
        }
        return k;
    }

    // Takes plain words of 64, and returns how many. What changes is kept in local variables: what is written
    // through pointers to bytes could else be any member, and each would be read again.
    JEAT_GRAPH_TWICE std::size_t take_block(const std::uint16_t* words) {
        Block block;
        classify(words, static_cast<unsigned>(high_), static_cast<unsigned>(low_), block);
        const auto word_of_last = [words](std::uint64_t mask) -> std::int64_t {
            return words[std::countl_zero(mask) ^ 63];
        };
        const std::int64_t upper = time_ - low_, row_before = row_;
        const Limits limits = limits_;
        const Columns out = out_;
        const std::size_t room = out.t.size();
        std::size_t n = n_, outside = 0;
        auto stop = static_cast<std::size_t>(std::countr_one(block.plain));
        std::uint64_t firsts = block.first & up_to(stop);
        std::int64_t base = base_, polarity = polarity_;
        for (std::uint64_t emit = block.emit & up_to(stop); emit != 0; emit &= emit - 1) {
            const auto k = static_cast<std::size_t>(std::countr_zero(emit));
            if (n + MOST_OF_A_WORD > room) {
                stop = k;
                break;
            }
            const std::uint64_t before = (emit & -emit) - 1, rows = block.row & before;
            const std::int64_t word = words[k], t = upper + block.low[k];
            const std::int64_t row = rows != 0 ? word_of_last(rows) & SIDE : row_before;
            if (word >> 12 == EVENT) {
                // Written before it is known whether it counts: no branch that is guessed wrongly.
                put_event(out, n, t, word & SIDE, row, word >> 11 & 1);
                const bool inside = ((word & SIDE) < limits.width) & (row < limits.height);
                n += inside;
                outside += !inside;
                continue;
            }
            if ((firsts & before) != 0) {
                const std::int64_t first = word_of_last(firsts & before);
                base = first & SIDE;
                polarity = first >> 11 & 1;
                firsts &= ~before;
            }
            const int width = word >> 12 == GROUP_12 ? 12 : 8;
            const auto bits = static_cast<unsigned>(word & ((1 << width) - 1));
            if (base + width <= limits.width && row < limits.height) {
                n = put_eight(out, n, bits & 0xFF, t, base, row, polarity);
                if (bits > 0xFF) n = put_eight(out, n, bits >> 8, t, base + 8, row, polarity);
            } else {
                const std::size_t kept = put_inside(out, n, bits, t, base, row, polarity, limits);
                outside += static_cast<std::size_t>(std::popcount(bits)) - (kept - n);
                n = kept;
            }
            base += width;
        }
        if (stop == 0) return 0;
        if ((firsts & up_to(stop)) != 0) {
            const std::int64_t first = word_of_last(firsts & up_to(stop));
            base = first & SIDE;
            polarity = first >> 11 & 1;
        }
        n_ = n;
        state_.outside += static_cast<std::int64_t>(outside);
        base_ = base;
        polarity_ = polarity;
        const std::uint64_t rows = block.row & up_to(stop);
        row_ = rows != 0 ? word_of_last(rows) & SIDE : row_before;
        low_ = block.low[stop - 1];
        time_ = last_ = previous_ = upper + low_;
        return stop;
    }

    // The bits below the bit `end` (0 to 64).
    static constexpr std::uint64_t up_to(std::size_t end) {
        return end < BLOCK_WORDS ? (std::uint64_t{1} << end) - 1 : ~std::uint64_t{0};
    }

    // Takes any word; false where it must wait for room or for more words.
    bool take(std::span<const std::uint16_t> words, std::size_t k) {
        const std::int64_t word = words[k];
        switch (word >> 12) {
            case EVENT:
                return put(1, word & SIDE, word >> 11 & 1);
            case ROW:
                row_ = word & SIDE;
                return true;
            case TIME_LOW:
                take_low(word & BITS);
                return true;
            case FIRST:
                base_ = word & SIDE;
                polarity_ = word >> 11 & 1;
                return true;
            case GROUP_12:
                return put_group(word, 12);
            case GROUP_8:
                return put_group(word, 8);
            case TIME_HIGH:
                return (word & BITS) == high_ || take_high(words, k);
            case TRIGGER:
                return take_edge(word);
            case CONTINUED_4:
            case OTHERS:
            case OTHERS + 1:
                return true;
            default:
                ++state_.unknown;
                return true;
        }
    }

    std::int64_t time() const { return (((turns_ << HIGH_BITS) + high_) << LOW_BITS) + low_; }
    bool full() const { return n_ + MOST_OF_A_WORD > out_.t.size(); }

    // Writes events of a row, a bit each from the column `first` on, and counts those that are left out; false where
    // there is no room.
    bool put(unsigned bits, std::int64_t first, std::int64_t polarity) {
        if (full()) return false;
        const auto count = static_cast<std::int64_t>(std::popcount(bits));
        if (high_ < 0 || row_ < 0) {
            state_.untimed += count;
            return true;
        }
        const std::size_t end = put_inside(out_, n_, bits, last_, first, row_, polarity, limits_);
        state_.outside += count - static_cast<std::int64_t>(end - n_);
        n_ = end;
        return true;
    }

    bool put_group(std::int64_t word, int width) {
        if (!put(static_cast<unsigned>(word & ((1 << width) - 1)), base_, polarity_)) return false;
        base_ += width;
        return true;
    }

    bool take_edge(std::int64_t word) {
        if (high_ < 0) {
            ++state_.untimed;
            return true;
        }
        if (m_ == triggers_.t.size()) return false;
        put_edge(triggers_, m_++, time_, word >> 8 & 0xF, word & 1);
        return true;
    }

    void take_low(std::int64_t low) {
        leave_time();
        low_ = low;
        time_ = time();
        if (high_ >= 0) enter_time();
    }

    // Takes a new value of the time's upper bits; false where more words must come before it is understood.
    bool take_high(std::span<const std::uint16_t> words, std::size_t k) {
        const Leap leap = leap_of(words, k, high_, state_);
        if (leap == Leap::lone) return true;
        if (leap == Leap::open) return false;
        const std::int64_t now = words[k] & BITS;
        leave_time();
        turns_ = turns_of_counter(now, high_, turns_, HIGH_BITS, LOW_BITS, state_);
        high_ = now;
        low_ = 0;  // the low bits follow; events before them lie at the beginning of these 4 ms
        time_ = time();
        enter_time();
        return true;
    }

    // Counts the events since the last time word whose own time was not the latest one.
    void leave_time() {
        if (time_ < last_ && n_ > late_from_) hold(static_cast<std::int64_t>(n_ - late_from_), time_, last_, state_);
    }

    void enter_time() {
        if (time_ < last_) {
            late_from_ = n_;
            if (time_ < previous_) ++state_.backwards;
        } else {
            last_ = time_;
        }
        previous_ = time_;
    }

    DecoderState& state_;
    const Columns out_;
    const Triggers triggers_;
    const Limits limits_;
    std::size_t n_, m_;
    std::int64_t high_, low_, turns_, row_, base_, polarity_, last_, previous_, time_;
    std::size_t late_from_;  // first event of the own time `time_`, where that is not the latest one
};

// Decodes words until they, or the room, end, or the state waits for more; returns how many were used.
inline std::size_t decode(std::span<const std::uint16_t> words, DecoderState& state, const Columns& out,
                          const Triggers& triggers, const Limits& limits) {
    Decoder decoder(state, out, triggers, limits);
    const std::size_t used = decoder.decode(words);
    decoder.save();
    return used;
}

}  // namespace jeat::events::evt3
