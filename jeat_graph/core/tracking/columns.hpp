// What the tracker knows, as arrays for Python: rows of tables, records of a step, what was learnt.
#pragma once

#include <cstdint>
#include <tuple>

#include <nanobind/nanobind.h>
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "tracking/answer.hpp"
#include "tracking/records.hpp"
#include "tracking/state.hpp"

namespace jeat::tracking {

using Named = nb::typed<nb::dict, nb::str, nb::object>;

// Time, identity, mean, variance, posterior, sensors, number of the class, its share.
using Table = std::tuple<Out<double>, Out<std::int64_t>, Out2<double>, Out2<double>, Out<double>, Out<std::int64_t>,
                         Out<std::int64_t>, Out<double>>;
Table table(const Rows& rows);

// Scan by scan and entry by entry, as `Record.scans` of module.cpp describes them.
using Scans = std::tuple<Out<std::int64_t>, Out<std::int64_t>, Out<std::int64_t>, Out2<double>, Out2<double>,
                         Out2<double>, Out2<double>, Out2<double>>;
Scans scans_of(const Record& record, const ModelConstants& c);

// As `Record.fields` of module.cpp describes them.
using Fields = std::tuple<double, bool, Out<double>, Out<std::int64_t>, Out<std::uint8_t>, Out<double>,
                          Out<std::uint8_t>, Out<double>>;
Fields fields_of(const Record& record);

// Gaps that outlasted each bin, and of these those that ended well.
Out2<double> gaps_of(const GapCounts& gaps);

// What is believed of the sensors and the scene, by name.
Named learnt_of(const State& state);

// The tracks as they are now, column by column, for tests: (N, width) each.
Named tracks_of(Tracks& tracks);

}  // namespace jeat::tracking
