// Links marked pixels that lie near one another, for jeat_graph/detection/linking.py, which has the sources.
#pragma once

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <vector>

#include "arrays.hpp"
#include "wide.hpp"

namespace jeat::detection {

inline constexpr std::int32_t WORD = 64;
using Bits = View2<const std::uint64_t>;

// Columns and marks (P,) of marked pixels, where rows begin (H + 1,), and the sum of the marks.
struct Collected {
    Buffer<std::int32_t> x, weight;
    Buffer<std::int64_t> start;
    std::int64_t total;
};

// Collects the marked pixels: those whose bits are set in the rows of `bits` (H, B).
template <class Mark> Collected collect_marked(Bits bits, View2<const Mark> marks) {
    Buffer<std::int32_t> columns(bits.size() * WORD);  // most of this memory is never touched
    Buffer<std::int64_t> start(bits.rows + 1);
    std::size_t p = 0;
    for (std::size_t row = 0; row < bits.rows; ++row) {
        start[row] = static_cast<std::int64_t>(p);
        for (std::size_t n = 0; n < bits.columns; ++n) {
            for (std::uint64_t word = bits[row][n]; word != 0; word &= word - 1) {
                columns[p++] = static_cast<std::int32_t>(n) * WORD + std::countr_zero(word);
            }
        }
    }
    start[bits.rows] = static_cast<std::int64_t>(p);
    Collected found{Buffer<std::int32_t>(p), Buffer<std::int32_t>(p), std::move(start), 0};
    std::copy_n(columns.data.get(), p, found.x.data.get());
    for (std::size_t row = 0; row < bits.rows; ++row) {
        const auto end = static_cast<std::size_t>(found.start[row + 1]);
        for (auto k = static_cast<std::size_t>(found.start[row]); k < end; ++k) {
            const auto column = static_cast<std::size_t>(columns[k]);
            if (column >= marks.columns) throw std::out_of_range("a marked pixel lies outside the picture");
            const auto mark = static_cast<std::int32_t>(marks[row][column]);
            found.weight[k] = mark;
            found.total += mark;
        }
    }
    return found;
}

// Runs of a dilated picture: first and last column before it grows sideways, and where rows begin (H + 1).
struct Runs {
    explicit Runs(std::size_t most) : first(most), last(most) {}
    Buffer<std::int32_t> first, last;
    std::vector<std::size_t> begin;
    std::size_t size = 0;
};

// Sets the bits up to `columns` (less than 64) behind each that is set, twice as far each time.
inline void smear(std::vector<std::uint64_t>& line, std::int32_t columns) {
    for (std::int32_t done = 0; done < columns;) {
        const std::int32_t step = std::min(done + 1, columns - done);
        for (std::size_t n = line.size() - 1; n > 0; --n) {
            line[n] |= line[n] << step | line[n - 1] >> (WORD - step);
        }
        line[0] |= line[0] << step;
        done += step;
    }
}

// Sets in `line` what is set in any of some rows that follow one another.
inline void or_few_rows(const std::uint64_t* bits, std::size_t rows, std::uint64_t* line, std::size_t words) {
    for (std::size_t row = 0; row < rows; ++row) {
        for (std::size_t n = 0; n < words; ++n) line[n] |= bits[row * words + n];
    }
}

// The same with wider vectors, which pays where there are more rows than FEW_ROWS.
JEAT_GRAPH_WIDE static void or_many_rows(const std::uint64_t* bits, std::size_t rows, std::uint64_t* line,
                                         std::size_t words) {
    or_few_rows(bits, rows, line, words);
}
inline constexpr std::size_t FEW_ROWS = 4;

// A dilation reaches `link / 2` px to the right and down, and the rest of its side to the left and up.
inline Runs dilated_runs(Bits bits, std::int32_t link) {
    Runs runs(bits.rows * (bits.columns * (WORD / 2) + 1));  // most of this memory is never touched
    runs.begin.reserve(bits.rows + 1);
    std::vector<std::uint64_t> line(bits.columns);
    const std::int64_t down = link / 2, up = link - 1 - link / 2, height = static_cast<std::int64_t>(bits.rows);
    const std::int32_t behind = std::min(link, WORD) - 1;  // columns that are set behind each: gaps close
    for (std::int64_t row = 0; row < height; ++row) {
        runs.begin.push_back(runs.size);
        std::fill(line.begin(), line.end(), 0);
        const std::int64_t from = std::max(row - down, std::int64_t{0}), end = std::min(row + up, height - 1) + 1;
        if (from < end) {
            const auto rows = static_cast<std::size_t>(end - from);
            (rows > FEW_ROWS ? or_many_rows : or_few_rows)(bits[static_cast<std::size_t>(from)], rows, line.data(),
                                                           line.size());
        }
        smear(line, behind);
        std::uint64_t set_before = 0;
        for (std::size_t n = 0; n < line.size(); ++n) {
            const std::uint64_t word = line[n];
            for (std::uint64_t edges = word ^ (word << 1 | set_before); edges != 0; edges &= edges - 1) {
                const int bit = std::countr_zero(edges);
                const std::int32_t column = static_cast<std::int32_t>(n) * WORD + bit;
                if ((word >> bit & 1) == 0) {
                    runs.last[runs.size - 1] = column - 1 - behind;
                } else if (runs.size > runs.begin.back() && column - runs.last[runs.size - 1] <= link) {
                    continue;  // wider gaps than a word closes: the run goes on
                } else {
                    runs.first[runs.size] = runs.last[runs.size] = column;
                    ++runs.size;
                }
            }
            set_before = word >> (WORD - 1);
        }
    }
    runs.begin.push_back(runs.size);
    return runs;
}

// For each run one of its group that comes not after it.
using Parents = std::vector<std::uint32_t>;

// The run that stands for the group of a run; the way to it is halved.
inline std::uint32_t root_of(Parents& parent, std::uint32_t r) {
    while (parent[r] != r) {
        parent[r] = parent[parent[r]];
        r = parent[r];
    }
    return r;
}

// For each run the first run of its group: those of neighbouring rows that touch are of one.
inline Parents joined(const Runs& runs, std::int32_t link) {
    const auto &first = runs.first, &last = runs.last;
    const auto& begin = runs.begin;
    Parents parent(runs.size);
    std::iota(parent.begin(), parent.end(), 0U);
    for (std::size_t row = 1; row + 1 < begin.size(); ++row) {
        std::size_t a = begin[row], b = begin[row - 1];
        while (a < begin[row + 1] && b < begin[row]) {
            if (first[b] - last[a] > link) {
                ++a;
            } else if (first[a] - last[b] > link) {
                ++b;
            } else {
                const std::uint32_t one = root_of(parent, static_cast<std::uint32_t>(a));
                const std::uint32_t other = root_of(parent, static_cast<std::uint32_t>(b));
                parent[std::max(one, other)] = std::min(one, other);
                ++(last[a] < last[b] ? a : b);
            }
        }
    }
    for (std::uint32_t& own : parent) own = parent[own];  // a parent comes first, and knows its root by now
    return parent;
}

// Number of each group at its first run, from 1 in the order of blocks of 2 x 2; 0 where it is too light.
inline std::pair<std::vector<std::int32_t>, std::int64_t> numbered(const Parents& parent,
                                                                   const std::vector<std::int64_t>& size,
                                                                   const Runs& runs, std::int32_t link, double least) {
    const std::int32_t left = link - 1 - link / 2;
    std::vector<std::int64_t> place(parent.size(), std::numeric_limits<std::int64_t>::max());
    for (std::size_t row = 0; row + 1 < runs.begin.size(); ++row) {
        for (std::size_t r = runs.begin[row]; r < runs.begin[row + 1]; ++r) {
            const std::int64_t block =
                (static_cast<std::int64_t>(row / 2) << 32) + std::max(runs.first[r] - left, 0) / 2;
            place[parent[r]] = std::min(place[parent[r]], block);
        }
    }
    std::vector<std::size_t> roots;
    for (std::size_t r = 0; r < parent.size(); ++r) {
        if (parent[r] == r && static_cast<double>(size[r]) >= least) roots.push_back(r);
    }
    std::sort(roots.begin(), roots.end(), [&](std::size_t a, std::size_t b) { return place[a] < place[b]; });
    std::vector<std::int32_t> number(parent.size(), 0);
    for (std::size_t k = 0; k < roots.size(); ++k) number[roots[k]] = static_cast<std::int32_t>(k) + 1;
    return {std::move(number), static_cast<std::int64_t>(roots.size())};
}

// Number of groups with enough weight; columns, rows, groups and marks of their pixels.
struct Linked {
    std::int64_t count;
    Buffer<std::int32_t> x, y, group, weight;
};

inline Linked link_marked(Bits bits, std::span<const std::int32_t> x, std::span<const std::int32_t> weight,
                          std::span<const std::int64_t> start, std::int32_t link, double least) {
    const Runs runs = dilated_runs(bits, link);
    const Parents parent = joined(runs, link);
    Buffer<std::uint32_t> run(x.size());
    std::vector<std::int64_t> size(parent.size(), 0);
    for (std::size_t row = 0; row < bits.rows; ++row) {
        std::size_t r = runs.begin[row];
        for (auto p = static_cast<std::size_t>(start[row]); p < static_cast<std::size_t>(start[row + 1]); ++p) {
            while (r < runs.begin[row + 1] && runs.last[r] < x[p]) ++r;
            check(r < runs.begin[row + 1], "a pixel is marked whose bit is not set");
            run[p] = parent[r];
            size[parent[r]] += weight[p];
        }
    }
    const auto [number, count] = numbered(parent, size, runs, link, least);
    // One more, for a pixel is written before it is known whether it counts: no branch that is guessed wrongly.
    const std::size_t room = x.size() + 1;
    Linked found{count, Buffer<std::int32_t>(room), Buffer<std::int32_t>(room), Buffer<std::int32_t>(room),
                 Buffer<std::int32_t>(room)};
    std::size_t k = 0;
    for (std::size_t row = 0; row < bits.rows; ++row) {
        for (auto p = static_cast<std::size_t>(start[row]); p < static_cast<std::size_t>(start[row + 1]); ++p) {
            const std::int32_t group = number[run[p]];
            found.x[k] = x[p];
            found.y[k] = static_cast<std::int32_t>(row);
            found.group[k] = group;
            found.weight[k] = weight[p];
            k += group > 0;
        }
    }
    found.x.used = found.y.used = found.group.used = found.weight.used = k;
    return found;
}

}  // namespace jeat::detection
