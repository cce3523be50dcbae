"""The command `jeat-graph calibrate`."""

from pathlib import Path

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.io.tables.truth_io import write_truth


@pytest.fixture(scope="module")
def files(recordings, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    out = []
    for k, (detections, truth) in enumerate(recordings):
        paths = folder / f"detections{k}.csv", folder / f"gt{k}.csv"
        write_detections(detections, paths[0])
        write_truth(truth, paths[1])
        out.append(tuple(map(str, paths)))
    return out


def test_with_truth_a_configuration_is_written_that_loads(files, tmp_path, capsys):
    out = tmp_path / "config.yaml"
    (d0, g0), (d1, g1) = files
    assert main(["calibrate", d0, d1, "--gt", g0, g1, "--out", str(out), "--no-tune"]) == 0
    found = load_config(out)
    assert 0.2 < found.sensors["rgb"].even_score < 0.7
    table = capsys.readouterr().out
    assert "Sensors" in table
    assert "even score" in table


def test_detections_and_truth_may_be_in_another_unit_of_time(files, tmp_path):
    out = [tmp_path / name for name in ("s.yaml", "ms.yaml")]
    d, g = files[0]
    scaled = []
    for path in (d, g):
        head, *lines = Path(path).read_text().splitlines()
        rows = [line.split(",", 1) for line in lines]
        scaled.append(tmp_path / Path(path).name)
        scaled[-1].write_text(
            "\n".join([head, *(f"{1000 * float(t):.0f},{rest}" for t, rest in rows)]) + "\n"
        )
    in_ms = ["calibrate", str(scaled[0]), "--gt", str(scaled[1]), "--time-unit", "ms"]
    for path, args in zip(out, (["calibrate", d, "--gt", g], in_ms), strict=True):
        assert main([*args, "--no-tune", "--out", str(path)]) == 0
    assert load_config(out[0]) == load_config(out[1])


def test_without_truth_the_head_of_the_file_says_so(files, tmp_path):
    out = tmp_path / "config.yaml"
    assert main(["calibrate", files[0][0], "--out", str(out)]) == 0
    assert "without truth" in out.read_text().split("\nsensors:")[0]
    assert load_config(out).sensor_names == ("rgb",)


def test_it_is_said_which_clocks_are_off_and_from_whose_times_that_is_taken(
    files, tmp_path, capsys, monkeypatch
):
    from jeat_graph.calibration import procedure
    from jeat_graph.calibration.offset import Lag, earliest_on_time, with_lags

    lags = (Lag("evt", -0.03, 0.001, True), Lag("rgb", 0.0, 0.001, False))
    config = with_lags(load_config("default", ["sensors.rgb={}", "sensors.evt={}"]), lags)
    found = {
        "calibrate_with_truth": procedure.Calibration(config, lags),
        "calibrate_without_truth": procedure.Calibration(earliest_on_time(config), lags),
    }
    for name, one in found.items():
        monkeypatch.setattr(procedure, name, lambda *args, one=one, **options: one)
    d, g = files[0]
    said = []
    for truth in ([], ["--gt", g]):
        assert main(["calibrate", d, *truth, "--out", str(tmp_path / "config.yaml")]) == 0
        said.append(capsys.readouterr().err)
    for text, beside, taken in zip(
        said,
        ("the sensor that sees most", "the truth"),
        (
            "sensors.evt.latency_s 0, sensors.rgb.latency_s 0.03",
            "sensors.evt.latency_s -0.03, sensors.rgb.latency_s 0",
        ),
        strict=True,
    ):
        assert f"sensor 'evt' is 30 ms early (± 1.0 ms) beside {beside}\n" in text
        assert f"taken off the times from now on: {taken} (s)\n" in text


def test_the_size_of_the_picture_is_taken_over(files, tmp_path):
    out = tmp_path / "config.yaml"
    d, g = files[0]
    assert main(["calibrate", d, "--gt", g, "--image", "1300x730", "--no-tune", "--out", str(out)]) == 0
    assert "# image: from --image;" in out.read_text()
    image = load_config(out).image
    assert (image.width, image.height) == (1300.0, 730.0)


def test_a_video_says_the_size_of_the_picture_and_the_rate(files, tmp_path):
    from jeat_graph.io.media.video_writer import FrameWriter

    with FrameWriter(tmp_path, "lossless", (1300, 730), 25.0) as writer:
        for k in range(3):
            writer.append(40_000 * k, np.zeros((730, 1300, 3), dtype=np.uint8))
    (tmp_path / "frames.csv").unlink()
    lines = [f"{k + 1},-1,{100 + 4 * k},200,60,40,0.9,-1,-1,-1\n" for k in range(60)]
    (tmp_path / "det.txt").write_text("".join(lines))
    out = tmp_path / "config.yaml"
    video = ["--frames", str(tmp_path / "frames.avi")]
    assert main(["calibrate", str(tmp_path / "det.txt"), *video, "--out", str(out)]) == 0
    found = load_config(out)
    assert (found.image.width, found.image.height) == (1300.0, 730.0)
    assert found.sensors["rgb"].rate_hz == pytest.approx(25.0, rel=0.02)


def test_boxes_beyond_the_base_picture_need_a_size(files, tmp_path, capsys):
    small = tmp_path / "small.yaml"
    small.write_text("base: default\nimage: {width: 640, height: 360}\n")
    d, g = files[0]
    args = ["calibrate", d, "--gt", g, "--config", str(small), "--out", str(tmp_path / "out.yaml")]
    assert main(args) == 2
    assert "--image" in capsys.readouterr().err
    assert not (tmp_path / "out.yaml").exists()


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--gt", "a.csv", "b.csv"], "one truth for each"),
        (["--out", "config.txt"], "must end in .yaml"),
        (["--config", "defualt"], "did you mean default"),
    ],
)
def test_wrong_use_is_one_line_and_exit_2(files, tmp_path, capsys, extra, message):
    assert main(["calibrate", files[0][0], "--out", str(tmp_path / "x.yaml"), *extra]) == 2
    err = capsys.readouterr().err.strip()
    assert message in err
    assert len(err.splitlines()) == 1


def test_size_of_the_picture_must_read_width_x_height(files, tmp_path):
    with pytest.raises(SystemExit) as stop:
        main(["calibrate", files[0][0], "--image", "large", "--out", str(tmp_path / "x.yaml")])
    assert stop.value.code == 2


def test_boxes_that_are_those_of_the_truth_to_the_last_digit_calibrate_too(files, tmp_path):
    truth, out = files[0][1], tmp_path / "config.yaml"
    assert main(["calibrate", f"rgb={truth}", "--gt", truth, "--no-tune", "--out", str(out)]) == 0
    assert load_config(out).sensors["rgb"].even_score is None
