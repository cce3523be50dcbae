"""No name from the input becomes a formula in a spreadsheet, and every name comes back as it was."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.cli.main import main
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.tables.spreadsheets import guarded, unguarded
from jeat_graph.eval.tables import Table
from jeat_graph.io.tables.detections_io import read_detections, write_detections
from jeat_graph.io.tables.trajectories_io import read_trajectories

FORMULAS = ['=HYPERLINK("http://x.example","y")', "+cmd|' /C calc'!A0", "-2+3", "@SUM(1)", "＝1+1", "'=1+1"]
PLAIN = ["car", "-1", "+5", "-1e-3", "a=b", "x-y", "'", "''", "'a", "", "é"]


@pytest.mark.parametrize("text", [*FORMULAS, "\t=1", "\r=1", "\n=1"])
def test_a_formula_is_marked_as_text(text):
    assert guarded(text) == "'" + text
    assert unguarded(guarded(text)) == text


@pytest.mark.parametrize("text", PLAIN)
def test_all_else_stays_as_it_is(text):
    assert guarded(text) == text
    assert unguarded(text) == text


@given(st.text(alphabet="'=+-@\t\r\n＝a1e.", max_size=6))
def test_reading_is_the_inverse_of_writing(text):
    assert unguarded(guarded(text)) == text
    assert guarded(text)[:1] not in tuple("=+-@\t\r\n＝") or guarded(text) == text


def fields(path):
    with open(path, newline="", encoding="utf-8") as file:
        return [field for row in csv.reader(file) for field in row]


def is_formula(field: str) -> bool:
    if field[:1] not in tuple("=+-@\t\r＝＋－＠") or not field:
        return False
    try:
        float(field)
    except ValueError:
        return True
    return False


@pytest.mark.parametrize("name", FORMULAS)
def test_sensors_and_classes_are_text_in_every_table_of_a_run_and_come_back(tmp_path, name):
    source, out = tmp_path / "det.csv", tmp_path / "run"
    sensor = "=1+1" if set(name) & set('",|') else name  # these no sensor may have
    with source.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["t", "sensor", "left", "top", "width", "height", "score", "class"])
        for k in range(30):
            rows.writerow([0.05 * k, sensor, 100 + 4 * k, 100, 60, 40, 0.9, name])
    assert main(["track", str(source), "--out", str(out), "--image", "640x480", "--diagnostics"]) == 0
    given_name = unguarded(name)  # as the file itself is read
    table = read_trajectories(out / "smoothed.csv")
    assert set(table.sensors) == {unguarded(sensor)}
    assert set(table.classes) == {given_name}
    line = ["--line", "150,0,150,480", "--interval", "1"]
    assert main(["count", str(out), *line, "--out", str(tmp_path / "c.csv")]) == 0
    for path in (*out.glob("*.csv"), tmp_path / "c.csv"):
        assert not [field for field in fields(path) if is_formula(field)], path


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_detections_come_back_exactly(tmp_path, suffix):
    names = np.array([*FORMULAS, "-1", "car"])
    box, score = np.array([[1.0, 1.0, 5.0, 5.0]]), np.array([0.5])
    scans = [Scan(0.1 * k, str(name), box, score, names[k : k + 1]) for k, name in enumerate(names)]
    path = tmp_path / f"det{suffix}"
    write_detections(Detections.from_scans(scans), path)
    again = read_detections(path)
    assert again.classes.tolist() == names.tolist()
    assert set(again.sensors) == set(names.tolist())
    if suffix == ".csv":
        assert not [field for field in fields(path) if is_formula(field)]


def test_tables_for_people_do_the_same():
    text = Table.from_records([{"name": "=1+1", "value": -2.5}]).render("csv")
    assert text == "name,value\n'=1+1,-2.5\n"
