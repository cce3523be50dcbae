#include "association/assignment.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "interruption.hpp"

namespace jeat::association {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

const std::vector<std::size_t>& Assignment::solve(std::span<const Pair> pairs, std::size_t rows, std::size_t columns,
                                                  double exact) {
    pairs_ = pairs;
    rows_ = rows;
    made_.clear();
    parent_.resize(rows + columns);
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    for (const Pair& pair : pairs) join(pair.row, node_of(pair.column));
    order_by_group();
    place_.assign(rows + columns, 0);
    taken_.resize(rows + columns);
    for (std::size_t begin = 0, end; begin < order_.size(); begin = end) {
        end = begin;
        while (end < order_.size() && group_[order_[end]] == group_[order_[begin]]) ++end;
        if (end - begin == 1) {
            made_.push_back(order_[begin]);
        } else if (number_group(begin, end, exact)) {
            solve_group(end);
        } else {
            take_greatest(begin, end);
        }
    }
    std::sort(made_.begin(), made_.end(), [&](std::size_t a, std::size_t b) { return pairs[a].row < pairs[b].row; });
    return made_;
}

std::size_t Assignment::root(std::size_t node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
}

void Assignment::join(std::size_t a, std::size_t b) {
    a = root(a), b = root(b);
    if (a != b) parent_[std::max(a, b)] = std::min(a, b);
}

void Assignment::order_by_group() {
    order_.resize(pairs_.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    group_.resize(pairs_.size());
    for (std::size_t k = 0; k < pairs_.size(); ++k) group_[k] = root(pairs_[k].row);
    std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
        if (group_[a] != group_[b]) return group_[a] < group_[b];
        if (pairs_[a].row != pairs_[b].row) return pairs_[a].row < pairs_[b].row;
        return pairs_[a].column < pairs_[b].column;
    });
}

// Make the pair of greatest gain, again and again; of equals that of the first row, then of the first column.
void Assignment::take_greatest(std::size_t begin, std::size_t end) {
    const std::span group(order_.data() + begin, end - begin);
    std::sort(group.begin(), group.end(), [&](std::size_t a, std::size_t b) {
        const Pair &x = pairs_[a], &y = pairs_[b];
        if (x.gain != y.gain) return x.gain > y.gain;
        return x.row != y.row ? x.row < y.row : x.column < y.column;
    });
    for (const std::size_t k : group) taken_[pairs_[k].row] = taken_[node_of(pairs_[k].column)] = 0;
    for (const std::size_t k : group) {
        char &row = taken_[pairs_[k].row], &column = taken_[node_of(pairs_[k].column)];
        if (row || column) continue;
        row = column = 1;
        made_.push_back(k);
    }
}

// Give the rows and columns of a group their places in it; false where there are too many.
bool Assignment::number_group(std::size_t begin, std::size_t end, double exact) {
    group_rows_.clear();
    group_columns_.clear();
    first_.clear();
    for (std::size_t k = begin; k < end; ++k) {
        const Pair& pair = pairs_[order_[k]];
        if (group_rows_.empty() || group_rows_.back() != pair.row) {
            group_rows_.push_back(pair.row);
            first_.push_back(k);
        }
        group_columns_.push_back(pair.column);
    }
    first_.push_back(end);
    std::sort(group_columns_.begin(), group_columns_.end());
    group_columns_.erase(std::unique(group_columns_.begin(), group_columns_.end()), group_columns_.end());
    for (std::size_t k = 0; k < group_columns_.size(); ++k) place_[node_of(group_columns_[k])] = k;
    return static_cast<double>(std::max(group_rows_.size(), group_columns_.size())) <= exact;
}

void Assignment::solve_group(std::size_t end) {
    const std::size_t n = group_rows_.size(), m = group_columns_.size(), width = m + n;
    row_price_.assign(n, 0.0);
    column_price_.assign(width, 0.0);
    column_row_.assign(width, n);
    row_pair_.assign(n, end);
    row_column_.resize(n);
    std::iota(row_column_.begin(), row_column_.end(), m);
    for (std::size_t start = 0; start < n; ++start) {
        may_be_interrupted();
        const std::size_t sink = shortest_path(start, end);
        raise_prices(start, sink);
        augment(start, sink);
    }
    for (const std::size_t k : row_pair_)
        if (k != end) made_.push_back(order_[k]);
}

// The free column that is nearest to a row, by reduced costs: Dijkstra's search.
std::size_t Assignment::shortest_path(std::size_t start, std::size_t end) {
    const std::size_t n = group_rows_.size(), m = group_columns_.size(), width = m + n;
    distance_.assign(width, kInfinity);
    from_.assign(width, n);
    via_.assign(width, end);
    done_.assign(width, 0);
    touched_.clear();
    reached_ = 0.0;
    for (std::size_t row = start;;) {
        const auto relax = [&](std::size_t column, double cost, std::size_t pair) {
            if (done_[column]) return;
            const double d = reached_ + cost - row_price_[row] - column_price_[column];
            if (distance_[column] == kInfinity) touched_.push_back(column);
            if (d < distance_[column]) {
                distance_[column] = d;
                from_[column] = row;
                via_[column] = pair;
            }
        };
        for (std::size_t k = first_[row]; k < first_[row + 1]; ++k) {
            const Pair& pair = pairs_[order_[k]];
            relax(place_[node_of(pair.column)], -pair.gain, k);
        }
        relax(m + row, 0.0, end);
        const std::size_t best = nearest_column();
        reached_ = distance_[best];
        done_[best] = 1;
        if (column_row_[best] == n) return best;
        row = column_row_[best];
    }
}

// Of equally near ones a free column ends the search: many boxes at one place cost no more for it.
std::size_t Assignment::nearest_column() const {
    const std::size_t n = group_rows_.size(), none = distance_.size();
    std::size_t best = none;
    for (const std::size_t column : touched_) {
        if (done_[column]) continue;
        const bool nearer = best == none || distance_[column] < distance_[best];
        const bool ends =
            best < none && distance_[column] == distance_[best] && column_row_[column] == n && column_row_[best] != n;
        if (nearer || ends) best = column;
    }
    return best;
}

// Prices keep reduced costs from falling below 0.
void Assignment::raise_prices(std::size_t start, std::size_t sink) {
    row_price_[start] += reached_;
    for (const std::size_t column : touched_) {
        if (!done_[column] || column == sink) continue;
        row_price_[column_row_[column]] += reached_ - distance_[column];
        column_price_[column] -= reached_ - distance_[column];
    }
}

// Each row on the path takes the column that leads on, back from its end.
void Assignment::augment(std::size_t start, std::size_t sink) {
    for (std::size_t column = sink;;) {
        const std::size_t row = from_[column], before = row_column_[row];
        column_row_[column] = row;
        row_column_[row] = column;
        row_pair_[row] = via_[column];
        if (row == start) return;
        column = before;
    }
}

}  // namespace jeat::association
