"""The input files of a run: written down when it is made, found again when it is looked at from elsewhere."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.beside import lies_beside

# An input that was moved along is looked for so far up from the run, by so many last parts of its path.
_MOST_UP, _MOST_PARTS = 4, 4


def describe_inputs(paths: Sequence[str | Path]) -> list[dict[str, Any]]:
    """Return path as given, absolute path, size in bytes and SHA-256 of each input file.

    Raises:
        DataError: a file cannot be read.
    """
    from jeat_graph.io.files.hashing import sha256_of, size_of

    return [
        {
            "path": str(p),
            "absolute": str(Path(p).resolve()),
            "bytes": size_of(p),
            "sha256": sha256_of(p),
        }
        for p in paths
    ]


def check_distinct(items: Sequence[str | Path]) -> None:
    """Refuse a file that is given twice: its boxes would be taken for two scans of one sensor.

    Two sensors may have files of one content, such as empty ones, where `NAME=path` tells them apart.

    Args:
        items: paths, or `NAME=path`, as `read_many` takes them.

    Raises:
        DataError: names the file, and the other where it is a copy.
    """
    from jeat_graph.io.files.hashing import sha256_of
    from jeat_graph.io.tables.detections_io import split_name

    found = [_Given.of(name, Path(path)) for name, path in map(split_name, items)]
    # Each file is asked for its place and size once, and read only beside another of its size.
    sha256 = functools.cache(sha256_of)
    for one, two in itertools.combinations(found, 2):
        path, other = one.path, two.path
        if one.place == two.place:
            raise DataError("is given twice: give each file of detections once", other)
        same_size = one.size == two.size and one.size > 0
        if one.name == two.name and same_size and sha256(path) == sha256(other):
            raise DataError(
                f"holds the same as {path}: give each file of detections once, or, if two sensors saw just "
                "the same, name them: NAME=path",
                other,
            )


class _Given(NamedTuple):
    """A file as it was given, where that is, and its size in bytes, 0 where there is no such file."""

    name: str | None
    path: Path
    place: Path
    size: int

    @staticmethod
    def of(name: str | None, path: Path) -> _Given:
        return _Given(name, path, path.resolve(), path.stat().st_size if path.is_file() else 0)


def find_input(given: str | Path, record: Mapping[str, Any], folder: Path) -> Path | None:
    """Find an input of a run where it was, or where it lies now, by its SHA-256, if that is beside the run.

    The record may be a stranger's: what it names elsewhere is not even looked at.

    Args:
        given: the path as it was given.
        record: what `describe_inputs` said of the file.
        folder: of the run.

    Returns:
        The first file that is the input; else one at its place that has changed since; None without either.

    Raises:
        DataError: there is such a file, but it does not lie beside the run.
    """
    from jeat_graph.io.files.hashing import sha256_of, size_of

    # A folder of labels is an input, too.
    found = [place for place in dict.fromkeys(_places(Path(given), record, folder)) if place.exists()]
    there = [place for place in found if lies_beside(place, folder)]
    if found and not there:
        raise DataError(
            "does not lie beside the run that names it: name it with --detections, or track with "
            "--diagnostics, which keeps in the run what is needed",
            given,
        )
    same = (place for place in there if size_of(place) == record.get("bytes", size_of(place)))
    return next(
        (place for place in same if sha256_of(place) == record.get("sha256")), there[0] if there else None
    )


def _places(given: Path, record: Mapping[str, Any], folder: Path) -> Iterator[Path]:
    yield given
    absolute = Path(record.get("absolute", given))
    yield absolute
    parts = absolute.parts
    above = [folder.resolve(), *folder.resolve().parents][: _MOST_UP + 1]
    for count in range(min(len(parts), _MOST_PARTS), 0, -1):
        for place in above:
            yield place.joinpath(*parts[-count:])
