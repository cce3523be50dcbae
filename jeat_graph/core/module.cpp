// The extension jeat_graph.core._core: one submodule for each folder.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

namespace jeat::association {
void bind(nb::module_& module);
}
namespace jeat::detection {
void bind(nb::module_& module);
}
namespace jeat::events {
void bind(nb::module_& module);
}
namespace jeat::io {
void bind(nb::module_& module);
}
namespace jeat::road {
void bind(nb::module_& module);
}
namespace jeat::tracking {
void bind(nb::module_& module);
}

NB_MODULE(_core, module) {
    module.doc() = "The compiled part of jeat-graph; its submodules have the names of the package's folders.";
    auto association = module.def_submodule("association", "Kernels of jeat_graph.association.");
    jeat::association::bind(association);
    auto detection = module.def_submodule("detection", "Kernels of jeat_graph.detection.");
    jeat::detection::bind(detection);
    auto events = module.def_submodule("events", "Decoders and encoders of jeat_graph.io.events.");
    jeat::events::bind(events);
    auto io = module.def_submodule("io", "Kernels of jeat_graph.io.");
    jeat::io::bind(io);
    auto road = module.def_submodule("road", "Kernels of jeat_graph.road.");
    jeat::road::bind(road);
    auto tracking = module.def_submodule("tracking", "The tracker's step.");
    jeat::tracking::bind(tracking);
}
