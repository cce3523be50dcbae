"""Masks of the vehicles in a simulated frame, as pictures of their identities."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.io.media.pictures import as_png
from jeat_graph_sehn.simulation.dataset.layout import MASKS


def write_mask(folder: Path, frame: int, mask: npt.NDArray[np.uint16], size_px: tuple[int, int]) -> None:
    """Write `masks/000000.png`, of 16 bit: the identity of the vehicle that each pixel shows, 0 for none.

    Args:
        folder: of the segment.
        frame: number of the frame.
        mask: (H, W) uint16 identities.
        size_px: width and height of the pictures.

    Raises:
        DataError: a mask of another size or type.
    """
    if mask.shape != size_px[::-1] or mask.dtype != np.uint16:
        raise DataError(f"mask must be {size_px[::-1]} uint16, not {mask.shape} {mask.dtype}")
    (folder / MASKS).mkdir(exist_ok=True)
    (folder / MASKS / f"{frame:06d}.png").write_bytes(as_png(mask))
