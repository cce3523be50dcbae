// Binds the kernels of jeat_graph.io.
#include "arrays.hpp"

namespace jeat::io {
void bind(nb::module_&) {}
}  // namespace jeat::io
