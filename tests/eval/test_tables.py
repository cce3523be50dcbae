"""One table in all its forms."""

from __future__ import annotations

import csv
import io
import json

import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph.eval.tables import Table, to_json

RECORDS = [{"name": "a_b", "MOTA": 98.7654, "FP": 12}, {"name": "c|d", "MOTA": float("nan"), "FP": None}]


def table():
    return Table.from_records(RECORDS, title="Scores", digits={"MOTA": 1})


def test_text_is_aligned_with_numbers_to_the_right():
    assert table().render() == (
        "Scores\n"
        "name  MOTA  FP\n"
        "────  ────  ──\n"
        "a_b   98.8  12\n"
        "c|d      –   –\n"
    )  # fmt: skip


def test_csv_has_full_precision_and_empty_cells():
    rows = list(csv.DictReader(io.StringIO(table().render("csv"))))
    assert rows == [{"name": "a_b", "MOTA": "98.7654", "FP": "12"}, {"name": "c|d", "MOTA": "", "FP": ""}]


def test_markdown_escapes_bars():
    lines = table().render("markdown").splitlines()
    assert lines[2:] == ["| name | MOTA | FP |", "|---|--:|--:|", "| a_b | 98.8 | 12 |", "| c\\|d | – | – |"]


def test_latex_escapes_its_special_characters():
    text = table().render("latex")
    assert "\\begin{tabular}{lrr}" in text
    assert "a\\_b & 98.8 & 12 \\\\" in text
    assert "c|d & -- & -- \\\\" in text


def test_json_keeps_all_digits_and_writes_null_for_what_is_not_a_number():
    assert json.loads(table().render("json")) == [
        {"name": "a_b", "MOTA": 98.7654, "FP": 12},
        {"name": "c|d", "MOTA": None, "FP": None},
    ]
    assert json.loads(to_json({"a": [float("inf"), (1, "x")]})) == {"a": [None, [1, "x"]]}


def test_a_value_that_rounds_to_zero_has_no_sign():
    assert Table(("x",), ((-0.0001,),)).render("markdown").endswith("| 0.00 |\n")


def test_an_empty_table_has_its_head():
    assert Table(("x", "y"), ()).render() == "x  y\n─  ─\n"


def test_an_unknown_form_is_refused():
    with pytest.raises(ConfigError, match="unknown table format 'html'"):
        table().render("html")


def test_a_long_table_is_looked_at_once_for_its_columns(monkeypatch):
    looks = []
    look = Table.is_number
    monkeypatch.setattr(Table, "is_number", lambda table, k: looks.append(k) or look(table, k))
    Table.from_records([{"line": "gate", "vehicles": k} for k in range(500)]).render()
    assert looks == [0, 1]
