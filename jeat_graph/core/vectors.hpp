// Arrays of NumPy that hold a copy of a vector.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "arrays.hpp"

namespace jeat {

template <class T> Buffer<T> copied(const std::vector<T>& source) {
    Buffer<T> out(source.size());
    std::copy(source.begin(), source.end(), out.data.get());
    return out;
}
template <class T> Out<T> array_of(const std::vector<T>& source) { return handed_over(copied(source)); }
// In rows of `columns`.
template <class T> Out2<T> array_of(const std::vector<T>& source, std::size_t columns) {
    return handed_over(copied(source), columns ? source.size() / columns : 0, columns);
}

}  // namespace jeat
