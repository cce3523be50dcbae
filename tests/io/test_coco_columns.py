"""Entries of a COCO file as columns: the same numbers as one by one, or left to that."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.reading import Reading
from jeat_graph.io.formats.coco import read_results
from jeat_graph.io.tables import coco_columns
from jeat_graph.io.tables.coco_columns import read_entries

GOOD = {"image_id": 3, "bbox": [1, 2.5, 1e-3, 40], "score": 0.25, "category_id": 2}
MASK = {"segmentation": {"size": [2, 2], "counts": "a}, {b"}, "area": 1.5}
RESULTS = [GOOD | {"image_id": k, "score": k / 7} for k in range(7)]


def columns(text: str):
    found = read_entries(text.encode())
    assert found is not None
    return [values.tolist() for values in found[:4]]


@pytest.mark.parametrize(
    "text",
    [
        json.dumps(RESULTS),
        json.dumps(RESULTS, separators=(",", ":")),
        " \n" + json.dumps(RESULTS, indent=2) + "\n",
        json.dumps([MASK | entry for entry in RESULTS]).replace("a}, {b", "ab"),
        json.dumps({"images": [{"id": 1}], "annotations": RESULTS, "categories": []}),
    ],
    ids=["as Python writes it", "compact", "indented", "with masks", "data set"],
)
def test_columns_are_the_entries_numbers(text):
    wanted = [[entry[name] for entry in RESULTS] for name in ("image_id", "bbox", "score", "category_id")]
    assert columns(text) == wanted


def test_entries_are_the_same_however_they_are_cut_into_pieces(monkeypatch):
    text = json.dumps(RESULTS)
    whole = columns(text)
    monkeypatch.setattr(coco_columns, "_PIECE", 10)
    assert columns(text) == whole


def test_what_surrounds_the_entries_is_kept():
    found = read_entries(json.dumps({"images": [{"id": 1}], "annotations": RESULTS, "info": "x"}).encode())
    assert found.rest == {"images": [{"id": 1}], "annotations": [], "info": "x"}


@pytest.mark.parametrize(
    "text",
    [
        json.dumps([GOOD, MASK | GOOD, GOOD]),
        json.dumps([GOOD, GOOD | {"bbox": [1, 2, 3]}]),
        json.dumps([GOOD, GOOD | {"bbox": [1, 2, 3, None]}]),
        json.dumps([GOOD, GOOD | {"bbox": [1, 2, 3, float("nan")]}]),
        json.dumps([GOOD, GOOD | {"image_id": 1.5}]),
        json.dumps([GOOD, GOOD | {"image_id": 2**60}]),
        json.dumps([GOOD, GOOD | {"score": "0.5"}]),
        json.dumps([GOOD, GOOD | {"score": True}]),
        json.dumps([GOOD, [1]]),
        json.dumps([GOOD, {"parts": [GOOD, GOOD]}]),
        json.dumps([GOOD, GOOD]).replace("}, {", "} {"),
        json.dumps([GOOD, GOOD])[:-1],
        json.dumps([GOOD, GOOD]) + "]",
        json.dumps([GOOD, GOOD]).replace('"score"', '"score": 1, "score"'),
        json.dumps([GOOD | {"name": "ä"}], ensure_ascii=False),
        "[]",
        "",
    ],
)
def test_whatever_is_not_as_expected_is_left_to_be_read_one_by_one(text):
    assert read_entries(text.encode()) is None


@pytest.mark.parametrize("wrong", [{"bbox": [1, 2, 3]}, {"score": None}, {"image_id": 0.5}])
def test_the_entry_that_is_wrong_is_named(tmp_path, wrong):
    path = tmp_path / "r.json"
    path.write_text(json.dumps([*RESULTS, GOOD | wrong]), encoding="utf-8")
    with pytest.raises(DataError, match=r"r\.json: entry 8: "):
        read_results(path, Reading(rate_hz=10.0))


def test_both_ways_give_the_same_boxes(tmp_path):
    rng = np.random.default_rng(0)
    entries = [
        {"image_id": int(k // 3), "bbox": box, "score": score, "category_id": int(k % 2)}
        for k, (box, score) in enumerate(
            zip(rng.lognormal(3, 2, (60, 4)).tolist(), rng.random(60).tolist(), strict=True)
        )
    ]
    for name, more in (("quick.json", {}), ("slow.json", {"caption": "é"})):
        text = json.dumps([entries[0] | more, *entries[1:]], ensure_ascii=False)
        (tmp_path / name).write_text(text, encoding="utf-8")
    quick, slow = (
        read_results(tmp_path / name, Reading(rate_hz=25.0)) for name in ("quick.json", "slow.json")
    )
    for field in ("t", "boxes", "scores", "classes"):
        np.testing.assert_array_equal(getattr(quick, field), getattr(slow, field))
