"""A table of detections says what is known of its detectors, and `track` reads it back."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.detections_io import read_detections, write_detections
from jeat_graph.io.tables.sensor_columns import as_settings, declared_by, declared_by_all
from jeat_graph.runs.directory import read_record

KNOWN = {"rgb": {"even_score": 0.45, "latency_s": 0.0093}, "cam 7.1": {"even_score": 0.3}}


def recording(names=("rgb", "cam 7.1", "bare")):
    box = np.array([[10.0, 20.0, 30.0, 40.0]])
    return Detections.from_scans(
        Scan(k / 20, name, box if k % 3 else np.zeros((0, 4)), np.full(1 if k % 3 else 0, 0.7))
        for k in range(12)
        for name in names
    )


@pytest.mark.parametrize("name", ["d.csv", "d.parquet"])
def test_what_is_known_comes_back_and_the_boxes_stay(tmp_path, name):
    path = tmp_path / name
    write_detections(recording(), path, declared=KNOWN)
    assert declared_by(path) == KNOWN
    again, plain = read_detections(path), recording()
    np.testing.assert_array_equal(again.boxes, plain.boxes)
    assert again.sensors == plain.sensors
    write_detections(plain, path)
    assert declared_by(path) == {}


def test_values_of_any_kind_come_back(tmp_path):
    clock = {"clock": {"offset_s": 0.1, "at_s": 3.0}, "image": [640.0, 480.0]}
    write_detections(recording(("rgb",)), tmp_path / "d.csv", declared={"rgb": clock})
    assert declared_by(tmp_path / "d.csv") == {"rgb": clock}
    known = load_config("default", as_settings({"rgb": clock})).sensors["rgb"]
    assert (known.clock.offset_s, known.image) == (0.1, (640.0, 480.0))


def test_rows_may_be_filtered_and_a_sensor_renamed(tmp_path):
    path = tmp_path / "d.csv"
    write_detections(recording(("rgb",)), path, declared=KNOWN)
    head, *lines = path.read_text().splitlines()
    path.write_text("\n".join([head, *lines[7:]]) + "\n")
    assert declared_by(path, "north") == {"north": KNOWN["rgb"]}


def test_settings_of_a_name_with_dots_are_taken():
    sensors = load_config("default", as_settings(KNOWN)).sensors
    assert {name: one.even_score for name, one in sensors.items()} == {"rgb": 0.45, "cam 7.1": 0.3}


@pytest.mark.parametrize(
    ("header", "value", "message"),
    [
        ("sensor.even_score", "0.5", r"d\.csv:4: sensor\.even_score of sensor 'rgb' is 0\.5, and 0\.45 in"),
        ("sensor.even_score", "7", r"d\.csv:4: column sensor\.even_score: .* is not in"),
        ("sensor.even_skore", "0.45", r"d\.csv:2: column sensor\.even_skore: .*even_score"),
        ("sensor.even_score", "[", r"d\.csv:4: column sensor\.even_score: "),
    ],
)
def test_what_cannot_be_meant_is_refused_with_its_line(tmp_path, header, value, message):
    path = tmp_path / "d.csv"
    rows = [f"{k / 10},rgb,1,2,3,4,.9,{value if k == 2 else 0.45}" for k in range(4)]
    path.write_text("\n".join([f"t,sensor,left,top,width,height,score,{header}", *rows]) + "\n")
    with pytest.raises(DataError, match=message):
        declared_by(path)


def test_a_data_frame_says_it_too(tmp_path):
    import pandas as pd

    from jeat_graph import track

    path = tmp_path / "d.csv"
    write_detections(recording(("rgb",)), path, declared={"rgb": {"even_score": 0.9}})
    told, frame = track(path, image=(640, 480)), track(pd.read_csv(path), image=(640, 480))
    np.testing.assert_array_equal(told.causal.existence, frame.causal.existence)
    plain = track(recording(("rgb",)), image=(640, 480))
    assert len(plain.causal) != len(told.causal)  # a score of .7 is rather false where .9 is even


def test_two_files_must_agree_on_a_sensor(tmp_path):
    for name, even in (("a.csv", 0.45), ("b.csv", 0.4)):
        write_detections(recording(("rgb",)), tmp_path / name, declared={"rgb": {"even_score": even}})
    with pytest.raises(DataError, match=r"b\.csv: sensor\.even_score of sensor 'rgb' is 0\.4, and 0\.45 in"):
        declared_by_all([(None, tmp_path / "a.csv"), (None, tmp_path / "b.csv")])
    said = declared_by_all([("one", tmp_path / "a.csv"), ("two", tmp_path / "b.csv")])
    assert {name: keys["even_score"] for name, keys in said.items()} == {"one": 0.45, "two": 0.4}


def test_track_takes_it_unless_the_user_or_another_configuration_says_otherwise(tmp_path, capsys):
    path, out = tmp_path / "d.csv", tmp_path / "run"
    write_detections(recording(("rgb",)), path, declared=KNOWN)

    def even(*more):
        assert main(["track", str(path), "--image", "640x480", "--out", str(out), *more]) == 0
        return read_record(out)["config"]["sensors"]["rgb"]["even_score"]

    assert even() == 0.45
    assert "even_score 0.45, latency_s 0.0093, as the detections say" in capsys.readouterr().err
    assert even("--set", "sensors.rgb.even_score=0.6") == 0.6
    assert even("--config", "paper") is None
