// Arrays of NumPy as the core sees them: views without a copy, of one type, contiguous, checked where they enter.
//
// Kernels take std::span and View2 only; nanobind's arrays stay in the files that bind them (module.cpp).
// There each array is bound with noconvert(): another type or layout is a TypeError, never a silent copy.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

namespace jeat {

namespace nb = nanobind;

// What a kernel reads, and what it writes: one or two dimensions, rows in order.
template <class T> using In = nb::ndarray<const T, nb::numpy, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <class T> using Out = nb::ndarray<T, nb::numpy, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <class T> using In2 = nb::ndarray<const T, nb::numpy, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <class T> using Out2 = nb::ndarray<T, nb::numpy, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <class T> using In3 = nb::ndarray<const T, nb::numpy, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
template <class T> using Out3 = nb::ndarray<T, nb::numpy, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
template <class T> using In4 = nb::ndarray<const T, nb::numpy, nb::ndim<4>, nb::c_contig, nb::device::cpu>;

// The elements of an array of any shape, in their order.
template <class T, class... Rest> std::span<T> span(const nb::ndarray<T, Rest...>& array) {
    return {array.data(), array.size()};
}

// An array that Python receives and owns from then on; the vector's memory is handed over, not copied.
template <class T> Out<T> handed_over(std::vector<T>&& values) {
    auto owned = std::make_unique<std::vector<T>>(std::move(values));
    nb::capsule owner(owned.get(), [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    auto* vector = owned.release();
    return Out<T>(vector->data(), {vector->size()}, owner);
}

template <class T> Out2<T> handed_over(std::vector<T>&& values, std::size_t columns) {
    auto owned = std::make_unique<std::vector<T>>(std::move(values));
    nb::capsule owner(owned.get(), [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    auto* vector = owned.release();
    return Out2<T>(vector->data(), {vector->size() / columns, columns}, owner);
}

// Raise ValueError in Python where columns that belong together are not of one length.
inline void check_lengths(std::initializer_list<std::size_t> lengths) {
    for (const std::size_t length : lengths) {
        if (length != *lengths.begin()) {
            throw std::invalid_argument("columns of different lengths: " + std::to_string(*lengths.begin()) +
                                        " and " + std::to_string(length));
        }
    }
}

inline void check(bool holds, const char* message) {
    if (!holds) throw std::invalid_argument(message);
}

}  // namespace jeat
