"""What lies beside a run: the files that a run directory may lead to.

A run may have come from somebody else, with links and paths in it. What it leads to is opened only where it
lies near the run, links resolved; anything else the user has to name.
"""

from __future__ import annotations

from pathlib import Path

from jeat_graph.data.errors import DataError

#: A file is beside a run if it lies below the folder so many levels above it.
MOST_UP = 2


def lies_beside(path: str | Path, folder: str | Path) -> bool:
    """Whether a file lies in a folder, or below one of those just above it, with all links resolved.

    What is hidden there (`.ssh`) does not count, nor does what has only the root in common with the folder.

    Args:
        path: the file.
        folder: of the run.
    """
    try:
        place, home = Path(path).resolve(), Path(folder).resolve()
    except (OSError, RuntimeError, ValueError):  # links in a circle
        return False
    for above in (home, *home.parents)[: MOST_UP + 1]:
        if above.parent != above and place.is_relative_to(above):
            return not any(part.startswith(".") for part in place.relative_to(above).parts)
    return False


def check_beside(path: str | Path, folder: str | Path) -> None:
    """Refuse a file of a run that is a link out of it.

    Raises:
        DataError: it lies elsewhere.
    """
    if Path(path).is_symlink() and not lies_beside(path, folder):
        raise DataError("is a link to a file elsewhere; name that file itself if it is to be read", path)
