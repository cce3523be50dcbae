"""Where compiled code is kept between runs: beside the sources, with the user, else in a temporary folder.

The compiler keeps its machine code beside the sources, or in the user's cache. A container may have neither:
an installation that cannot be written, and no home. Then the code is kept in a private folder for temporary
files, and where there is none of those either, it is compiled again in each run.
"""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

from jeat_graph.data.private_folder import is_private
from jeat_graph_sehn.compiler_guard import guard_compiler, is_as_sources
from jeat_graph_sehn.stale_kernels import drop_stale

_VARIABLE = "NUMBA_CACHE_DIR"
_PACKAGE = {"jeat_graph_sehn": Path(__file__).parent}
#: What is said of it before anything is compiled; empty where the code is kept where it always is.
notice = ""


def choose_cache() -> None:
    """Point the compiler to a folder that can be written, before any of the package's code is compiled.

    What the folder holds of an earlier state of the package is thrown away.
    """
    global notice
    guard_compiler()
    if os.environ.get("NUMBA_CACHE_LOCATOR_CLASSES"):
        return
    if os.environ.get(_VARIABLE):
        drop_stale(_PACKAGE, Path(os.environ[_VARIABLE]))
        return
    sources = _PACKAGE["jeat_graph_sehn"]
    beside = sources / "__pycache__"
    open_beside = _takes_files(beside)
    if open_beside and is_as_sources(beside, sources):
        drop_stale(_PACKAGE)
        return
    folder = _user_cache()
    if _takes_files(folder) and is_private(folder):
        if open_beside:  # the compiler would take that first
            _keep_in(folder)
        drop_stale(_PACKAGE, folder)
        return
    temporary = _temporary_folder()
    if temporary is not None:
        _keep_in(temporary)
        notice = f"neither the installation nor a home can be written: compiled code is kept in {temporary}"
        drop_stale(_PACKAGE, temporary)
        return
    notice = "no folder can be written: the renderer is compiled again in each run; set NUMBA_CACHE_DIR"
    _compile_without_cache()


def _keep_in(folder: Path) -> None:
    """Have the compiler keep its code in a folder, here and in processes that this one starts."""
    from numba.core import config

    os.environ[_VARIABLE] = str(folder)
    config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]


def _user_cache() -> Path:
    """The folder that the compiler takes second, as it names it."""
    from numba.misc.appdirs import AppDirs

    return Path(AppDirs(appname="numba", appauthor=False).user_cache_dir)  # type: ignore[no-untyped-call]


def _takes_files(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _temporary_folder() -> Path | None:
    """Return a folder of this user's own, the same in every run; None if there cannot be one."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    try:
        folder = Path(tempfile.gettempdir()) / f"jeat-graph-sehn-kernels-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        # Machine code that anybody else could have put there must not be run.
        open_to_all = hasattr(os, "getuid") and bool(found.st_mode & 0o077)
        mine = stat.S_ISDIR(found.st_mode) and found.st_uid == user and not open_to_all
        return folder if mine and _takes_files(folder) else None
    except OSError:
        return None


def _compile_without_cache() -> None:
    from numba.core.dispatcher import Dispatcher

    Dispatcher.enable_caching = lambda self: None  # type: ignore[method-assign]
