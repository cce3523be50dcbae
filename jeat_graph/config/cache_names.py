"""Processes that compile at the same time save their machine code under names of their own."""

from __future__ import annotations

import os
from typing import Any


def save_under_own_names() -> None:
    """Have numba put the number of the process into the names of the files it saves.

    Two processes that compile one kernel for different arguments at the same moment take the same free name:
    the index of the one would lead to the code of the other. With own names what is lost, at worst, is an
    entry of the index, and that is compiled once more.
    """
    from numba.core import caching

    cache_file: Any = caching.IndexDataCacheFile
    named = cache_file._data_name
    if getattr(named, "of_process", False):
        return

    def data_name(cache: Any, number: int) -> str:
        stem, _, ending = str(named(cache, number)).rpartition(".")
        return f"{stem}.{os.getpid()}.{ending}"

    data_name.of_process = True  # type: ignore[attr-defined]
    cache_file._data_name = data_name
