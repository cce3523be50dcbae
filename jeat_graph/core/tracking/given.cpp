#include "tracking/given.hpp"

#include <cmath>
#include <span>

namespace jeat::tracking {

namespace {

// What is not known is NaN.
bool none_below_0(std::span<const double> values) {
    for (const double value : values)
        if (value < 0.0 || std::isinf(value)) return false;
    return true;
}

// The scan's own of what is given of all boxes, from the place `at` on.
void fill_scan(const Given& given, const State& state, std::size_t at, std::size_t number, Scan& scan) {
    const auto& [t, sensors, numbers, boxes, logits, similarity, motion, owners, box_std] = given;
    scan.boxes.clear(), scan.spreads.clear();
    for (std::size_t j = at; j < at + number; ++j) {
        const double* const box = boxes.data() + 4 * j;
        scan.boxes.push_back({box[0], box[1], box[0] + box[2], box[1] + box[3]});
        if (box_std)
            scan.spreads.push_back(filters::spread_squares(box_std->data() + 4 * j, box[2], box[3], state.constants));
    }
    scan.logits.assign(logits.data() + at, logits.data() + at + number);
    scan.similarity = {nullptr, 0, 0};
    if (similarity) scan.similarity = {similarity->data() + at, similarity->shape(0), similarity->shape(1)};
    scan.owners.clear(), scan.awaited.clear(), scan.later.clear();
    for (std::size_t j = at; owners && j < at + number; ++j) {
        scan.owners.push_back(static_cast<std::int64_t>(owners->data()[3 * j]));
        scan.awaited.push_back(owners->data()[3 * j + 1] > 0.0);
        scan.later.push_back(owners->data()[3 * j + 2]);
    }
}

}  // namespace

bool finite(std::span<const double> values) {
    for (const double value : values)
        if (!std::isfinite(value)) return false;
    return true;
}

void check_given(const Given& given, const State& state) {
    const auto& [t, sensors, numbers, boxes, logits, similarity, motion, owners, box_std] = given;
    check(std::isfinite(t), "no such time");
    check(!state.started || t >= state.t, "a time before that of the last step");
    check_lengths({sensors.size(), numbers.size()});
    check_lengths({boxes.shape(0), logits.size()});
    check(finite(span(boxes)) && finite(span(logits)), "boxes and logits are finite");
    check(boxes.shape(1) == 4, "boxes have four numbers");
    if (similarity) {
        check(similarity->shape(0) == state.tracks.size(), "another number of tracks is compared");
        check_lengths({similarity->shape(1), logits.size()});
        check(finite(span(*similarity)), "similarities are finite");
    }
    if (owners) {
        check_lengths({owners->shape(0), logits.size()});
        check(owners->shape(1) == 3, "owners are given with whether more of theirs are to come, and a posterior");
        check(finite(span(*owners)), "owners are finite");
    }
    if (box_std) {
        check_lengths({box_std->shape(0), logits.size()});
        check(box_std->shape(1) == 4, "spreads have four numbers");
        check(none_below_0(span(*box_std)), "spreads are not below 0");
    }
}

std::optional<PictureMotion> motion_of(const Given& given) {
    if (!given.motion) return std::nullopt;
    const In<double>& motion = *given.motion;
    check_lengths({motion.size(), kMotionNumbers});
    const PictureMotion moved = PictureMotion::of(motion.data());
    check(moved.span_s > 0.0 && finite(span(motion)), "a motion takes time");
    return moved;
}

void fill_scans(const Given& given, const State& state, std::vector<Scan>& scans) {
    const std::size_t boxes = given.logits.size();
    scans.resize(given.sensors.size());
    std::size_t at = 0;
    for (std::size_t k = 0; k < scans.size(); ++k) {
        const auto number = static_cast<std::size_t>(given.numbers.data()[k]);
        scans[k].sensor = static_cast<std::size_t>(given.sensors.data()[k]);
        check(scans[k].sensor < state.sensors.size(), "no such sensor");
        check(number <= boxes - at, "fewer boxes than said");
        fill_scan(given, state, at, number, scans[k]);
        at += number;
    }
    check(at == boxes, "more boxes than said");
}

}  // namespace jeat::tracking
