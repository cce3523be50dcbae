"""Tables of other trackers' results: a time or a frame, an identity and a box in each row."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.column_names import BOX, standing_in
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import ASIDE
from jeat_graph.io.box_rows import FileBoxes
from jeat_graph.io.column_names import boxes_of, classes_of, of_one_video, times_of
from jeat_graph.io.reading import Reading
from jeat_graph.io.tables import read_table

#: What is said of boxes without identities.
NO_IDENTITIES = "has no identities (a column or field such as track_id); are these detections?"
#: Columns that such a table has.
RESULT_COLUMNS = ("t", "object_id", *BOX)


def read_result_table(path: str | Path, how: Reading) -> FileBoxes:
    """Read a table; a row without identity and box only says that a frame was looked at, and is passed over.

    Rows without an identity alone are boxes that the tracker has not given one yet; they are passed over too.

    Raises:
        DataError: names the file, the line or row, and what is wrong.
    """
    try:
        whole = read_table(path, RESULT_COLUMNS, ("score", *ASIDE), short=("t",), aliases=True)
    except DataError as error:
        if not error.message.startswith("column 'object_id' is missing"):
            raise
        raise DataError(NO_IDENTITIES, error.path, error.line) from None
    table = of_one_video(whole, how)
    times = times_of(table, how)
    table.bare(standing_in(table.names, BOX), "a frame without tracks has only t")
    rows = np.flatnonzero(~table.blank("object_id"))
    boxes, ids, classes = boxes_of(table), table.whole("object_id", blank_ok=True), classes_of(table, how)
    scores = table.number("score", blank_ok=True) if "score" in table else np.ones(len(ids))
    missing = np.isnan(boxes[rows]).any(axis=1)
    if missing.any():
        raise table.error(int(rows[int(np.argmax(missing))]), "a track needs a box")
    return FileBoxes(
        t=times.t[rows],
        boxes=np.ascontiguousarray(boxes[rows]),
        error=lambda row, message: table.error(int(rows[row]), message),
        recorded=lambda: np.unique(times.t),
        scores=np.where(np.isnan(scores), 1.0, scores)[rows],
        ids=ids[rows],
        classes=None if classes is None else classes[rows],
        first=times.first,
    )
