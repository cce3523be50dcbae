// Members of a state as arrays by name, and back: a writer and a reader that a visitor of them is called with.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include "filters/boxes.hpp"
#include "vectors.hpp"

namespace jeat::tracking {

using filters::Sides;

// Numbers that may be infinite or none: what has never been.
enum class Values { finite, any };

// Greater numbers than this come from no scan: products of four of them are still finite.
inline constexpr double kMostNumber = 1e70;
// A side of e^50 px, or one that grows so fast, comes from no scan either.
inline constexpr double kMostLogSize = 50.0;
inline constexpr std::size_t kMostRows = std::size_t{1} << 31;

class StateWriter {
public:
    nb::dict out;

    template <class T> void column(const std::string& name, std::vector<T>& values, std::size_t rows, std::size_t width,
                                   Values = Values::finite) {
        (void)rows;
        if constexpr (std::is_same_v<T, Sides>) {
            std::vector<double> flat(values.size() * 4);
            for (std::size_t k = 0; k < values.size(); ++k) {
                const Sides& b = values[k];
                const double sides[] = {b.left, b.top, b.right, b.bottom};
                std::copy(sides, sides + 4, flat.begin() + static_cast<std::ptrdiff_t>(4 * k));
            }
            out[name.c_str()] = array_of(flat, 4 * width);
        } else {
            out[name.c_str()] = array_of(values, width);
        }
    }
    void numbers(const std::string& name, double* values, std::size_t count, Values = Values::finite) {
        out[name.c_str()] = array_of(std::vector<double>(values, values + count));
    }
    template <class T> void whole(const std::string& name, T& value) {
        out[name.c_str()] = array_of(std::vector<std::int64_t>{static_cast<std::int64_t>(value)});
    }
};

// Throws std::invalid_argument, which is ValueError in Python, where something cannot be.
class StateReader {
public:
    explicit StateReader(nb::dict source) : source_(std::move(source)) {}

    template <class T> void column(const std::string& name, std::vector<T>& values, std::size_t rows, std::size_t width,
                                   Values kind = Values::finite) {
        if constexpr (std::is_same_v<T, Sides>) {
            std::vector<double> flat;
            column(name, flat, rows, 4 * width, kind);
            values.resize(flat.size() / 4);
            for (std::size_t k = 0; k < values.size(); ++k)
                values[k] = {flat[4 * k], flat[4 * k + 1], flat[4 * k + 2], flat[4 * k + 3]};
        } else {
            const auto array = of<T>(name);
            require(rows <= kMostRows && array.size() == rows * width, name, "has another length");
            values.assign(array.data(), array.data() + array.size());
            if constexpr (std::is_same_v<T, double>) check_values(name, values.data(), values.size(), kind);
        }
    }
    void numbers(const std::string& name, double* values, std::size_t count, Values kind = Values::finite) {
        const auto array = of<double>(name);
        require(array.size() == count, name, "has another length");
        std::copy(array.data(), array.data() + count, values);
        check_values(name, values, count, kind);
    }
    template <class T> void whole(const std::string& name, T& value) {
        const auto array = of<std::int64_t>(name);
        require(array.size() == 1, name, "has another length");
        if constexpr (std::is_same_v<T, bool>) {
            require(array.data()[0] == 0 || array.data()[0] == 1, name, "is neither true nor false");
        } else {
            require(array.data()[0] >= 0, name, "is below 0");
        }
        value = static_cast<T>(array.data()[0]);
    }
    static void require(bool holds, const std::string& name, const char* what) {
        if (!holds) throw std::invalid_argument(name + " " + what);
    }

private:
    template <class T> nb::ndarray<const T, nb::numpy, nb::c_contig, nb::device::cpu> of(const std::string& name) {
        using Array = nb::ndarray<const T, nb::numpy, nb::c_contig, nb::device::cpu>;
        require(source_.contains(name.c_str()), name, "is missing");
        Array array;
        require(nb::try_cast<Array>(source_[name.c_str()], array, false), name, "is no array of its kind");
        return array;
    }
    static void check_values(const std::string& name, const double* values, std::size_t count, Values kind) {
        if (kind == Values::any) return;
        for (std::size_t k = 0; k < count; ++k)
            require(std::abs(values[k]) <= kMostNumber, name, "holds what is no number of a state");
    }

    nb::dict source_;
};

}  // namespace jeat::tracking
