"""Tables of tracks: a run's own, and results of other trackers, which have boxes with identities alone."""

from __future__ import annotations

import graphlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray, TextArray
from jeat_graph.data.class_columns import class_column
from jeat_graph.data.column_names import BOX, MEAN, SIZE_VAR, VAR, standing_in, usual_names
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import ASIDE, collected, labels_of
from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.tables.columns import boxes_of, classes_of, of_one_video, times_of
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.frame_table import table_of_frame
from jeat_graph.data.tables.reading import Reading

#: Columns that a run's table must have, and those of classes, sizes and identities, which not all have.
COLUMNS = ("t", "track_id", *BOX, "existence", *MEAN, *VAR, "sensors")
RUN_CLASSES = ("class", "class_probability")
RUN_IDENTITIES = ("causal_id", "identity_probability")
MORE_COLUMNS = (*RUN_CLASSES, *SIZE_VAR, *RUN_IDENTITIES)
#: Columns of another tracker's result, or others that can stand for them, and those that it may have.
RESULT_COLUMNS = ("t", "object_id", *BOX)
MORE_RESULT_COLUMNS = ("score", *ASIDE)
#: The message about boxes without identities.
NO_IDENTITIES = (
    "has no identities (a column or field such as track_id); if these are detections, run `jeat-graph track` "
    "on them first and give the run directory that it writes"
)
#: Joins the names of sensors in their column.
JOINT = "|"
_MOST_SENSORS = 63  # bits of `Trajectories.used`


class ResultRows(NamedTuple):
    """Rows of another tracker's result.

    Attributes:
        rows: (R,) which rows of the table these are.
        t: (R,) s.
        ids: (R,) identities.
        boxes: (R, 4) left, top, width, height (px).
        scores: (R,) as the table has them; 1 where it has none.
        classes: (R,) names, empty where unknown; or None.
        recorded: (T,) all times at which the table says that it was looked (s).
        frames: the frame numbers where the table counts frames, else None.
    """

    rows: IntArray
    t: FloatArray
    ids: IntArray
    boxes: FloatArray
    scores: FloatArray
    classes: TextArray | None
    recorded: FloatArray
    frames: FrameCount | None


def is_result(names: Sequence[str]) -> bool:
    """Whether a table is another tracker's: it has boxes, and nothing that only our own tables have.

    Args:
        names: of its columns, as readers know them.
    """
    boxes = set(standing_in(names, BOX)) <= set(names)
    return boxes and not {"existence", "sensors", *VAR} & set(names)


def rows_of_result(table: FileTable, how: Reading, names: Mapping[int, str] | None) -> ResultRows:
    """Read a result; a row without identity and box only says that a frame was looked at, and is passed over.

    Rows without an identity alone are boxes that the tracker has not given one yet; they are passed over too.

    Raises:
        DataError: names the row and what is wrong.
    """
    table = of_one_video(table, how)
    times = times_of(table, how)
    table.bare(standing_in(table.names, BOX), "a frame without tracks has only t")
    rows = np.flatnonzero(~table.blank("object_id"))
    boxes, ids, classes = boxes_of(table), table.whole("object_id", blank_ok=True), classes_of(table, names)
    scores = table.number("score", blank_ok=True) if "score" in table else np.ones(len(ids))
    missing = np.isnan(boxes[rows]).any(axis=1)
    if missing.any():
        raise table.error(int(rows[int(np.argmax(missing))]), "a track needs a box")
    return ResultRows(
        rows,
        times.t[rows],
        ids[rows],
        np.ascontiguousarray(boxes[rows]),
        np.where(np.isnan(scores), 1.0, scores)[rows],
        None if classes is None else classes[rows],
        np.unique(times.t),
        times.count,
    )


def bare_fields(
    t: FloatArray, ids: IntArray, boxes: FloatArray, scores: FloatArray, classes: TextArray | None
) -> dict[str, Any]:
    """Return the fields of `Trajectories` for tracks that come as boxes alone, without motion or variances.

    The mean is the box's centre at rest, the variances are NaN. A score in [0, 1] is the existence, any other
    counts as 1.

    Args:
        t: (N,) s.
        ids: (N,) identities.
        boxes: (N, 4) left, top, width, height (px).
        scores: (N,).
        classes: (N,) names, or None.
    """
    n = len(t)
    mean = np.zeros((n, 6))
    mean[:, :2] = boxes[:, :2] + boxes[:, 2:] / 2
    return {
        "t": t,
        "track_id": ids,
        "boxes": boxes,
        "existence": np.where((scores >= 0) & (scores <= 1), scores, 1.0),
        "mean": mean,
        "var": np.full((n, 6), np.nan),
        "used": np.zeros(n, dtype=np.int64),
        **class_column(classes, None),
    }


def run_fields(table: FileTable) -> dict[str, Any]:
    """Return the fields of `Trajectories` that a run's own table says.

    Raises:
        DataError: names the row and what is wrong.
    """
    text = table.text("sensors", blank_ok=True)
    distinct, index = np.unique(text, return_inverse=True)
    sensors = _sensor_order(distinct.tolist())
    if len(sensors) > _MOST_SENSORS:
        raise DataError(f"names {len(sensors)} sensors; at most {_MOST_SENSORS} can be kept", table.path)
    bit = {name: 1 << k for k, name in enumerate(sensors)}
    mask = [sum(bit[name] for name in set(words.split(JOINT)) if name) for words in distinct.tolist()]
    stated = all(name in table for name in SIZE_VAR)
    return {
        "t": table.number("t"),
        "track_id": table.whole("track_id"),
        "boxes": _stack(table, BOX),
        "existence": table.number("existence"),
        "mean": _stack(table, MEAN),
        "var": _variances(table, VAR),
        "size_var": _variances(table, SIZE_VAR) if stated else np.full((len(table), 2), np.nan),
        "used": np.asarray(mask, dtype=np.int64)[index.reshape(-1)],
        "sensors": sensors,
        **_classes_of(table),
        **_identities_of(table),
    }


def _identities_of(table: FileTable) -> dict[str, Any]:
    if not all(name in table for name in RUN_IDENTITIES):
        return {}
    causal, probability = RUN_IDENTITIES
    return {causal: table.whole(causal), probability: table.number(probability)}


def check_tracks(error: Callable[[int, str], DataError], fields: Mapping[str, Any]) -> None:
    """Refuse rows that are no tracks: negative sizes, no probability, a track twice at one time.

    Args:
        error: makes an error that names the place of a row (from 0).
        fields: of `Trajectories`, of these rows.

    Raises:
        DataError: names the first row at fault.
    """
    boxes, existence, t, ids = (fields[name] for name in ("boxes", "existence", "t", "track_id"))
    negative = (boxes[:, 2:] < 0).any(axis=1)
    if negative.any():
        row = int(np.argmax(negative))
        raise error(row, f"width and height must not be negative, got {boxes[row, 2:].tolist()}")
    outside = (existence < 0) | (existence > 1)
    if outside.any():
        row = int(np.argmax(outside))
        raise error(row, f"existence must be in [0, 1], got {existence[row]:g}")
    order = np.lexsort((np.arange(len(t)), ids, t))
    same = (np.diff(t[order]) == 0) & (np.diff(ids[order]) == 0)
    if same.any():
        row = int(order[1:][same].min())
        raise error(row, f"track {ids[row]} is there twice at t = {t[row]:g}")


def fields_of_frame(
    frame: Any, how: Reading, names: Mapping[int, str] | None
) -> tuple[dict[str, Any], FrameCount | None]:
    """Return the fields of `Trajectories` that a data frame says: a run's table, or another tracker's result.

    With them come the frame numbers of one that counts frames.

    Args:
        frame: the data frame.
        how: what a result does not say itself.
        names: of classes by number, or None.

    Raises:
        DataError: a column is missing, or a row (from 0) is no track.
    """
    frame = collected(frame)
    if is_result(usual_names(labels_of(frame), RESULT_COLUMNS)):
        table = table_of_frame(frame, RESULT_COLUMNS, MORE_RESULT_COLUMNS, "tracks")
        found = rows_of_result(table, how, names)
        fields = bare_fields(found.t, found.ids, found.boxes, found.scores, found.classes)
        check_tracks(lambda row, message: table.error(int(found.rows[row]), message), fields)
        return fields, found.frames
    table = table_of_frame(frame, COLUMNS, MORE_COLUMNS, "trajectories")
    fields = run_fields(table)
    check_tracks(table.error, fields)
    return fields, None


def _stack(table: FileTable, names: Iterable[str]) -> FloatArray:
    return np.stack([table.number(name) for name in names], axis=1)


def _variances(table: FileTable, names: tuple[str, ...]) -> FloatArray:
    return np.stack([table.number(name, blank_ok=True, nan_ok=True) for name in names], axis=1)


def _classes_of(table: FileTable) -> dict[str, Any]:
    if "class" not in table:
        return {}
    share = None
    if "class_probability" in table:
        share = table.number("class_probability", blank_ok=True, nan_ok=True)
    return class_column(table.text("class", blank_ok=True), share)


def _sensor_order(texts: Iterable[str]) -> tuple[str, ...]:
    """Find an order of the sensors that agrees with each text, so that writing gives the same texts again."""
    after: dict[str, set[str]] = {}
    for text in texts:
        names = [name for name in text.split(JOINT) if name]
        for k, name in enumerate(names):
            after.setdefault(name, set()).update(names[k - 1 : k])
    ordered = {name: sorted(after[name]) for name in sorted(after)}
    try:
        return tuple(graphlib.TopologicalSorter(ordered).static_order())
    except graphlib.CycleError:
        return tuple(ordered)
