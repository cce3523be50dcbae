#include "arrays.hpp"
namespace jeat::detection {
void bind(nb::module_&) {}
}
