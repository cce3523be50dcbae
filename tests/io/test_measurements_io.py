"""The table of measurements: what is written is read back to the last bit, whatever cannot be is refused."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.io.tables.measurements_io import COLUMNS, MeasurementWriter, read_measurements

SENSORS = ("events", "rgb")


def some_rows(count):
    rng = np.random.default_rng(0)
    rows = np.zeros(count, dtype=MEASUREMENT)
    for name in MEASUREMENT.names:
        if np.issubdtype(MEASUREMENT[name].base, np.integer):
            rows[name] = rng.integers(0, 2, rows[name].shape)
        else:
            rows[name] = rng.normal(size=rows[name].shape) * 10.0 ** rng.integers(-9, 9, rows[name].shape)
    rows["nis"][::3] = np.nan
    return rows


def write(path, pieces):
    with MeasurementWriter(path, SENSORS) as writer:
        for rows in pieces:
            writer.append(rows)


@pytest.mark.parametrize("name", ["m.parquet", "m.csv"])
def test_all_comes_back_to_the_last_bit(tmp_path, name):
    rows = some_rows(50)
    write(tmp_path / name, [rows[:7], rows[7:7], rows[7:]])
    again = read_measurements(tmp_path / name, SENSORS)
    for field in MEASUREMENT.names:
        np.testing.assert_array_equal(again[field], rows[field])


def test_a_run_without_tracks_has_an_empty_table_with_all_columns(tmp_path):
    write(tmp_path / "m.csv", [])
    assert (tmp_path / "m.csv").read_text() == ",".join(COLUMNS) + "\n"
    assert read_measurements(tmp_path / "m.csv", SENSORS).shape == (0,)


def test_a_sensor_of_another_run_is_refused_with_its_row(tmp_path):
    write(tmp_path / "m.csv", [some_rows(5)])
    with pytest.raises(DataError, match=r"m\.csv:\d+: sensor (rgb|events) is not one of the run's: lidar"):
        read_measurements(tmp_path / "m.csv", ("lidar",))
