"""Names of classes that a file says by number: from the user, or from a list that lies beside the file.

Numbers mean different things in different files (`3` is a car to one detector, a motorcycle to the next), so
that without a list they stay numbers. A list counts from 1 for MOTChallenge text (as CVAT writes it), from 0
for everything else; a mapping in YAML says the numbers itself.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from jeat_graph.data.class_columns import listed_names
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.limits import check_file

ClassNames: TypeAlias = str | Path | Sequence[str] | Mapping[int, str]

#: Lists of names that tools leave beside their files, one name a line: CVAT's, then YOLO's.
LISTS = ("labels.txt", "classes.txt", "obj.names")
_YAML = (".yaml", ".yml")
# No list of classes is larger (bytes).
_LARGEST = 1 << 20


def names_by_number(given: ClassNames | None, beside: str | Path | None, first: int) -> dict[int, str] | None:
    """Return the names of classes by number; None where nobody says them.

    Args:
        given: what the user gives: names in order, by number, or a file of them.
        beside: the file with the numbers, if there is one; without `given` its folder is searched for a list.
        first: number of the first name of a list.

    Raises:
        DataError: a list that cannot be read.
    """
    if given is not None and not isinstance(given, str | Path):
        return listed_names(given, first)
    if given is None:
        given = None if beside is None else _list_beside(Path(beside))
        return None if given is None else _read(Path(given), first)
    if os.path.exists(given):  # unlike Path's, it takes any text, however long
        return _read(Path(given), first)
    if "," in str(given):
        return dict(enumerate((name.strip() for name in str(given).split(",")), first))
    raise DataError("no such file; names of classes themselves have commas between them: car,truck", given)


def _list_beside(path: Path) -> Path | None:
    folder = path if path.is_dir() else path.parent
    found = next((folder / name for name in LISTS if (folder / name).is_file()), None)
    return None if found == path else found


def lines_of_names(text: str) -> list[str]:
    """Return the names that stand one a line; lines without a name at the end do not count."""
    return [line.strip() for line in text.removeprefix("\ufeff").rstrip().splitlines()]


def _read(path: Path, first: int) -> dict[int, str]:
    check_file(path)
    if path.stat().st_size > _LARGEST:
        raise DataError("is no list of classes: too large", path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise DataError(f"cannot be read as a list of classes: {str(error)[:100]}", path) from None
    if path.suffix.lower() not in _YAML:
        return dict(enumerate(lines_of_names(text), first))
    return _of_yaml(text, path, first)


def _of_yaml(text: str, path: Path, first: int) -> dict[int, str]:
    import yaml

    try:
        content: Any = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise DataError(f"is not YAML: {' '.join(str(error).split())[:200]}", path) from None
    names = content.get("names") if isinstance(content, dict) else None
    if isinstance(names, list):
        return dict(enumerate(map(str, names), first))
    if isinstance(names, dict) and all(isinstance(number, int) for number in names):
        return {number: str(name) for number, name in names.items()}
    raise DataError("must hold `names`: a list, or a mapping from numbers, as in YOLO's data.yaml", path)
