// The assignment of greatest sum among the pairs that are possible, each row and column at most once.
//
// Pairs fall into groups that share no row and no column (connected components); each is solved alone by shortest
// augmenting paths (Jonker and Volgenant, Computing 38, 1987), where staying alone costs nothing. These take a time that
// grows with the cube of the group: of a group with more rows or columns than `exact`, which no traffic has, the pair of
// greatest gain is made, then that of what is left.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace jeat::association {

struct Pair {
    std::size_t row, column;
    double gain;  // > 0
};

class Assignment {
public:
    // Return which of the pairs are made, in the order of their rows.
    const std::vector<std::size_t>& solve(std::span<const Pair> pairs, std::size_t rows, std::size_t columns,
                                          double exact);

private:
    std::size_t root(std::size_t node);
    void join(std::size_t a, std::size_t b);
    void order_by_group();
    void take_greatest(std::size_t begin, std::size_t end);
    bool number_group(std::size_t begin, std::size_t end, double exact);
    void solve_group(std::size_t end);
    std::size_t shortest_path(std::size_t start, std::size_t end);
    std::size_t nearest_column() const;
    void raise_prices(std::size_t start, std::size_t sink);
    void augment(std::size_t start, std::size_t sink);

    // A column by its node in the graph of rows and columns.
    std::size_t node_of(std::size_t column) const { return rows_ + column; }

    std::span<const Pair> pairs_;
    std::size_t rows_ = 0;
    std::vector<std::size_t> made_;
    std::vector<std::size_t> parent_, group_;  // of nodes, and of pairs: the first node that is connected with them
    std::vector<std::size_t> order_;           // pairs by group, row and column
    std::vector<char> taken_;                  // of nodes
    std::vector<std::size_t> place_;           // of nodes, in their group
    // Of one group: rows, and columns, behind which each row has one of its own, of gain 0, to stay alone.
    std::vector<std::size_t> group_rows_, group_columns_;
    std::vector<std::size_t> first_;  // where the pairs of each row begin in order_
    std::vector<double> row_price_, column_price_;
    std::vector<std::size_t> column_row_;  // the row that has a column, number of rows for none
    std::vector<std::size_t> row_column_;  // the column that a row has
    std::vector<std::size_t> row_pair_;    // by which pair
    // Of the search from one row: how far columns are, from which row, by which pair, and those that were reached.
    double reached_ = 0.0;
    std::vector<double> distance_;
    std::vector<std::size_t> from_, via_, touched_;
    std::vector<char> done_;
};

}  // namespace jeat::association
