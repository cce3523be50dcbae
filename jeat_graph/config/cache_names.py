"""Processes that compile at the same time save their machine code under names of their own."""

from __future__ import annotations

import uuid
from typing import Any


def save_under_own_names() -> None:
    """Have numba put a mark of this process into the names of the files it saves from now on.

    Two processes that compile one kernel for different arguments at the same moment take the same free name:
    the index of the one would lead to the code of the other. With own names what is lost, at worst, is an
    entry of the index, and that is compiled once more.
    """
    from numba.core import caching

    cache_file: Any = caching.IndexDataCacheFile
    named = cache_file._data_name
    if getattr(named, "own", False):
        return
    mark = uuid.uuid4().hex[:12]

    def data_name(cache: Any, number: int) -> str:
        stem, _, ending = str(named(cache, number)).rpartition(".")
        return f"{stem}.{mark}.{ending}"

    data_name.own = True  # type: ignore[attr-defined]
    data_name.__wrapped__ = named  # type: ignore[attr-defined]
    cache_file._data_name = data_name
