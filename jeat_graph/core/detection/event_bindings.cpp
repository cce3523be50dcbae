#include "detection/event_bindings.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include "detection/background.hpp"
#include "detection/flicker.hpp"
#include "detection/noise.hpp"
#include "detection/windows.hpp"

namespace jeat::detection {

namespace {

using Side = std::pair<std::int64_t, std::int64_t>;

Bin bin_of(const Out3<std::uint8_t>& slot, const Out2<std::uint16_t>& total) {
    check(slot.shape(0) == 2 && slot.shape(1) == total.shape(0) && slot.shape(2) == total.shape(1),
          "a bin has two pictures of the size of the total");
    return {slot.data(), slot.data() + total.size(), view2(total)};
}

using RingCells = In4<std::uint8_t>;

// Both ways to sum take the same: the ring, its bins that are asked for, rows and columns.
template <class Sum> auto summing(Sum sum) {
    return [sum](RingCells cells, In<std::int64_t> slots, Whole y, Whole x) {
        check(cells.shape(1) == 2, "a bin has two pictures");
        check_lengths({y.size(), x.size()});
        const Ring ring{cells.data(), cells.shape(0), cells.shape(2), cells.shape(3), span(slots)};
        const auto rows = span(y), columns = span(x);
        Buffer<std::int32_t> found(x.size());
        {
            const Release release;
            check_ring(ring, rows, columns);
            sum(ring, rows, columns, found.data.get());
        }
        return handed_over(std::move(found));
    };
}

}  // namespace

void bind_windows(nb::module_& module) {
    module.def(
        "count_events",
        [](In<std::uint16_t> x, In<std::uint16_t> y, In<std::uint8_t> polarity, Out3<std::uint8_t> slot,
           Out2<std::uint16_t> total) {
            check_lengths({x.size(), y.size(), polarity.size()});
            const Bin bin = bin_of(slot, total);
            const auto columns = span(x), rows = span(y);
            const auto polarities = span(polarity);
            const Release release;
            count_events(columns, rows, polarities, bin);
        },
        nb::arg("x").noconvert(), nb::arg("y").noconvert(), nb::arg("polarity").noconvert(),
        nb::arg("slot").noconvert(), nb::arg("total").noconvert(),
        "Count events in a bin (2, H, W) and in the total (H, W) of all.");
    module.def(
        "empty_bin",
        [](Out3<std::uint8_t> slot, Out2<std::uint16_t> total) {
            const Bin bin = bin_of(slot, total);
            const Release release;
            empty_bin(bin);
        },
        nb::arg("slot").noconvert(), nb::arg("total").noconvert(),
        "Empty all cells (2, H, W) of a bin, and take them off the total (H, W).");
    module.def(
        "empty_cells",
        [](In<std::uint16_t> x, In<std::uint16_t> y, Out3<std::uint8_t> slot, Out2<std::uint16_t> total) {
            check_lengths({x.size(), y.size()});
            const Bin bin = bin_of(slot, total);
            const auto columns = span(x), rows = span(y);
            const Release release;
            empty_cells(columns, rows, bin);
        },
        nb::arg("x").noconvert(), nb::arg("y").noconvert(), nb::arg("slot").noconvert(), nb::arg("total").noconvert(),
        "Empty the cells of a bin's events, and take them off the total (H, W).");
    module.def("events_of_few", summing(events_of_few), nb::arg("ring").noconvert(), nb::arg("slots").noconvert(),
               nb::arg("y").noconvert(), nb::arg("x").noconvert(),
               "Return the events (P,) of pixels in some bins of a ring (bins, 2, H, W).");
    module.def("events_of_many", summing(events_of_many), nb::arg("ring").noconvert(), nb::arg("slots").noconvert(),
               nb::arg("y").noconvert(), nb::arg("x").noconvert(),
               "Return the same, faster where many pixels are asked for.");
}

void bind_background(nb::module_& module) {
    module.def(
        "mark_unusual",
        [](In2<std::uint16_t> counts, In2<float> around, Out2<float> mean, std::tuple<double, double, double> how,
           Out2<std::uint16_t> out) {
            check_lengths({counts.size(), around.size(), mean.size(), out.size()});
            const auto [sigmas, quick, slow] = how;
            const Usual usual{static_cast<float>(sigmas), static_cast<float>(quick), static_cast<float>(slow)};
            const auto given = span(counts);
            const auto sums = span(around);
            const auto means = span(mean);
            const auto found = span(out);
            const Release release;
            mark_unusual(given, sums, means, usual, found);
        },
        nb::arg("counts").noconvert(), nb::arg("around").noconvert(), nb::arg("mean").noconvert(), nb::arg("how"),
        nb::arg("out").noconvert(),
        "Write the counts (H, W) that stand out of the means, and let the means of the sums around follow.");
}

void bind_noise(nb::module_& module) {
    module.def(
        "count_pixels",
        [](In<std::uint16_t> x, In<std::uint16_t> y, Out2<std::int32_t> counts) {
            check_lengths({x.size(), y.size()});
            const Places places{span(x), span(y)};
            const auto found = view2(counts);
            const Release release;
            count_pixels(places, found);
        },
        nb::arg("x").noconvert(), nb::arg("y").noconvert(), nb::arg("counts").noconvert(),
        "Count the events of each pixel (H, W).");
    module.def(
        "judge_noise",
        [](In<std::int64_t> t, In<std::uint16_t> x, In<std::uint16_t> y, Out2<std::int32_t> last, In2<bool> hot,
           Side times, Out<bool> good) {
            check_lengths({t.size(), x.size(), y.size(), good.size()});
            check(last.shape(0) == hot.shape(0) + 2 && last.shape(1) == hot.shape(1) + 2,
                  "the pixels' times need a margin of one pixel");
            const Places places{span(x), span(y)};
            const auto given = span(t);
            const auto kept = view2(last);
            const auto marks = view2(hot);
            const auto found = span(good);
            const Release release;
            return judge_noise(given, places, kept, marks, times.first, times.second, found);
        },
        nb::arg("t").noconvert(), nb::arg("x").noconvert(), nb::arg("y").noconvert(), nb::arg("last").noconvert(),
        nb::arg("hot").noconvert(), nb::arg("times"), nb::arg("good").noconvert(),
        "Mark the events that are no noise, keep the last times (H + 2, W + 2); return how many stood alone.");
    module.def(
        "leave_hot",
        [](In<std::uint16_t> x, In<std::uint16_t> y, In2<bool> hot, Out<bool> good) {
            check_lengths({x.size(), y.size(), good.size()});
            const Places places{span(x), span(y)};
            const auto marks = view2(hot);
            const auto found = span(good);
            const Release release;
            leave_hot(places, marks, found);
        },
        nb::arg("x").noconvert(), nb::arg("y").noconvert(), nb::arg("hot").noconvert(), nb::arg("good").noconvert(),
        "Mark the events that are in the picture (H, W) and not of hot pixels.");
    module.def(
        "leave_flicker",
        [](In<std::int64_t> t, In<std::uint16_t> x, In<std::uint16_t> y, In<std::uint8_t> polarity,
           Out2<std::int64_t> rise, Out2<std::uint8_t> state,
           std::tuple<std::int64_t, std::int64_t, std::int64_t, int> rule, Out<bool> good) {
            check_lengths({t.size(), x.size(), y.size(), polarity.size(), good.size()});
            check(rise.shape(0) == state.shape(0) && rise.shape(1) == state.shape(1), "both are of the picture's size");
            const auto [shortest, longest, forgotten, least] = rule;
            check(least > 0 && least < 32, "it flickers after 1 to 31 periods");
            const FlickerRule known{shortest, longest, forgotten, least};
            const Places places{span(x), span(y)};
            const auto times = span(t);
            const auto signs = span(polarity);
            const auto rises = view2(rise);
            const auto states = view2(state);
            const auto found = span(good);
            const Release release;
            leave_flicker(times, places, signs, rises, states, known, found);
        },
        nb::arg("t").noconvert(), nb::arg("x").noconvert(), nb::arg("y").noconvert(), nb::arg("polarity").noconvert(),
        nb::arg("rise").noconvert(), nb::arg("state").noconvert(), nb::arg("rule"), nb::arg("good").noconvert(),
        "Unmark the events of pixels that flicker: `rise` (H, W; us) and `state` (H, W) are theirs.");
    module.def(
        "take_events",
        [](In<std::int64_t> t, In<std::uint16_t> x, In<std::uint16_t> y, In<std::uint8_t> polarity, In<bool> good) {
            check_lengths({t.size(), x.size(), y.size(), polarity.size(), good.size()});
            const GivenEvents events{span(t), span(x), span(y), span(polarity)};
            const auto marks = span(good);
            const std::size_t room = good.size() + 1;
            Buffer<std::int64_t> out_t(room);
            Buffer<std::uint16_t> out_x(room), out_y(room);
            Buffer<std::uint8_t> out_p(room);
            {
                const Release release;
                const TakenEvents out{{out_t.data.get(), room},
                                      {out_x.data.get(), room},
                                      {out_y.data.get(), room},
                                      {out_p.data.get(), room}};
                out_t.used = out_x.used = out_y.used = out_p.used = take_events(events, marks, out);
            }
            return std::tuple(handed_over(std::move(out_t)), handed_over(std::move(out_x)),
                              handed_over(std::move(out_y)), handed_over(std::move(out_p)));
        },
        nb::arg("t").noconvert(), nb::arg("x").noconvert(), nb::arg("y").noconvert(), nb::arg("polarity").noconvert(),
        nb::arg("good").noconvert(), "Return times, columns, rows and polarities of the events that are marked (N,).");
}

}  // namespace jeat::detection
