// Looks at 64 words of EVT 3.0 at once: which of them are what, and the time that holds at each.
//
// What a word is cannot be guessed, and a wrong guess costs a processor as long as several words; so the kinds
// become masks, of which only the events are gone through.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#if defined(__SSE2__) || defined(_M_X64)
#include <emmintrin.h>
#define JEAT_GRAPH_SSE2 1
#endif

namespace jeat::events::evt3 {

// Kinds of words: bits 15 to 12. From OTHERS on, and in CONTINUED_4, the camera speaks about itself.
enum Kind : unsigned {
    ROW = 0,
    UNUSED = 1,
    EVENT = 2,
    FIRST = 3,
    GROUP_12 = 4,
    GROUP_8 = 5,
    TIME_LOW = 6,
    CONTINUED_4 = 7,
    TIME_HIGH = 8,
    TRIGGER = 10,
    OTHERS = 14,
};

inline constexpr std::size_t BLOCK_WORDS = 64;

// 64 words; bit k of a mask stands for word k.
struct Block {
    std::uint64_t row = 0;    // says the row
    std::uint64_t first = 0;  // says the first column of a group
    std::uint64_t emit = 0;   // an event or a group of them
    std::uint64_t plain = 0;  // one of these, a low time not below the last one, or the same high time again
    std::array<std::uint16_t, BLOCK_WORDS> low;  // low time at each word, up to the first that is not plain
};

// Looks at 64 words one by one: what `classify` does, on processors that it has no instructions for.
inline void classify_one_by_one(const std::uint16_t* words, unsigned high, unsigned low, Block& block) {
    block.row = block.first = block.emit = block.plain = 0;
    for (std::size_t k = 0; k < BLOCK_WORDS; ++k) {
        const unsigned word = words[k], kind = word >> 12, bits = word & 0xFFF;
        const std::uint64_t bit = std::uint64_t{1} << k;
        const bool later = kind == TIME_LOW && bits >= low;
        low = later ? bits : low;
        block.low[k] = static_cast<std::uint16_t>(low);
        const bool emit = kind == EVENT || kind == GROUP_12 || kind == GROUP_8;
        block.row |= kind == ROW ? bit : 0;
        block.first |= kind == FIRST ? bit : 0;
        block.emit |= emit ? bit : 0;
        const bool plain = emit || later || kind == ROW || kind == FIRST || word == (TIME_HIGH << 12 | high);
        block.plain |= plain ? bit : 0;
    }
}

#ifdef JEAT_GRAPH_SSE2
// Sixteen bits, one for each lane of two vectors whose lanes are all ones or all zeros.
inline std::uint64_t bits_of(__m128i first, __m128i second) {
    return static_cast<std::uint64_t>(static_cast<unsigned>(_mm_movemask_epi8(_mm_packs_epi16(first, second))));
}

// What eight words are; a lane is all ones where the word is of the kind.
struct Eight {
    __m128i row, first, emit, plain;
};

// Looks at eight words; `latest` is the low time before them, and then after them, in all lanes.
inline Eight classify_eight(const std::uint16_t* words, __m128i same_high, __m128i& latest, std::uint16_t* low) {
    const auto all = [](int value) { return _mm_set1_epi16(static_cast<short>(value)); };
    const __m128i word = _mm_loadu_si128(reinterpret_cast<const __m128i*>(words));
    const __m128i kind = _mm_srli_epi16(word, 12);
    const __m128i time = _mm_cmpeq_epi16(kind, all(TIME_LOW));
    // The latest low time at each word: the largest up to it.
    const __m128i own = _mm_and_si128(_mm_and_si128(word, all(0xFFF)), time);
    __m128i largest = _mm_max_epi16(own, _mm_slli_si128(own, 2));
    largest = _mm_max_epi16(largest, _mm_slli_si128(largest, 4));
    largest = _mm_max_epi16(largest, _mm_slli_si128(largest, 8));
    largest = _mm_max_epi16(largest, latest);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(low), largest);
    const __m128i upper = _mm_shufflehi_epi16(largest, 0xFF);
    latest = _mm_unpackhi_epi64(upper, upper);
    const __m128i later = _mm_and_si128(time, _mm_cmpeq_epi16(own, largest));
    const __m128i row = _mm_cmpeq_epi16(kind, _mm_setzero_si128());
    const __m128i first = _mm_cmpeq_epi16(kind, all(FIRST));
    const __m128i group = _mm_cmpeq_epi16(_mm_or_si128(kind, all(1)), all(GROUP_8));
    const __m128i emit = _mm_or_si128(_mm_cmpeq_epi16(kind, all(EVENT)), group);
    const __m128i plain = _mm_or_si128(_mm_or_si128(_mm_or_si128(row, first), emit),
                                       _mm_or_si128(later, _mm_cmpeq_epi16(word, same_high)));
    return {row, first, emit, plain};
}

// Looks at 64 words: `high` and `low` are the time before them (0 to 4095).
inline void classify(const std::uint16_t* words, unsigned high, unsigned low, Block& block) {
    const __m128i same_high = _mm_set1_epi16(static_cast<short>(TIME_HIGH << 12 | high));
    __m128i latest = _mm_set1_epi16(static_cast<short>(low));
    std::uint64_t row = 0, first = 0, emit = 0, plain = 0;
    for (std::size_t k = 0; k < BLOCK_WORDS; k += 16) {
        const Eight one = classify_eight(words + k, same_high, latest, block.low.data() + k);
        const Eight other = classify_eight(words + k + 8, same_high, latest, block.low.data() + k + 8);
        row |= bits_of(one.row, other.row) << k;
        first |= bits_of(one.first, other.first) << k;
        emit |= bits_of(one.emit, other.emit) << k;
        plain |= bits_of(one.plain, other.plain) << k;
    }
    block.row = row;
    block.first = first;
    block.emit = emit;
    block.plain = plain;
}
#else
inline void classify(const std::uint16_t* words, unsigned high, unsigned low, Block& block) {
    classify_one_by_one(words, high, low, block);
}
#endif

}  // namespace jeat::events::evt3
