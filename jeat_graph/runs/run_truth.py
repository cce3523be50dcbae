"""The truth of a run that was tracked before: its frames count as those of the run's input did."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.rates import ANY_RATE_HZ
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.together import Reader, read_together
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.load import counted_as_run
from jeat_graph.eval.motion_units import motion_in_picture
from jeat_graph.io.formats.registry import recognise
from jeat_graph.io.tables.truth_io import read_truth_counted
from jeat_graph.runs.beside import recorded_frames


def read_truth_of_run(
    truth: str | Path,
    run: str | Path,
    counted: FrameCount | None = None,
    **options: Unpack[ReadingOptions],
) -> GroundTruth:
    """Read truth, its first frame decided together with that of a run's input.

    Args:
        truth: the truth, in any format that `read_truth` knows.
        run: the run directory, or a result.
        counted: the frame numbers of a result that counts frames, as it was read.
        options: what the truth does not say itself, as `tables.reading.Reading` has it.

    Raises:
        DataError: names the file, the line or row, and what is wrong.
    """
    how = Reading(**options)
    own = recorded_frames(run) if counted is None else counted
    readers: list[Reader[Any]] = [
        Reader(str(truth), lambda first: read_truth_counted(truth, None, replace(how, first_frame=first))),
        Reader(str(run), lambda _: (None, own), settled=True),
    ]
    (objects, _), counts = read_together(readers, how.first_frame, truth=0)
    rate_hz = how.rate_hz or recognise(truth).rate_hz or ANY_RATE_HZ
    return motion_in_picture(counted_as_run(objects, own, counts[1], rate_hz), str(truth))
