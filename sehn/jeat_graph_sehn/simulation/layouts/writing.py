"""Writes a simulated set in another layout: a folder that appears when it is whole."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.layouts.dsec_det import write_dsec_det, write_split
from jeat_graph_sehn.simulation.layouts.rvt import write_rvt
from jeat_graph_sehn.simulation.layouts.rvt_input import write_rvt_input
from jeat_graph_sehn.simulation.layouts.sets import open_set
from jeat_graph_sehn.whole_folder import whole_folder

LAYOUTS = {"rvt": write_rvt, "rvt-input": write_rvt_input, "dsec-det": write_dsec_det}


class LayoutWritten(NamedTuple):
    """What was written.

    Attributes:
        segments: how many.
        without_boxes: segments that were left out, for nothing in them is asked for.
    """

    segments: int
    without_boxes: int


def write_layout(
    root: str | Path, layout: str, out: str | Path, on_segment: Callable[[], object] = lambda: None
) -> LayoutWritten:
    """Write a set that `simulate --sensors pictures` made in another layout.

    Args:
        root: the set's folder.
        layout: `rvt`, `rvt-input` or `dsec-det`.
        out: folder to write; must not be there yet, or be empty.
        on_segment: called after each segment.

    Raises:
        ConfigError: no such layout.
        DataError: the set is not whole or does not fit the layout, or `out` cannot be written.
    """
    if layout not in LAYOUTS:
        raise ConfigError(f"layout: must be one of {', '.join(LAYOUTS)}, not {layout!r}")
    whole, written = open_set(root), 0
    with whole_folder(Path(out)) as folder:
        for split in ("train", "test") if layout == "dsec-det" else ("train", "val", "test"):
            (folder / split).mkdir()
        for segment in whole.segments:
            written += LAYOUTS[layout](segment, whole.size_px, folder)
            on_segment()
        if layout == "dsec-det":
            write_split(whole.segments, folder)
    return LayoutWritten(written, len(whole.segments) - written)
