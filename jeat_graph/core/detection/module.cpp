// Binds the kernels of jeat_graph.detection: of marked pixels and pictures here, of events by `event_bindings`.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include "detection/components.hpp"
#include "detection/event_bindings.hpp"
#include "detection/linking.hpp"
#include "detection/memory.hpp"
#include "detection/picture_detector.hpp"

namespace jeat::detection {

namespace {

using MarkedColumns = std::tuple<Whole, Whole, Whole, Whole>;

Marked marked_of(const MarkedColumns& columns) {
    const auto& [x, y, group, weight] = columns;
    return {span(x), span(y), span(group), span(weight)};
}

std::span<const Box> boxes_of(const In2<double>& boxes) {
    check(boxes.shape(1) == 4, "boxes have four columns");
    return {reinterpret_cast<const Box*>(boxes.data()), boxes.shape(0)};
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
