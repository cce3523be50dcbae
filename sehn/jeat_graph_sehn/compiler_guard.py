"""Keeps the compiler from running what strangers left for it, and from stumbling over a damaged cache.

The compiler (numba) reads settings from the current folder, where the user's data lie, and one of them says
where machine code is kept; and it runs what it finds there, whoever wrote it. What is empty, cut off or
garbage there would end the program. So settings come from the environment alone, a file that others could
have written is as good as none, and what cannot be read is compiled again.
"""

from __future__ import annotations

import contextlib
import os
import stat
import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

from jeat_graph.data.private_folder import open_to_others

_CACHING = "numba.core.caching"
_WRITE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def guard_compiler() -> None:
    """Guard the compiler from the moment on when it is loaded, or now if it is there already."""
    loaded = sys.modules.get(_CACHING)
    if loaded is not None:
        _guard(loaded)
    elif not any(isinstance(finder, _CompilerFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _CompilerFinder())


def is_as_sources(path: Path, sources: Path) -> bool:
    """Whether nobody can write a file or folder who cannot write the package's sources as well.

    Args:
        path: what is asked about.
        sources: a folder of the package.
    """
    if not hasattr(os, "getuid"):
        return True
    try:
        found, there = path.stat(), sources.stat()
    except OSError:
        return False
    if found.st_uid not in (os.getuid(), 0, there.st_uid):
        return False
    more = found.st_mode & ~there.st_mode & _WRITE_BY_OTHERS
    return not more or not open_to_others(found)


class _CompilerFinder(MetaPathFinder):
    """Finds the compiler's module for what it keeps, as everybody does, and guards it once it is loaded."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != _CACHING:
            return None
        with contextlib.suppress(ValueError):
            sys.meta_path.remove(self)
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = _CompilerLoader(spec.loader)
        return spec


class _CompilerLoader(Loader):
    """Loads a module as another loader does, then guards it."""

    def __init__(self, loader: Loader) -> None:
        self._loader = loader

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        self._loader.exec_module(module)
        _guard(module)


def _guard(caching: ModuleType) -> None:
    """Have the compiler's cache and its settings treated as is said above."""
    file: Any = caching.IndexDataCacheFile
    if getattr(file._load_index, "guarded", False):
        return
    _without_settings_of_folder()
    load_index, load_data = file._load_index, file._load_data
    sources = Path(__file__).parent

    def index(cache: Any) -> Any:
        try:
            return load_index(cache) if is_as_sources(Path(cache._index_path), sources) else {}
        except Exception:  # whatever unpickling garbage may raise
            return {}

    def data(cache: Any, name: str) -> Any:
        path = Path(cache._data_path(name))
        if not is_as_sources(path, sources):
            raise OSError(f"{path}: others can write it, or it is not there")
        try:
            return load_data(cache, name)
        except Exception as error:
            raise OSError(f"{path}: is damaged: {error}") from None  # it is compiled again

    index.guarded = True  # type: ignore[attr-defined]
    file._load_index, file._load_data = index, data


def _without_settings_of_folder() -> None:
    """Take the compiler's settings from the environment alone, not from a file in the current folder."""
    config: Any = sys.modules["numba.core.config"]
    name = getattr(config, "_config_fname", "")
    if name:
        found = os.path.exists(name)
        config._config_fname = ""
        if found:
            config.reload_config()
