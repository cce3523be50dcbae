// Binds the kernels of jeat_graph.detection.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "detection/background.hpp"
#include "detection/components.hpp"
#include "detection/flicker.hpp"
#include "detection/linking.hpp"
#include "detection/memory.hpp"
#include "detection/noise.hpp"
#include "detection/picture_detector.hpp"
#include "detection/windows.hpp"

namespace jeat::detection {

namespace {

using Whole = In<std::int32_t>;
using MarkedColumns = std::tuple<Whole, Whole, Whole, Whole>;
using Release = nb::gil_scoped_release;
using Side = std::pair<std::int64_t, std::int64_t>;

Marked marked_of(const MarkedColumns& columns) {
    const auto& [x, y, group, weight] = columns;
    return {span(x), span(y), span(group), span(weight)};
}

std::span<const Box> boxes_of(const In2<double>& boxes) {
    check(boxes.shape(1) == 4, "boxes have four columns");
    return {reinterpret_cast<const Box*>(boxes.data()), boxes.shape(0)};
}

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

void bind_components(nb::module_& module) {
    module.def(
        "group_weights",
        [](std::size_t count, MarkedColumns columns) {
            const Marked marked = marked_of(columns);
            Buffer<double> found(count);
            {
                const Release release;
                check_marked(marked, count + 1);
                group_weights(count, marked, found.data.get());
            }
            return handed_over(std::move(found));
        },
        nb::arg("count"), nb::arg("marked").noconvert(), "Return the sum of the marks (M,) of each group.");
    module.def(
        "measure_groups",
        [](std::size_t count, MarkedColumns columns, double share) {
            check(share <= 1.0, "a share is at most 1");
            const Marked marked = marked_of(columns);
            auto found = [&] {
                const Release release;
                check_marked(marked, count + 1);
                return measure_groups(count, marked, share);
            }();
            return std::tuple(handed_over(std::move(found.corners), count, 4), handed_over(std::move(found.weight)),
                              handed_over(std::move(found.pixels)));
        },
        nb::arg("count"), nb::arg("marked").noconvert(), nb::arg("share"),
        "Return corners (M, 4), sums and numbers (M,) of the marked pixels of each group.");
}

void bind_memory(nb::module_& module) {
    module.def(
        "cloud_extents",
        [](MarkedColumns columns, std::size_t names) {
            const Marked marked = marked_of(columns);
            Buffer<double> extents(4 * names);
            Buffer<std::int64_t> sizes(names);
            {
                const Release release;
                check_marked(marked, names);
                cloud_extents(marked, names, extents.data.get(), sizes.data.get());
            }
            return std::pair(handed_over(std::move(extents), names, 4), handed_over(std::move(sizes)));
        },
        nb::arg("marked").noconvert(), nb::arg("names"),
        "Return left, top, right, bottom (names, 4) of the pixels of each cloud, and their number (names,).");
    module.def(
        "count_inside",
        [](MarkedColumns columns, In2<double> boxes, In2<double> around, std::size_t names) {
            const Marked marked = marked_of(columns);
            const std::span<const Box> own = boxes_of(boxes), large = boxes_of(around);
            check_lengths({own.size(), large.size()});
            Buffer<std::int64_t> inside(names * own.size()), near(names * own.size()), count(names);
            {
                const Release release;
                check_marked(marked, names);
                for (auto* buffer : {&inside, &near, &count}) std::fill_n(buffer->data.get(), buffer->room, 0);
                count_inside(marked, own.data(), large.data(),
                             {inside.data.get(), near.data.get(), count.data.get(), own.size()});
            }
            return std::tuple(handed_over(std::move(inside), names, own.size()),
                              handed_over(std::move(near), names, own.size()), handed_over(std::move(count)));
        },
        nb::arg("marked").noconvert(), nb::arg("boxes").noconvert(), nb::arg("around").noconvert(), nb::arg("names"),
        "Return how many pixels of each cloud lie in each box and in the one around it (names, K), and in all.");
    module.def(
        "nearest_boxes",
        [](In2<double> places, In2<double> boxes) {
            check(places.shape(1) == 2, "places have two columns");
            const View2<const double> given = view2(places);
            const std::span<const Box> own = boxes_of(boxes);
            Buffer<std::int64_t> found(given.rows);
            {
                const Release release;
                nearest_boxes(given, own, found.data.get());
            }
            return handed_over(std::move(found));
        },
        nb::arg("places").noconvert(), nb::arg("boxes").noconvert(),
        "Return which box (N,) each place belongs to: distances in halves of a box, so that 1 is its edge.");
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

void bind_picture_detector(nb::module_& module) {
    module.def(
        "middle_and_spread",
        [](In3<std::uint8_t> pictures) {
            check(pictures.shape(0) > 0, "a median of nothing");
            const std::size_t height = pictures.shape(1), width = pictures.shape(2);
            const View2<const std::uint8_t> given{pictures.data(), pictures.shape(0), height * width};
            Buffer<double> middle(given.columns);
            Buffer<float> spread(given.columns);
            {
                const Release release;
                middle_and_spread(given, middle.data.get(), spread.data.get());
            }
            return std::pair(handed_over(std::move(middle), height, width),
                             handed_over(std::move(spread), height, width));
        },
        nb::arg("pictures").noconvert(),
        "Return the median (H, W) of pictures (N, H, W), and the median of the deviations from it.");
    module.def(
        "usual_difference",
        [](In2<std::uint8_t> grey, In2<std::uint8_t> background) {
            check(grey.shape(0) == background.shape(0) && grey.shape(1) == background.shape(1),
                  "a picture is of the size of its background");
            const auto given = view2(grey), before = view2(background);
            const Release release;
            return usual_difference(given, before);
        },
        nb::arg("grey").noconvert(), nb::arg("background").noconvert(),
        "Return the median difference of a picture (H, W), without its fraction, and the median deviation from it.");
    module.def(
        "mark_different",
        [](In2<std::uint8_t> grey, In2<std::uint8_t> background, std::int32_t brighter, std::int32_t limit,
           In2<std::int16_t> limits) {
            check_lengths({grey.size(), background.size(), limits.size()});
            check(std::abs(brighter) <= GREY, "two pictures differ by at most 255 grey levels");
            const auto given = span(grey), before = span(background);
            const auto own = span(limits);
            Buffer<std::uint8_t> marks(grey.size());
            const std::int64_t number = [&] {
                const Release release;
                return mark_different(given, before, brighter, limit, own, marks.data.get());
            }();
            return std::pair(handed_over(std::move(marks), grey.shape(0), grey.shape(1)), number);
        },
        nb::arg("grey").noconvert(), nb::arg("background").noconvert(), nb::arg("brighter"), nb::arg("limit"),
        nb::arg("limits").noconvert(),
        "Mark the pixels (H, W) that differ by more than both limits; also return how many do.");
}

template <class Mark> void bind_collecting(nb::module_& module) {
    module.def(
        "collect_marked",
        [](In2<std::uint64_t> bits, In2<Mark> marks) {
            check(bits.shape(0) == marks.shape(0), "bits and marks have the same rows");
            const Bits given = view2(bits);
            const auto own = view2(marks);
            auto found = [&] {
                const Release release;
                return collect_marked<Mark>(given, own);
            }();
            return std::tuple(handed_over(std::move(found.x)), handed_over(std::move(found.weight)),
                              handed_over(std::move(found.start)), found.total);
        },
        nb::arg("bits").noconvert(), nb::arg("marks").noconvert(),
        "Return columns and marks (P,) of marked pixels, where rows begin (H + 1,), and the sum of the marks.");
}

void bind_linking(nb::module_& module) {
    bind_collecting<std::uint8_t>(module);
    bind_collecting<std::uint16_t>(module);
    bind_collecting<std::int32_t>(module);
    module.def(
        "link_marked",
        [](In2<std::uint64_t> bits, Whole x, Whole weight, In<std::int64_t> start, std::int32_t link, double least) {
            check(link >= 1, "the gap is at least 1 px");
            check(bits.shape(1) >= 1, "a row of a picture has at least one word");
            check_lengths({x.size(), weight.size()});
            check_lengths({start.size(), bits.shape(0) + 1});
            const Bits given = view2(bits);
            const auto columns = span(x), marks = span(weight);
            const auto rows = span(start);
            check(rows.front() == 0 && rows.back() == static_cast<std::int64_t>(x.size()) &&
                      std::is_sorted(rows.begin(), rows.end()),
                  "rows begin one after the other");
            auto found = [&] {
                const Release release;
                return link_marked(given, columns, marks, rows, link, least);
            }();
            return std::tuple(found.count, handed_over(std::move(found.x)), handed_over(std::move(found.y)),
                              handed_over(std::move(found.group)), handed_over(std::move(found.weight)));
        },
        nb::arg("bits").noconvert(), nb::arg("x").noconvert(), nb::arg("weight").noconvert(),
        nb::arg("start").noconvert(), nb::arg("link"), nb::arg("least"),
        "Return the number of groups with enough weight; columns, rows, groups and marks of their pixels.");
}

}  // namespace

void bind(nb::module_& module) {
    bind_background(module);
    bind_components(module);
    bind_linking(module);
    bind_memory(module);
    bind_noise(module);
    bind_picture_detector(module);
    bind_windows(module);
}

}  // namespace jeat::detection
