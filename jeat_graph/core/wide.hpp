// Functions that exist twice on Linux: for the baseline of x86-64, and for processors with newer instructions, which
// are looked for when the extension is loaded. Only where the results cannot differ: whole numbers, and floating
// point numbers one by one (multiplications and additions stay apart in both).
//
// JEAT_GRAPH_TWICE is for what looks for bits, JEAT_GRAPH_WIDE for plain loops, which wider vectors alone make faster.
// A function that has either is not inline: it is defined in a source, or static. What it calls exists twice only as a
// part of it: each by JEAT_GRAPH_PART, or all by JEAT_GRAPH_WHOLE.
#pragma once

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && \
    !defined(JEAT_GRAPH_SANITIZE)
#define JEAT_GRAPH_TWICE __attribute__((target_clones("arch=haswell", "default")))
#define JEAT_GRAPH_WIDE __attribute__((target_clones("avx2", "default")))
#define JEAT_GRAPH_PART __attribute__((always_inline)) inline
#define JEAT_GRAPH_WHOLE __attribute__((flatten))
#else
#define JEAT_GRAPH_TWICE
#define JEAT_GRAPH_WIDE
#define JEAT_GRAPH_PART inline
#define JEAT_GRAPH_WHOLE
#endif
