"""Truth from data frames, with the columns of `gt.csv`."""

from __future__ import annotations

from typing import Any, Unpack

from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.tables.frame_table import table_of_frame
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.tables.truth_table import OPTIONAL, REQUIRED, truth_of_table
from jeat_graph.data.trajectories import GroundTruth


def truth_of_frame(frame: Any, **options: Unpack[ReadingOptions]) -> GroundTruth:
    """Read truth from a data frame as `read_truth` reads a file of the same columns.

    Args:
        frame: `t` (s, or dates) or frame numbers, `object_id` (whole numbers), a box as in detections; where
            there are such `x, y, vx, vy, ax, ay`, `class`, `ignore` and `distance`. A row with only `t` is a
            time without objects.
        options: what the frame does not say itself, as `tables.reading.Reading` has it.

    Raises:
        DataError: a column is missing, or a row (from 0) is no object; the message names it.
    """
    return truth_of_frame_counted(frame, Reading(**options))[0]


def truth_of_frame_counted(frame: Any, how: Reading) -> tuple[GroundTruth, FrameCount | None]:
    """Read truth as `truth_of_frame` does, and tell the frame numbers of one that counts frames."""
    return truth_of_table(table_of_frame(frame, REQUIRED, OPTIONAL, "true boxes"), how, how.listed_classes())
