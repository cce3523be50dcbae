"""What kind of vehicle each row of a table is: a column of class names, and one of how sure they are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, TextArray
from jeat_graph.data.errors import DataError

#: Number of rows N, their classes (N,) and the probabilities of these (N,), or None twice.
ClassPart: TypeAlias = tuple[int, TextArray | None, FloatArray | None]


def check_classes(n: int, classes: TextArray | None, probability: FloatArray | None) -> None:
    """Check that both columns are there with `n` rows, or neither is.

    Raises:
        DataError: they are not.
    """
    if (classes is None) != (probability is None):
        raise DataError("classes and class_probability go together: give both or neither")
    for name, column in (("classes", classes), ("class_probability", probability)):
        if column is not None and column.shape != (n,):
            raise DataError(f"{name} must have shape ({n},), not {column.shape}")


def unknown_classes(n: int) -> tuple[TextArray, FloatArray]:
    """Return the columns of `n` rows of which nothing is known: empty text and NaN."""
    return np.zeros(n, dtype="U1"), np.full(n, np.nan)


def join_classes(parts: Sequence[ClassPart]) -> tuple[TextArray | None, FloatArray | None]:
    """Stack the columns of several tables; None twice where none of them has any."""
    if all(classes is None for _, classes, _ in parts):
        return None, None
    filled = [
        unknown_classes(n) if classes is None or probability is None else (classes, probability)
        for n, classes, probability in parts
    ]
    return np.concatenate([one[0] for one in filled]), np.concatenate([one[1] for one in filled])


def class_column(classes: Any, probability: Any) -> dict[str, Any]:
    """Return the fields of `Trajectories` that columns of a table stand for; none where there are none.

    Args:
        classes: (N,) names, or None where the table has no such column; what is no text is unknown.
        probability: (N,) numbers, or None: then NaN.
    """
    if classes is None:
        return {}
    texts = [one if isinstance(one, str) else "" for one in classes]
    share = np.full(len(texts), np.nan) if probability is None else np.asarray(probability, dtype=np.float64)
    return {"classes": np.array(texts, dtype=np.str_), "class_probability": share}


#: Columns that say a class: its name or number, its number beside a name, and that name.
CLASS_COLUMNS = ("class", "class_id", "name")
#: Number of the first name of a list, but for MOTChallenge text.
LISTS_COUNT_FROM = 0
_WHOLE = re.compile(r"(-?\d+)(?:\.0*)?")


def all_numbers(texts: Iterable[str]) -> bool:
    """Tell whether all of some texts are whole numbers, but for empty ones, and there is one."""
    there = {text for text in texts if text}
    return bool(there) and all(_WHOLE.fullmatch(text) for text in there)


def declared_classes(found: Mapping[str, TextArray]) -> TextArray | None:
    """Choose among columns that say classes: names go before numbers, as in tables of YOLO's that have both.

    Args:
        found: (N,) texts by the name of their column, of `CLASS_COLUMNS`.

    Returns:
        Classes (N,), numbers without decimals; None where no column says them.
    """
    found_column = next((found[name] for name in CLASS_COLUMNS[:2] if name in found), None)
    if found_column is None or not all_numbers(
        set(found_column.tolist())
    ):  # a set takes a fraction of a sort's time
        return found_column
    names, place = np.unique(found_column, return_inverse=True)
    whole = [_WHOLE.sub(r"\1", name) for name in names.tolist()]
    numbers: TextArray = np.array(whole, dtype=np.str_)[place.reshape(-1)]
    if "name" not in found:
        return numbers
    return np.where(found["name"] == "", numbers, found["name"])


def naming_hint(names: Iterable[str]) -> str:
    """Say what gives classes their names, where all of some are numbers."""
    return " (--classes FILE names them, in Python class_names=)" if all_numbers(names) else ""


def rows_of_class(classes: TextArray | None, wanted: Iterable[str], *, unknown: bool) -> BoolArray:
    """Tell which rows are of one of some classes.

    Args:
        classes: (N,) class of each row, empty where unknown.
        wanted: names of classes.
        unknown: whether rows of which the class is not known are to be kept too.

    Returns:
        (N,) true where the row is of one of them.

    Raises:
        DataError: there are no classes at all, or none of those wanted; the message names those there are.
    """
    names = list(wanted)
    if classes is None:
        raise DataError("there is no class to choose by: no detection has one")
    there = sorted({str(name) for name in np.unique(classes)} - {""})
    if not set(names) & set(there):
        raise DataError(
            f"nothing is of class {' or '.join(names)}; there are: {', '.join(there) or 'none'}"
            + naming_hint(there)
        )
    chosen = np.isin(classes, names)
    return np.asarray(chosen | (classes == "") if unknown else chosen, dtype=np.bool_)


def listed_names(names: Sequence[str] | Mapping[int, str], first: int) -> dict[int, str]:
    """Return the names of classes by number.

    Args:
        names: by number, or in order.
        first: number of the first one of a list.

    Raises:
        DataError: neither.
    """
    try:
        if isinstance(names, Mapping):
            return {int(number): str(name) for number, name in names.items()}
        return dict(enumerate(map(str, names), first))
    except (TypeError, ValueError):
        raise DataError(f"class_names are names in order, or by number, not {names!r:.60}") from None


def name_classes(classes: TextArray | None, names: Mapping[int, str] | None) -> TextArray | None:
    """Give numbers their names; a number without one stays, and so do classes that have names already.

    Args:
        classes: (N,) classes as the file has them, empty where unknown.
        names: by number, or None.
    """
    if classes is None or names is None:
        return classes
    distinct, place = np.unique(classes, return_inverse=True)
    if not all_numbers(distinct.tolist()):
        return classes
    words = [names.get(int(text), text) if text else "" for text in distinct.tolist()]
    return np.array(words, dtype=np.str_)[place.reshape(-1)]
