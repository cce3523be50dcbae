// Tables of columns of one length, one row a track: what all of them can do.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace jeat::filters {

// A table has a method `columns(visit)` that calls visit(name, column, width) for each column, where width is the
// number of elements in a row.

template <class Table> void append_rows(Table& table, std::size_t old_rows, std::size_t more) {
    table.columns([&](const char*, auto& column, std::size_t width) { column.resize((old_rows + more) * width); });
}

// Keep the rows that are marked, in order. Rows that follow one another move at once.
template <class Table> void keep_rows(Table& table, const std::vector<std::uint8_t>& kept) {
    struct Run {
        std::size_t from, to, rows;
    };
    std::vector<Run> runs;
    std::size_t rows = 0;
    for (std::size_t from = 0; from < kept.size(); ++from) {
        if (!kept[from]) continue;
        if (runs.empty() || runs.back().from + runs.back().rows != from) runs.push_back({from, rows, 0});
        ++runs.back().rows;
        ++rows;
    }
    table.columns([&](const char*, auto& column, std::size_t width) {
        for (const Run& run : runs)
            if (run.to != run.from)
                std::copy_n(column.begin() + run.from * width, run.rows * width, column.begin() + run.to * width);
        column.resize(rows * width);
    });
}

// One column more of each sensor, of zeros.
template <class T> void widen_rows(std::vector<T>& column, std::size_t rows, std::size_t sensors, std::size_t each) {
    std::vector<T> wide(rows * (sensors + 1) * each, T{});
    for (std::size_t r = 0; r < rows; ++r)
        std::copy(column.begin() + r * sensors * each, column.begin() + (r + 1) * sensors * each,
                  wide.begin() + r * (sensors + 1) * each);
    column = std::move(wide);
}

// One column more of each sensor, and of each pair of sensors, of zeros.
template <class T> void widen_pairs(std::vector<T>& column, std::size_t rows, std::size_t sensors, std::size_t each) {
    const std::size_t wide_sensors = sensors + 1;
    std::vector<T> wide(rows * wide_sensors * wide_sensors * each, T{});
    for (std::size_t line = 0; line < rows * sensors; ++line) {
        const std::size_t to = (line / sensors * wide_sensors + line % sensors) * wide_sensors;
        std::copy(column.begin() + line * sensors * each, column.begin() + (line + 1) * sensors * each,
                  wide.begin() + to * each);
    }
    column = std::move(wide);
}

}  // namespace jeat::filters
