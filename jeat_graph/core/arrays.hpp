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
#include <utility>

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

// A view of rows of one length.
template <class T> struct View2 {
    T* data;
    std::size_t rows, columns;
    T* operator[](std::size_t row) const { return data + row * columns; }
    std::size_t size() const { return rows * columns; }
};
template <class T, class... Rest> View2<T> view2(const nb::ndarray<T, Rest...>& array) {
    return {array.data(), array.shape(0), array.shape(1)};
}

// The elements of an array of any shape, in their order.
template <class T, class... Rest> std::span<T> span(const nb::ndarray<T, Rest...>& array) {
    return {array.data(), array.size()};
}

// Memory for what a kernel returns, of which the first `used` elements are filled.
template <class T> struct Buffer {
    explicit Buffer(std::size_t room) : data(std::make_unique_for_overwrite<T[]>(room)), room(room), used(room) {}
    T& operator[](std::size_t k) { return data[k]; }
    const T& operator[](std::size_t k) const { return data[k]; }

    std::unique_ptr<T[]> data;
    std::size_t room, used;
};

// An array of what is used of a buffer; Python owns its memory from then on, without a copy.
template <class T> nb::capsule owner_of(Buffer<T>& buffer) {
    nb::capsule owner(buffer.data.get(), [](void* memory) noexcept { delete[] static_cast<T*>(memory); });
    buffer.data.release();
    return owner;
}
template <class T> Out<T> handed_over(Buffer<T>&& buffer) {
    T* const data = buffer.data.get();
    return Out<T>(data, {buffer.used}, owner_of(buffer));
}
template <class T> Out2<T> handed_over(Buffer<T>&& buffer, std::size_t rows, std::size_t columns) {
    T* const data = buffer.data.get();
    return Out2<T>(data, {rows, columns}, owner_of(buffer));
}

// Raise ValueError in Python where columns that belong together are not of one length.
inline void check_lengths(std::initializer_list<std::size_t> lengths) {
    for (const std::size_t length : lengths) {
        if (length != *lengths.begin()) {
            throw std::invalid_argument("columns of different lengths: " + std::to_string(*lengths.begin()) + " and " +
                                        std::to_string(length));
        }
    }
}

inline void check(bool holds, const char* message) {
    if (!holds) throw std::invalid_argument(message);
}

}  // namespace jeat
