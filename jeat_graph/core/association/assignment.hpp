// The assignment of greatest sum among the pairs that are possible, each row and column at most once.
//
// Pairs fall into groups that share no row and no column (connected components); each is solved alone by shortest
// augmenting paths (Jonker and Volgenant, Computing 38, 1987), where staying alone costs nothing. These take a time that
// grows with the cube of the group: of a group with more rows or columns than `exact`, which no traffic has, the pair of
// greatest gain is made, then that of what is left.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <numeric>
#include <vector>

#include "interruption.hpp"

namespace jeat::association {

struct Pair {
    std::size_t row, column;
    double gain;  // > 0
};

class Assignment {
public:
    // Return which of the pairs are made, in the order of their rows.
    const std::vector<std::size_t>& solve(const std::vector<Pair>& pairs, std::size_t rows, std::size_t columns,
                                          double exact) {
        made_.clear();
        parent_.resize(rows + columns);
        std::iota(parent_.begin(), parent_.end(), std::size_t{0});
        for (const Pair& pair : pairs) join(pair.row, rows + pair.column);
        order_.resize(pairs.size());
        std::iota(order_.begin(), order_.end(), std::size_t{0});
        group_.resize(pairs.size());
        for (std::size_t k = 0; k < pairs.size(); ++k) group_[k] = root(pairs[k].row);
        std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
            if (group_[a] != group_[b]) return group_[a] < group_[b];
            if (pairs[a].row != pairs[b].row) return pairs[a].row < pairs[b].row;
            return pairs[a].column < pairs[b].column;
        });
        place_.assign(rows + columns, 0);
        taken_.resize(rows + columns);
        for (std::size_t begin = 0, end; begin < order_.size(); begin = end) {
            end = begin;
            while (end < order_.size() && group_[order_[end]] == group_[order_[begin]]) ++end;
            if (end - begin == 1) {
                made_.push_back(order_[begin]);
            } else if (!solve_group(pairs, rows, begin, end, exact)) {
                take_greatest(pairs, rows, begin, end);
            }
        }
        std::sort(made_.begin(), made_.end(),
                  [&](std::size_t a, std::size_t b) { return pairs[a].row < pairs[b].row; });
        return made_;
    }

private:
    std::size_t root(std::size_t k) {
        while (parent_[k] != k) k = parent_[k] = parent_[parent_[k]];
        return k;
    }
    void join(std::size_t a, std::size_t b) {
        a = root(a), b = root(b);
        if (a != b) parent_[std::max(a, b)] = std::min(a, b);
    }

    // Make the pair of greatest gain, again and again; of equals that of the first row, then of the first column.
    void take_greatest(const std::vector<Pair>& pairs, std::size_t rows, std::size_t begin, std::size_t end) {
        std::sort(order_.begin() + static_cast<std::ptrdiff_t>(begin), order_.begin() + static_cast<std::ptrdiff_t>(end),
                  [&](std::size_t a, std::size_t b) {
                      const Pair &x = pairs[a], &y = pairs[b];
                      if (x.gain != y.gain) return x.gain > y.gain;
                      return x.row != y.row ? x.row < y.row : x.column < y.column;
                  });
        for (std::size_t k = begin; k < end; ++k) taken_[pairs[order_[k]].row] = taken_[rows + pairs[order_[k]].column] = 0;
        for (std::size_t k = begin; k < end; ++k) {
            char &row = taken_[pairs[order_[k]].row], &column = taken_[rows + pairs[order_[k]].column];
            if (row || column) continue;
            row = column = 1;
            made_.push_back(order_[k]);
        }
    }

    // Rows and columns of the group get places; each row has a column of its own, of gain 0, to stay alone. False where
    // the group is too large.
    bool solve_group(const std::vector<Pair>& pairs, std::size_t rows, std::size_t begin, std::size_t end, double exact) {
        group_rows_.clear();
        group_columns_.clear();
        for (std::size_t k = begin; k < end; ++k) {
            const Pair& pair = pairs[order_[k]];
            if (group_rows_.empty() || group_rows_.back() != pair.row) {
                group_rows_.push_back(pair.row);
            }
            group_columns_.push_back(pair.column);
        }
        std::sort(group_columns_.begin(), group_columns_.end());
        group_columns_.erase(std::unique(group_columns_.begin(), group_columns_.end()), group_columns_.end());
        if (static_cast<double>(std::max(group_rows_.size(), group_columns_.size())) > exact) return false;
        for (std::size_t k = 0; k < group_columns_.size(); ++k) place_[rows + group_columns_[k]] = k;
        const std::size_t n = group_rows_.size(), m = group_columns_.size(), width = m + n;
        first_.assign(n + 1, begin);
        for (std::size_t r = 0, k = begin; r < n; ++r) {
            first_[r] = k;
            while (k < end && pairs[order_[k]].row == group_rows_[r]) ++k;
            first_[r + 1] = k;
        }
        constexpr double kInfinity = std::numeric_limits<double>::infinity();
        row_price_.assign(n, 0.0);
        column_price_.assign(width, 0.0);
        column_row_.assign(width, n);
        row_pair_.assign(n, end);
        for (std::size_t start = 0; start < n; ++start) {
            may_be_interrupted();
            distance_.assign(width, kInfinity);
            from_.assign(width, n);
            via_.assign(width, end);
            done_.assign(width, 0);
            touched_.clear();
            std::size_t row = start, sink = width;
            double reached = 0.0;
            while (true) {
                const auto relax = [&](std::size_t column, double cost, std::size_t pair) {
                    if (done_[column]) return;
                    const double d = reached + cost - row_price_[row] - column_price_[column];
                    if (distance_[column] == kInfinity) touched_.push_back(column);
                    if (d < distance_[column]) {
                        distance_[column] = d;
                        from_[column] = row;
                        via_[column] = pair;
                    }
                };
                for (std::size_t k = first_[row]; k < first_[row + 1]; ++k) {
                    const Pair& pair = pairs[order_[k]];
                    relax(place_[rows + pair.column], -pair.gain, k);
                }
                relax(m + row, 0.0, end);
                // Of equally near ones a free column ends the search: many boxes at one place cost no more for it.
                std::size_t best = width;
                for (const std::size_t column : touched_) {
                    if (done_[column]) continue;
                    const bool nearer = best == width || distance_[column] < distance_[best];
                    const bool ends = best < width && distance_[column] == distance_[best] &&
                                      column_row_[column] == n && column_row_[best] != n;
                    if (nearer || ends) best = column;
                }
                reached = distance_[best];
                done_[best] = 1;
                if (column_row_[best] == n) {
                    sink = best;
                    break;
                }
                row = column_row_[best];
            }
            // Prices keep reduced costs from falling below 0.
            row_price_[start] += reached;
            for (const std::size_t column : touched_) {
                if (!done_[column] || column == sink) continue;
                row_price_[column_row_[column]] += reached - distance_[column];
                column_price_[column] -= reached - distance_[column];
            }
            for (std::size_t column = sink;;) {
                const std::size_t r = from_[column], before = row_column(r, m, pairs, rows);
                column_row_[column] = r;
                row_pair_[r] = via_[column];
                if (r == start) break;
                column = before;
            }
        }
        for (std::size_t r = 0; r < n; ++r)
            if (row_pair_[r] != end) made_.push_back(order_[row_pair_[r]]);
        return true;
    }

    // The column that a row has, before it gets another one.
    std::size_t row_column(std::size_t r, std::size_t m, const std::vector<Pair>& pairs, std::size_t rows) const {
        const std::size_t k = row_pair_[r];
        return k < first_.back() ? place_[rows + pairs[order_[k]].column] : m + r;
    }

    std::vector<std::size_t> parent_, order_, group_, place_, made_, group_rows_, group_columns_, first_;
    std::vector<std::size_t> column_row_, row_pair_, from_, via_, touched_;
    std::vector<double> row_price_, column_price_, distance_;
    std::vector<char> done_, taken_;
};

}  // namespace jeat::association
