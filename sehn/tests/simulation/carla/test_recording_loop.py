"""The recording loop, against a fake of the client: what is recorded, and what the server is left with."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph_sehn.simulation.carla.session import client_api
from jeat_graph_sehn.simulation.carla.streams import depth_of
from jeat_graph_sehn.simulation.dataset.protocol import Protocol
from jeat_graph_sehn.simulation.dataset.recording import record_dataset
from jeat_graph_sehn.simulation.dataset.verify import verify


def test_frames_are_those_of_every_fourth_tick(make_source, types) -> None:
    source, _ = make_source(types=types)
    steps = list(source.segment(0))
    assert [step.t_us for step in steps] == [50_000, 100_000, 150_000]
    ticks = [int(step.rgb[0, 0, 0]) for step in steps]
    assert np.diff(ticks).tolist() == [4, 4]
    assert steps[0].rgb.shape == (48, 64, 3)
    assert steps[0].rgb[0, 0].tolist()[1:] == [2, 3]  # red, green, blue


@pytest.mark.parametrize("delay", [0, 1, 4])
def test_every_event_is_given_once_with_the_frame_it_belongs_to(make_source, delay: int) -> None:
    source, api = make_source(dvs_delay=delay)
    steps = list(source.segment(0))
    world = api.Client.world
    last_tick = world.frame - 4  # the loop runs one frame on
    start_ns = round((world.time - 4 * 4 * 0.0125) * 1e9)
    sent = np.concatenate([rows for tick, rows in world.sent if last_tick - 12 < tick <= last_tick])
    got = np.concatenate([step.events.t_us for step in steps])
    assert np.abs(np.sort(got) - np.sort((sent["t"] - start_ns) // 1000)).max() <= 1
    begin = 0
    for step in steps:
        assert (step.events.t_us >= begin - 1).all()
        assert (step.events.t_us <= step.t_us).all()
        begin = step.t_us


def test_events_more_than_a_frame_late_are_an_error_not_a_loss(make_source) -> None:
    source, _ = make_source(dvs_delay=6)
    with pytest.raises(DataError, match="came more than a frame late"):
        list(source.segment(0))


def test_an_event_camera_that_never_calls_back_does_not_hang_the_loop(make_source) -> None:
    source, _ = make_source(quiet=True)
    steps = list(source.segment(0))
    assert [len(step.events) for step in steps] == [0, 0, 0]


def test_a_picture_that_does_not_come_is_one_line(make_source) -> None:
    source, _ = make_source(rgb_until=108)
    with pytest.raises(DataError, match=r"no RGB data of tick 109 within 0\.2 s"):
        list(source.segment(0))


def left_alone(api) -> bool:
    world = api.Client.world
    return (
        not world.settings.synchronous_mode
        and not api.Client.traffic.synchronous
        and world.actors == {}
        and world.lights.on == {"a", "b"}
        and world.lights.cycle
        and world.weather.sun_altitude_angle == 0.0
    )


@pytest.mark.parametrize("behaviour", [{}, {"rgb_until": 108}, {"dies_at": 110}, {"dvs_delay": 6}])
def test_the_server_is_left_as_it_was_whatever_happens(make_source, behaviour) -> None:
    source, api = make_source(**behaviour)
    try:
        list(source.segment(0))
    except DataError:
        assert behaviour
    assert left_alone(api)


def test_a_recording_that_is_given_up_leaves_the_server_as_it_was(make_source) -> None:
    source, api = make_source()
    steps = source.segment(0)
    next(steps)
    assert not left_alone(api)
    steps.close()
    assert left_alone(api)


@pytest.mark.parametrize(
    ("scenario", "sun", "lamps"),
    [("day", 45.0, frozenset()), ("night", -30.0, frozenset("abc")), ("night-nolight", -30.0, frozenset())],
)
def test_the_scenario_says_sun_and_street_lamps(make_source, scenario: str, sun: float, lamps) -> None:
    source, api = make_source(scenario)
    list(source.segment(0))
    during = [row for row in api.Client.world.history if row[1] is not None]
    assert set(during) == {(sun, lamps)}


def test_vehicles_have_their_lights_on_at_night_only(make_source) -> None:
    for scenario, lights in (("night", 3), ("day", None)):
        source, api = make_source(scenario)
        steps = source.segment(0)
        next(steps)
        cars = [a for a in api.Client.world.actors.values() if a.blueprint.id.startswith("vehicle")]
        assert cars
        assert {a.lights for a in cars} == {lights}
        assert all(a.autopilot for a in cars)
        steps.close()


def places(source, api, index: int) -> list[tuple[float, float]]:
    steps = source.segment(index)
    next(steps)
    cars = [a for a in api.Client.world.actors.values() if a.blueprint.id.startswith("vehicle")]
    steps.close()
    return [(a.start.location.x, a.start.location.y) for a in cars]


def test_vehicles_begin_within_150_m_ahead_with_room_between_them(make_source) -> None:
    source, api = make_source()
    camera_x = source.calibration()["position_m"][0]
    found = np.array(places(source, api, 0))
    assert len(found) > 8
    assert (found[:, 0] - camera_x >= 10.0).all()
    assert (found[:, 0] - camera_x <= 150.0).all()
    for lane in set(found[:, 1]):
        assert (np.diff(np.sort(found[found[:, 1] == lane, 0])) >= 12.0).all()


def test_each_segment_has_vehicles_of_its_own_by_the_seed(make_source) -> None:
    source, api = make_source()
    first, second, again = (places(source, api, k) for k in (0, 1, 0))
    assert first == again
    assert first != second
    other, other_api = make_source(seed=1)
    assert places(other, other_api, 0) != first
    seeds = api.Client.traffic.seeds
    assert seeds[0] == seeds[2] != seeds[1]


def test_the_event_camera_has_the_parameters_of_the_paper(make_source) -> None:
    source, api = make_source()
    steps = source.segment(0)
    next(steps)
    (dvs,) = (a.blueprint for a in api.Client.world.actors.values() if a.blueprint.id.endswith("dvs"))
    steps.close()
    values = {
        name: float(dvs.attributes[name]) for name in dvs.attributes if dvs.attributes[name][:1].isdigit()
    }
    assert values["sigma_positive_threshold"] == values["sigma_negative_threshold"] == 0.0
    assert values["refractory_period_ns"] == 10_000
    assert values["log_eps"] == 0.01
    assert dvs.attributes["use_log"] == "true"


def test_a_set_from_carla_has_the_files_of_any_other_and_is_sound(make_source, tmp_path) -> None:
    source, api = make_source()
    manifest = record_dataset(lambda: source, tmp_path / "set", Protocol(2))
    assert manifest["totals"]["frames"] == 6
    assert manifest["totals"]["boxes"] > 0
    assert list(verify(tmp_path / "set")) == []
    assert left_alone(api)


def test_another_town_is_changed_for_town04(make_source) -> None:
    source, api = make_source()
    api.Client.world.map.name = "Carla/Maps/Town10HD"
    source.calibration()
    assert api.Client.world.map.name.endswith("Town04")


def test_depth_is_decoded_as_documented() -> None:
    code = round(37.5 / 1000.0 * (2**24 - 1))
    pixel = bytes([code >> 16, code >> 8 & 255, code & 255, 255])  # blue, green, red, alpha
    image = SimpleNamespace(width=2, height=1, raw_data=pixel * 2)
    assert depth_of(image) == pytest.approx(np.full((1, 2), 37.5), abs=1e-4)


def test_no_server_is_one_line(make_source) -> None:
    source, _ = make_source(down=True)
    with pytest.raises(DataError, match="no server at localhost:2000"):
        source.calibration()


def test_a_missing_client_package_is_one_line(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "carla", None)
    with pytest.raises(ConfigError, match=r"pip install './sehn\[carla\]'"):
        client_api()
