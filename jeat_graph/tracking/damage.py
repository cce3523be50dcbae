"""What goes wrong while something is made of a file's content, as an error that names the file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jeat_graph.data.errors import DataError, JeatGraphError


@contextmanager
def refusing_damage(path: str | Path) -> Iterator[None]:
    """Turn what goes wrong while a tracker is made of a file's content into an error that names the file.

    Raises:
        DataError: names the file.
    """
    try:
        yield
    except DataError as error:
        raise DataError(error.message, path) if error.path is None else error from None
    except JeatGraphError as error:
        raise DataError(f"is damaged: {error}", path) from None
    except Exception as error:  # what is missing or of another kind shows wherever it is used first
        raise DataError(f"is damaged: {type(error).__name__}: {error}", path) from None
