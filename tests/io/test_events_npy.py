"""Events from structured arrays, whatever their fields are called."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.events_npy import events_of, read_events_npy

ROWS = [(10, 1, 2, 1), (10, 3, 4, -1), (25, 5, 6, 0)]


@pytest.mark.parametrize("names", ["t x y p", "ts x y pol", "timestamp x y polarity"])
def test_fields_may_have_any_of_their_usual_names(tmp_path: Path, names: str) -> None:
    array = np.array(ROWS, dtype=[(name, "<i8") for name in names.split()])
    np.save(tmp_path / "events.npy", array)
    events = read_events_npy(tmp_path / "events.npy")
    assert events.t_us.tolist() == [10, 10, 25]
    assert events.x.tolist() == [1, 3, 5]
    assert events.y.tolist() == [2, 4, 6]
    assert events.polarity.tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros(3), "must be a 1-D structured array"),
        (np.zeros(3, dtype=[("t", "i8"), ("x", "i8"), ("p", "i8")]), "'y' is missing"),
        (
            np.zeros(3, dtype=[("t", "f8"), ("x", "i8"), ("y", "i8"), ("p", "i8")]),
            "'t' is missing or no whole",
        ),
        (np.array(ROWS[::-1], dtype=[(n, "i8") for n in "txyp"]), "backwards at event 1"),
        (np.array([(1, -2, 3, 1)], dtype=[(n, "i8") for n in "txyp"]), "'x' is negative"),
    ],
)
def test_what_is_no_event_array_is_named(array: np.ndarray, words: str) -> None:
    with pytest.raises(DataError, match=rf"e\.npy: .*{words}"):
        events_of(array, "e.npy")


@pytest.mark.parametrize("content", [b"", b"not numpy"])
def test_a_file_that_is_no_array_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "e.npy").write_bytes(content)
    with pytest.raises(DataError, match=r"e\.npy: "):
        read_events_npy(tmp_path / "e.npy")
