"""What a reader refuses before it begins."""

from __future__ import annotations

import os

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.files import limits
from jeat_graph.io.tables.csv_text import read_bytes
from jeat_graph.io.tables.detections_io import read_detections

HEADER = "t,sensor,left,top,width,height,score"


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="no such device here")
def test_a_device_without_an_end_is_no_file():
    with pytest.raises(DataError, match="pipe or a device"):
        read_detections("/dev/zero")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "p.csv")
    with pytest.raises(DataError, match="save its content as a file first"):
        read_detections(tmp_path / "p.csv")


def test_a_file_larger_than_the_free_memory_is_not_read(tmp_path, monkeypatch):
    (tmp_path / "d.csv").write_text(HEADER + "\n", encoding="utf-8")
    monkeypatch.setattr(limits, "free_memory", lambda: 8.0)
    with pytest.raises(DataError, match="GiB of memory"):
        read_bytes(tmp_path / "d.csv")


def test_a_parquet_file_of_more_rows_than_fit_is_not_read(tmp_path, monkeypatch):
    rows = 1_000_000
    one = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, dtype=np.int8)), pa.array([1.0]))
    columns = dict.fromkeys(("t", "left", "top", "width", "height", "score"), one.cast(pa.float64()))
    sensor = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, dtype=np.int8)), pa.array(["rgb"]))
    pq.write_table(pa.table(columns | {"sensor": sensor}), tmp_path / "d.parquet")
    size = (tmp_path / "d.parquet").stat().st_size
    assert size < 100_000  # a few bytes that claim a million rows
    monkeypatch.setattr(limits, "free_memory", lambda: 50.0 * 2**20)
    with pytest.raises(DataError, match=r"needs at least 0\.\d+ GiB of memory"):
        read_detections(tmp_path / "d.parquet")


def test_free_memory_is_what_the_system_says_if_it_does():
    free = limits.free_memory()
    assert free is None or 2**20 < free < 2**50


def test_a_container_may_use_no_more_than_its_limit(tmp_path, monkeypatch):
    (tmp_path / "meminfo").write_text("MemTotal: 9000 kB\nMemAvailable: 8000 kB\n", encoding="ascii")
    for name, text in (("max", "4096000"), ("current", "2048000"), ("stat", "anon 1\nfile 1024000\n")):
        (tmp_path / f"memory.{name}").write_text(text, encoding="ascii")
    monkeypatch.setattr(limits, "_MEMINFO", tmp_path / "meminfo")
    monkeypatch.setattr(limits, "_CGROUP", tmp_path)
    assert limits.free_memory() == 4096000 - 2048000 + 1024000
    (tmp_path / "memory.max").write_text("max\n", encoding="ascii")
    assert limits.free_memory() == 8000 * 1024


def test_a_million_columns_are_refused_at_once(tmp_path):
    names = ",".join(f"c{k}" for k in range(1_000_000))
    (tmp_path / "d.csv").write_text(f"{HEADER},{names}\n", encoding="utf-8")
    with pytest.raises(DataError, match="has 1000007 columns"):
        read_detections(tmp_path / "d.csv")


def test_a_thousand_columns_more_are_passed_over(tmp_path):
    names = ",".join(f"c{k}" for k in range(1000))
    values = ",".join(["7"] * 1000)
    (tmp_path / "d.csv").write_text(f"{HEADER},{names}\n0,rgb,1,2,3,4,.5,{values}\n", encoding="utf-8")
    assert len(read_detections(tmp_path / "d.csv")) == 1


@pytest.mark.parametrize("box", ["1e10,2,3,4", "1,2,1e154,4", "1,2,3,1e-160", "-1e200,2,3,4"])
def test_a_box_that_no_picture_holds_is_refused_with_its_line(tmp_path, box):
    (tmp_path / "d.csv").write_text(f"{HEADER}\n0,rgb,1,2,3,4,.5\n0.1,rgb,{box},.5\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"d\.csv:3: no picture holds a box"):
        read_detections(tmp_path / "d.csv")


def test_long_doubles_in_a_box_array_are_numbers(tmp_path):
    kinds = [("t", np.int64), *((name, np.longdouble) for name in ("x", "y", "w", "h", "class_confidence"))]
    array = np.array([(50_000, 1.5, 2, 3, 4, 0.5)], dtype=kinds)
    np.save(tmp_path / "d.npy", array)
    found = read_detections(tmp_path / "d.npy")
    assert found.boxes.tolist() == [[1.5, 2, 3, 4]]
    assert found.scores.tolist() == [0.5]


@pytest.mark.parametrize("name", ["d.json", "d"])
def test_json_nested_without_end_is_one_line(tmp_path, name):
    (tmp_path / name).write_text("[" * 50_000, encoding="utf-8")
    with pytest.raises(DataError, match="is not JSON"):
        read_detections(tmp_path / name)
