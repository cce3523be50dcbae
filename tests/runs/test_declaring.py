"""What a configuration leaves open is found in recordings: the picture's size, sensors and their rates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph import track
from jeat_graph.calibration.procedure import calibrate_without_truth
from jeat_graph.config.reading import as_config, config_to_dict, load_config
from jeat_graph.config.schema import SensorConfig
from jeat_graph.data.detections import Detections
from jeat_graph.runs.declaring import fit_input, own_picture


def recording(boxes: np.ndarray) -> Detections:
    n = len(boxes)
    return Detections.from_rows(0.05 * np.arange(n), np.full(n, "cam"), boxes, np.full(n, 0.9))


def picture(boxes: np.ndarray) -> tuple[float, float]:
    image = fit_input(load_config("default"), recording(boxes))[0].image
    return image.width, image.height


def drive(n: int) -> np.ndarray:
    """A vehicle that drives from the left edge to the lower right corner of 1,920 x 1,080 px."""
    share = np.linspace(0.0, 1.0, n)[:, None]
    return np.hstack([share * [1820.0, 1000.0], np.tile([100.0, 80.0], (n, 1))])


@pytest.mark.parametrize("n", [1, 2, 5, 40, 5000])
def test_the_picture_reaches_as_far_as_the_boxes(n):
    assert picture(drive(n)) == ((1920.0, 1080.0) if n > 1 else (100.0, 80.0))


@pytest.mark.parametrize("wild", [(1e5, 10.0, 40.0, 20.0), (10.0, 9e4, 40.0, 20.0), (0.0, 0.0, 9e5, 9e5)])
def test_a_wild_box_does_not_say_how_far(wild):
    assert picture(np.vstack([drive(100), [wild]])) == (1920.0, 1080.0)
    assert picture(np.vstack([[wild], drive(5000), [wild]])) == (1920.0, 1080.0)


def test_numbers_rounded_in_a_file_make_the_picture_no_larger():
    boxes = drive(40)
    boxes[:, 2:] += 0.006
    assert picture(boxes) == (1920.0, 1080.0)
    assert picture(boxes + np.array([0.0, 0.0, 0.5, 0.5])) == (1921.0, 1081.0)


def test_boxes_left_of_the_picture_and_above_do_no_harm():
    assert picture(np.array([[-300.0, -200.0, 20.0, 20.0]] * 4)) == (1.0, 1.0)


def camera(start, scans=40, rate=20.0, name="cam"):
    t = start + np.arange(scans) / rate
    boxes = np.column_stack([100.0 + 60.0 * (t - start), np.tile([200.0, 40.0, 30.0], (scans, 1))])
    return Detections.from_rows(t, np.full(scans, name), boxes, np.full(scans, 0.9))


@pytest.mark.parametrize("starts", [(0.0,), (0.0, 0.02), (0.0, 0.017, 0.033)])
def test_recordings_of_one_camera_that_begin_at_other_times_have_its_rate(starts):
    recordings = [camera(start) for start in starts]
    config, _ = fit_input(load_config("default"), *recordings)
    assert config.sensors["cam"].rate_hz == pytest.approx(20.0)


def test_blind_calibration_finds_the_rate_of_one_camera_in_two_recordings():
    base = as_config(load_config("default"), (1280, 720))
    found = calibrate_without_truth([camera(0.0), camera(0.02)], base).config
    assert found.sensors["cam"].rate_hz == pytest.approx(20.0)


def leaving(width):
    """Vehicles that leave a picture of some width on the right, cut where it ends."""
    left = np.linspace(100.0, width - 5.0, 60)
    boxes = np.column_stack([left, np.full(60, 200.0), np.minimum(200.0, width - left), np.full(60, 40.0)])
    return Detections.from_rows(np.arange(60) / 20.0, np.full(60, "cam"), boxes, np.full(60, 0.9))


def test_pictures_of_several_sizes_stay_to_be_seen():
    base, small, large = load_config("default"), leaving(1224.0), leaving(1242.0)
    both = fit_input(base, small, large)[0]
    assert (both.input.picture, both.image.width) == ("seen", 1242.0)
    assert own_picture(both, small).image.width == 1224.0
    assert own_picture(both, large).image.width == 1242.0
    assert fit_input(base, large, large)[0].input.picture == "given"
    # One in which nothing comes to the edge says nothing of the size, nor does a vehicle parked there.
    assert fit_input(base, camera(0.0), large)[0].input.picture == "given"
    parked = camera(0.0)
    parked = replace(parked, boxes=np.tile([200.0, 200.0, 40.0, 30.0], (40, 1)))
    assert fit_input(base, parked, large)[0].input.picture == "given"


def test_calibration_keeps_to_what_each_recording_shows_of_its_picture():
    found = calibrate_without_truth([leaving(1224.0), leaving(1242.0)], load_config("default")).config
    assert found.input.picture == "seen"
    assert "width" not in config_to_dict(found)["image"]
    given = calibrate_without_truth(
        [leaving(1224.0), leaving(1242.0)], as_config(load_config("default"), (1242, 375))
    )
    assert (given.config.input.picture, given.config.image.width) == ("given", 1242.0)


def test_sensors_of_any_of_the_recordings_are_declared():
    config, notes = fit_input(load_config("default"), camera(0.0), camera(5.0, name="radar", rate=12.5))
    assert config.sensor_names == ("cam", "radar")
    assert config.sensors["radar"].rate_hz == pytest.approx(12.5)
    assert len([line for line in notes if "not declared" in line]) == 2


def test_two_scans_tell_no_rate():
    assumed = fit_input(load_config("default"), camera(0.0, scans=2, rate=3.0))[0].sensors["cam"].rate_hz
    assert assumed == 20.0


def test_only_a_rate_that_was_stated_is_held_against_the_scans():
    seen = camera(0.0, name="gantry", rate=25.0)
    score_alone = load_config("default", ["sensors.gantry.even_score=0.4"])
    stated = load_config("default", ["sensors.gantry.rate_hz=10"])
    assert fit_input(score_alone, seen)[1][0] == "sensor 'gantry' scans at 25 Hz"
    assert fit_input(stated, seen)[1][0] == "sensor 'gantry' scans at 25 Hz, not at 10"


def test_a_rate_that_cannot_be_measured_is_not_made_up():
    notes = fit_input(load_config("default"), camera(0.0, scans=2))[1]
    assert notes[0].endswith("taken for a detector; its scans are too few to tell a rate")


def test_a_sensor_declared_by_its_rate_alone_is_as_an_undeclared_one():
    seen = camera(0.0, name="gantry")
    declared = load_config("default", ["sensors.gantry={rate_hz: 20}"])
    assert fit_input(declared, seen)[0].sensors == fit_input(load_config("default"), seen)[0].sensors


def test_what_a_declared_sensor_says_itself_counts():
    said = load_config("default", ["sensors.gantry={rate_hz: 20, even_score: 0.4}"])
    sensor = fit_input(said, camera(0.0, name="gantry"))[0].sensors["gantry"]
    assert sensor == SensorConfig(rate_hz=20.0, even_score=0.4)


@pytest.mark.parametrize(("names", "idle"), [(("cam",), True), (("rgb",), False), (("cam", "evt"), False)])
def test_settings_of_sensors_that_are_not_there_are_named(names, idle):
    notes = fit_input(load_config("highway"), *[camera(0.0, name=name) for name in names])[1]
    line = "warning: what the configuration says of 'evt', 'rgb' has no effect: the sensors are 'cam'"
    assert (line in notes) == idle


def test_who_refuses_sensors_that_are_not_declared_gets_none_and_keeps_the_rates():
    strict = load_config("default", ["sensors.radar.rate_hz=10", "input.undeclared=refuse"])
    assert fit_input(strict, camera(0.0), camera(0.0, name="radar"))[0].sensors == strict.sensors


def test_a_preset_that_declares_no_sensors_by_itself_assumes_nothing_of_them():
    sensor = load_config("paper", ["sensors.gantry={rate_hz: 20}"]).sensors["gantry"]
    assert sensor == SensorConfig(rate_hz=20.0)


def across(end):
    """A vehicle that leaves a picture 640 px wide on the right; its boxes end there, or go on behind it."""
    left = 400.0 + 8.0 * np.arange(40)
    full = np.minimum(left + 100.0, end)
    boxes = np.column_stack([left, np.full(40, 200.0), full - left, np.full(40, 60.0)])[left < 640.0]
    n = len(boxes)
    return Detections.from_rows(np.arange(n) / 20.0, np.full(n, "cam"), boxes, np.full(n, 0.9))


@pytest.mark.parametrize(("end", "clip"), [(640.0, True), (1e3, False)])
@pytest.mark.parametrize("wanted", [True, False])
def test_boxes_end_at_the_edge_where_the_detectors_boxes_do(end, clip, wanted):
    """`output.clip` asks for that; boxes that reach beyond the picture are left as they are."""
    tracks = track(across(end), load_config("default", [f"output.clip={wanted}"]), image=(640, 480))
    reach = tracks.causal.boxes[:, 0] + tracks.causal.boxes[:, 2]
    assert (reach.max() <= 640.0) == (clip and wanted)
    assert reach.max() > 639.0
