// Binds the tracker's step.
#include <limits>
#include <span>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "association/heaps.hpp"
#include "signals.hpp"
#include "tracking/columns.hpp"
#include "tracking/given.hpp"
#include "tracking/model.hpp"
#include "vectors.hpp"

namespace jeat::tracking {

namespace {

Out<std::int64_t> kept_boxes(In2<double> boxes, In<double> scores, const nb::object& constants) {
    check_lengths({boxes.shape(0), scores.size()});
    check(boxes.shape(1) == 4 && finite(span(boxes)) && finite(span(scores)), "boxes have four sides, and scores");
    const auto number = [&](const char* name) { return nb::cast<double>(constants.attr(name)); };
    const double on_one_spot = number("most_on_one_spot"), overlap = number("spot_overlap");
    const double touching = number("most_touching");
    const std::span<const Sides> sides(reinterpret_cast<const Sides*>(boxes.data()), boxes.shape(0));
    const auto kept = [&] {
        const nb::gil_scoped_release release;
        const HeedsSignals heeds;
        return association::kept_boxes(sides, span(scores), on_one_spot, overlap, touching);
    }();
    return array_of(kept);
}

}  // namespace

void bind(nb::module_& module) {
    module.def("kept_boxes", &kept_boxes, nb::arg("boxes").noconvert(), nb::arg("scores").noconvert(),
               nb::arg("constants"),
               "Places (K,) of the boxes (M, 4) left, top, right, bottom (px) with scores (M,) that count; see\n"
               "jeat_graph.association.heaps.");
    nb::class_<Record>(module, "Record", "What the filter did in a step, for the smoother.")
        .def(
            "track_ids", [](const Record& record) { return array_of(record.track_id); },
            "Identities of the tracks after it, before any ended (N,).")
        .def(
            "__deepcopy__", [](const Record& record, const nb::object&) { return new Record(record); }, nb::arg("memo"),
            "The same once more.")
        .def(
            "scans", [](const Record& record, const Model& model) { return scans_of(record, model.constants()); },
            nb::arg("model"),
            "Scan by scan, in the order they were taken in: index of the sensor (K,), number of tracks after it (K,),\n"
            "and of those among them that had been born before (K,); of these, one scan after the other, the transition (E, 49) from the record before, both axes in one, and mean\n"
            "(E, 14) and covariance (E, 98) before the update, and after it.")
        .def(
            "fields", &fields_of,
            "Time (s), whether all tracks had ended before; of the tracks (N,) their posterior, the sensors that found\n"
            "them, whether one of these confirms that they are there, the detections missed since, and whether they live on.")
        .def(
            "gaps", [](const Record& record) { return gaps_of(record.gaps); },
            "Gaps that outlasted each bin, and those that ended well (2, 9), before tracks ended.")
        .def("gaps_after", [](const Record& record) { return gaps_of(record.gaps_after); }, "The same after it.");
    nb::class_<Moment>(module, "Moment", "All that the next step depends on; the smoother is no part of it.")
        .def(
            "__deepcopy__", [](const Moment& moment, const nb::object&) { return new Moment(moment); }, nb::arg("memo"),
            "The same once more.")
        .def(
            "identities", [](const Moment& moment) { return array_of(moment.state.tracks.track_id); },
            "Identities of the living tracks (N,).")
        .def(
            "born", [](const Moment& moment) { return moment.state.next_id - 1; },
            "Number of tracks started before it.");
    nb::class_<Rows>(module, "Rows", "The tracks that a step reports.")
        .def("columns", &table, "As Model.rows has them, also after later steps.");
    nb::class_<Model>(module, "Model", "The tracker's state and its step; see jeat_graph.tracking.reference.")
        .def(nb::init<const nb::object&, double, double, bool, double>(), nb::arg("constants"), nb::arg("width"),
             nb::arg("height"), nb::arg("known"), nb::arg("lag_s"),
             "constants: a ModelConstants; width, height: of the picture (px), if known; lag_s: of the smoother (s),\n"
             "infinite for whole tracks, negative for none.")
        .def(
            "declare_sensor", exclusive(&Model::declare_sensor),
            nb::arg("even_logit") = std::numeric_limits<double>::quiet_NaN(),
            nb::arg("score_weight") = std::numeric_limits<double>::quiet_NaN(),
            nb::arg("lasting") = std::numeric_limits<double>::quiet_NaN(), nb::arg("stationary_prior") = nb::none(),
            "Add a sensor that has had no scan yet. even_logit: of the score at which a box is as likely real as not,\n"
            "NaN where it is to be learnt; score_weight: of its scores as evidence, NaN likewise; lasting: variance of what lasts of\n"
            "its errors (sizes²), NaN where it is to be learnt; stationary_prior: share of objects that it does not see while\n"
            "they stand, by what the sensor is.")
        .def(
            "take", exclusive(&Model::take), nb::arg("t"), nb::arg("sensors").noconvert(),
            nb::arg("numbers").noconvert(), nb::arg("boxes").noconvert(), nb::arg("logits").noconvert(),
            nb::arg("similarity").noconvert() = nb::none(), nb::arg("motion").noconvert() = nb::none(),
            nb::arg("owners").noconvert() = nb::none(), nb::arg("box_std").noconvert() = nb::none(),
            "Take in the scans of one time t (s): sensors (K,), numbers of boxes of each (K,), all boxes (M, 4) left,\n"
            "top, width, height (px), logits of their scores (M,); similarity (N, M): how much more likely each box is of a\n"
            "living track than of another by what both look like, as ln of the ratio; motion (11,): of the camera since\n"
            "its picture before, see jeat_graph.filters.picture_motion.PictureMotion; owners (M, 3): whose each box is,\n"
            "where that is given, below 0 for nobody's, at most one box of a scan each, and 1 where more of its owner's are\n"
            "to come, and the posterior of an object there by what comes later, for the smoother, below 0 where it is not\n"
            "known. A track of an owner takes no box but its own, and lives as long as it is awaited; box_std (M, 4): standard\n"
            "deviations of left, top, right, bottom by the detector (px), NaN where unknown.")
        .def("record", exclusive(&Model::record), "What the last step gave the smoother; once.")
        .def(
            "hand_over", exclusive(&Model::hand_over), nb::arg("record").none() = nb::none(),
            nb::arg("given").noconvert() = nb::none(), nb::arg("label").noconvert() = nb::none(),
            nb::arg("share").noconvert() = nb::none(),
            "Tell the smoother of a step (of the last one without a record), in order of time: the identity given out\n"
            "for each of its tracks (N,), the number of its class, below 0 for none, and the share of its votes.")
        .def("forget", exclusive(&Model::forget), nb::arg("track_id").noconvert(), nb::arg("until").noconvert(),
             "Have no smoothed rows of tracks, by ascending identities (K,), up to a time (K,) each (s).")
        .def("reset", exclusive(&Model::reset), nb::arg("t"),
             "End all tracks and go on from another time (s), as if none had passed; what was learnt stays.")
        .def("snapshot", exclusive(&Model::snapshot), "A copy of all that the next step depends on.")
        .def("restore", exclusive(&Model::restore), nb::arg("moment"), "Go back to a snapshot of this model.")
        .def("number_on_from", exclusive(&Model::number_on_from), nb::arg("identity"),
             "Give no new track a smaller identity.")
        .def("state", exclusive(&Model::state), nb::arg("moment").none() = nb::none(),
             "Everything as arrays by name, the smoother's too; that at a moment, if one is given.")
        .def("set_state", exclusive(&Model::set_state), nb::arg("state"),
             "Go on from what state() returned. ValueError: it is not what a model can be in; nothing is changed then.")
        .def("rows", exclusive(&Model::rows),
             "Reported tracks: t, identity, mean (N, 10), variance (N, 10), posterior, sensors, class, its share.")
        .def("reported", exclusive(&Model::reported), "What rows() returns, to be made columns when they are wanted.")
        .def("states", exclusive(&Model::states),
             "Their states: means (N, 14), and covariances (N, 98): two axes of 7 x 7.")
        .def("fit", exclusive(&Model::fit),
             "Of the boxes of the last step the squared distance of the centre (M,), NaN where it began a track, and\n"
             "the scale of the sensor's noise (M,); the posteriors (N,) of the tracks in living().")
        .def("identities", exclusive(&Model::identities), "Identities of the living tracks (N,).")
        .def("sensors", exclusive(&Model::sensors), "Number of sensors.")
        .def("time", exclusive(&Model::time), "Time of the last step (s); None before the first.")
        .def("picture", exclusive(&Model::picture), "Width and height of the picture (px), as far as is known.")
        .def("camera_moved", exclusive(&Model::camera_moved),
             "How far the camera's motion has taken a point at rest (2,) (px).")
        .def("last_scans", exclusive(&Model::last_scans), "Time of each sensor's last scan (s), NaN before it.")
        .def(
            "__deepcopy__",
            [](Model& model, const nb::object&) {
                const Exclusive::Hold hold(model.use);
                return new Model(model);
            },
            nb::arg("memo"), "A model of its own in the same state.")
        .def("assigned", exclusive(&Model::assigned),
             "Identity of the track that each box of the last step was assigned to (M,).")
        .def("living", exclusive(&Model::living), "Identities of the tracks of the last step, before any ended (N,).")
        .def("size", exclusive(&Model::size), "Number of living tracks.")
        .def("born", exclusive(&Model::born), "Number of tracks started so far.")
        .def("boxes_end_at_edge", exclusive(&Model::boxes_end_at_edge),
             "Whether boxes end at the edge of the picture more often than they reach beyond it.")
        .def("smoothed", exclusive(&Model::smoothed), "Smoothed rows so far, columns as those of rows.")
        .def("drain", exclusive(&Model::drain), "Smoothed rows that have become final; they are forgotten.")
        .def("finish", exclusive(&Model::finish), "The same, all tracks being ended.")
        .def("gaps", exclusive(&Model::gaps), "Gaps that outlasted each bin, and those that ended well (2, 9).")
        .def("learnt", exclusive(&Model::learnt), "What is believed of the sensors and the scene, by name.")
        .def("tracks", exclusive(&Model::tracks), "Columns of the living tracks, by name.");
}

}  // namespace jeat::tracking
