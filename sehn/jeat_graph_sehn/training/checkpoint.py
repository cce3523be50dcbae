"""The state of a training in a file, so that one that was killed goes on where it was."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import torch

from jeat_graph.data.errors import DataError, OtherRunError
from jeat_graph.io.files.atomic import atomic_path

_IDENTITY = "identity"


def write_checkpoint(path: Path, identity: str, state: dict[str, Any]) -> None:
    """Write a state; the file is whole or the old one.

    Args:
        path: where to.
        identity: what is trained, on what, and how.
        state: tensors, numbers and texts.
    """
    with atomic_path(path) as temporary:
        torch.save({_IDENTITY: identity, **state}, temporary)


def read_checkpoint(path: Path, identity: str, device: str) -> dict[str, Any]:
    """Read a state.

    Raises:
        DataError: the file is damaged.
        OtherRunError: it is of another training.
    """
    try:
        state = torch.load(path, map_location=device, weights_only=True)
        there = state.pop(_IDENTITY)
    except (OSError, RuntimeError, EOFError, KeyError, ValueError, AttributeError, pickle.UnpicklingError):
        raise DataError("is damaged; remove it to start over", path) from None
    if there != identity:
        raise OtherRunError(
            f"{path}: is of a training with other data or settings; remove it, or give another --out"
        )
    return dict(state)
