"""Live use of the engines: late scans, other clocks, checkpoints, sensors that nobody declared."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from jeat_graph import Tracker, Trajectories, load_config
from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError, TimeOrderError, UnknownSensorError
from jeat_graph.data.scan import Scan
from jeat_graph.live.late import LiveTracker

_PICTURE = ["image.width=1280", "image.height=720", "input.picture=given"]
CONFIG = load_config("default", [*_PICTURE, "smoother.lag_s=.4", "live.late_s=.3"])
WHOLE = load_config("default", [*_PICTURE, "smoother.engine=full", "live.late_s=.3"])
PAPER = load_config("paper", [*_PICTURE, "smoother.lag_s=.4", "live.late_s=.3"])


def traffic(times=80, seed=0, sensors=("cam", "evt"), classes=True):
    """Scans of two sensors in order of time: ten objects, some false boxes."""
    rng = np.random.default_rng(seed)
    place, speed = rng.uniform(150, 500, (10, 2)), rng.normal(0, 60, (10, 2))
    for k in range(times):
        for s, sensor in enumerate(sensors):
            if s == 0 and k % 2:
                continue
            seen = np.flatnonzero(rng.random(10) < 0.85)
            corner = (place + speed * 0.05 * k)[seen] + rng.normal(0, 1, (len(seen), 2))
            stray = rng.uniform(0, 600, (rng.poisson(0.4), 2))
            corner = np.concatenate([corner, stray])
            boxes = np.concatenate([corner, np.full(corner.shape, 40.0)], axis=1)
            names = [("car", "van")[n % 2] for n in seen] + [""] * len(stray)
            yield Scan(
                0.05 * k + 0.011 * s,
                sensor,
                boxes,
                rng.uniform(0.3, 1, len(boxes)),
                names if classes else None,
            )


def columns(table):
    """All columns of a table but the identities, as bytes; rows in order of time and place."""
    order = np.lexsort((table.boxes[:, 1], table.boxes[:, 0], table.t))
    table = table.take(order)
    names = () if table.classes is None else (table.classes.tolist(), table.class_probability.tobytes())
    numbers = (table.t, table.boxes, table.existence, table.mean, table.var, table.used)
    return (*(one.tobytes() for one in numbers), *names)


def shuffled(scans, seed, late_s=0.25):
    """The scans in an order of arrival in which none comes later than is allowed."""
    delay = np.random.default_rng(seed).uniform(0, late_s, len(scans))
    return [
        scans[k]
        for k in np.argsort([scan.t + d for scan, d in zip(scans, delay, strict=True)], kind="stable")
    ]


def settled(tracker, scans):
    """All smoothed rows, one by one as they become final, in order of time and place."""
    parts = []
    for scan in scans:
        tracker.step(scan)
        parts.append(tracker.drain_smoothed())
    parts.append(tracker.finish())
    rows = [row for part in parts for row in _rows(part)]
    return sorted(rows)


def _rows(table):
    for k in range(len(table)):
        yield (float(table.t[k]), *table.boxes[k].tolist(), float(table.existence[k]), str(table.classes[k]))


@pytest.mark.parametrize(
    ("config", "seed"),
    [(CONFIG, 0), (CONFIG, 1), (WHOLE, 0), (PAPER, 0)],
    ids=["lag", "another lag", "whole", "paper"],
)
def test_scans_that_come_late_give_the_rows_of_scans_in_order_to_the_last_bit(config, seed):
    scans = list(traffic(seed=seed))
    plain = Tracker(config)
    live = LiveTracker(Tracker(config))
    assert settled(live, shuffled(scans, seed)) == settled(plain, scans)
    assert live.replayed > 20
    assert columns(live.causal()) == columns(plain.causal())


@pytest.mark.parametrize("config", [CONFIG, PAPER], ids=["core", "paper"])
def test_the_first_scan_of_a_sensor_may_come_late_too(config):
    scans = list(traffic(times=20, sensors=("zed", "abe")))
    plain, live = Tracker(config), LiveTracker(Tracker(config))
    for scan in scans:
        plain.step(scan)
    for scan in [scans[1], scans[0], *scans[2:]]:
        live.step(scan)
    assert columns(live.causal()) == columns(plain.causal())
    assert live.causal().sensors == plain.causal().sensors


@pytest.mark.parametrize("policy", ["rewind", "skip", "refuse"])
@pytest.mark.parametrize("config", [CONFIG, WHOLE], ids=["lag", "whole"])
def test_a_stream_goes_on_from_a_checkpoint_with_the_same_bytes(config, policy, tmp_path):
    scans = list(traffic())
    arrivals = shuffled(scans, 3) if policy == "rewind" else scans
    whole, first = (LiveTracker(Tracker(config), policy) for _ in range(2))
    expected = [columns(whole.step(scan).table) for scan in arrivals]
    found = [columns(first.step(scan).table) for scan in arrivals[:50]]
    first.save(tmp_path / "state.npz", {"note": 3})
    second, more = LiveTracker.load(tmp_path / "state.npz")
    assert more == {"note": 3}
    found += [columns(second.step(scan).table) for scan in arrivals[50:]]
    assert found == expected
    assert columns(second.finish()) == columns(whole.finish())


@pytest.mark.parametrize(
    "settings",
    [
        ["--config", "paper"],
        ["--set", "tracker.engine=reference", "--set", "smoother.engine=full"],
    ],
)
def test_a_checkpoint_of_an_engine_that_is_not_saved_is_refused_before_anything(settings, tmp_path, capsys):
    ends = ["--checkpoint", str(tmp_path / "state.npz"), "--smoothed", str(tmp_path / "s.csv")]
    assert main(["stream", *settings, *ends]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--checkpoint does not go with tracker.engine=" in line
    assert not list(tmp_path.iterdir())
    with pytest.raises(ConfigError, match="is not saved"):
        LiveTracker(Tracker(PAPER)).save(tmp_path / "state.npz")


@pytest.mark.parametrize(("policy", "late"), [("skip", 1), ("refuse", 0)])
def test_late_scans_are_passed_over_or_refused(policy, late):
    live = LiveTracker(Tracker(CONFIG), policy)
    scans = list(traffic(times=10))
    for scan in scans[2:]:
        live.step(scan)
    if policy == "refuse":
        with pytest.raises(TimeOrderError):
            live.step(scans[0])
    else:
        assert len(live.step(scans[0]).dropped) == late


def test_a_clock_that_is_set_back_lets_time_begin_anew_and_what_was_learnt_stays():
    live = LiveTracker(Tracker(load_config("default", [*_PICTURE, "smoother.lag_s=.4", "live.jump_s=1"])))
    for scan in traffic(times=60):
        live.step(scan)
    learnt, born = live.tracker.sensor_states(), live.tracker.num_born
    anew = [live.step(Scan(scan.t - 500.0, *_rest(scan))) for scan in traffic(times=60)]
    assert any(one.reset for one in anew)
    assert live.time < 0.0
    assert live.tracker.num_born > born
    assert live.causal().track_id.min() > born
    assert live.tracker.sensor_states()["cam"].p_detect == pytest.approx(learnt["cam"].p_detect, abs=0.1)
    assert np.isfinite(live.finish().mean).all()


def _rest(scan):
    return scan.sensor, scan.boxes, scan.scores, scan.classes


def test_a_sensor_that_nobody_declared_is_met_or_refused():
    strict = load_config("default", [*_PICTURE, "sensors.rgb={}", "input.undeclared=refuse"])
    live, tracker = LiveTracker(Tracker(strict)), Tracker(strict)
    for one in (live, tracker):
        with pytest.raises(UnknownSensorError, match="nobody"):
            one.step((0.0, "nobody", [[1, 1, 20, 20]], [0.5]))
    met = LiveTracker(Tracker(CONFIG))
    met.step((0.0, "rgb", [[1, 1, 20, 20]], [0.5]))
    met.step((0.1, "somebody", [[1, 1, 20, 20]], [0.5]))
    assert "somebody" in met.tracker.config.sensors
    assert met.lateness.summary()["somebody"].scans == 1


def no_number(name):
    raise AssertionError(f"{name} is no JSON")


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_a_stream_of_sensors_that_nobody_declared_ends_with_a_record(preset, tmp_path, monkeypatch):
    box = {"boxes": [[100, 100, 40, 30]], "scores": [0.9]}
    lines = [json.dumps({"t": 0.05 * k, "sensor": ("cam", "evt")[k % 2], **box}) for k in range(80)]
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO("\n".join(lines).encode())))
    record = tmp_path / "record.json"
    assert main(["stream", "--config", preset, "--record", str(record)]) == 0
    learnt = json.loads(record.read_text(), parse_constant=no_number)["learnt"]
    assert {"cam", "evt"} <= learnt.keys()
    rows = [f"{0.05 * k},cam,100,100,40,30,0.9" for k in range(40)]
    table = tmp_path / "d.csv"
    table.write_text("\n".join(["t,sensor,left,top,width,height,score", *rows]))
    assert main(["track", str(table), "--config", preset, "--out", str(tmp_path / "run")]) == 0
    run = json.loads((tmp_path / "run" / "run.json").read_text(), parse_constant=no_number)
    assert "cam" in run["learnt"]


@pytest.mark.parametrize("engine", ["fixed-lag", "full"])
def test_scans_of_one_time_that_come_one_by_one_are_one_smoothed_row(engine):
    live = LiveTracker(Tracker(load_config("default", [*_PICTURE, f"smoother.engine={engine}"])), "skip")
    parts = []
    for k in range(60):
        for sensor in ("evt", "rgb"):
            live.step((0.05 * k, sensor, [[100.0 + 3 * k, 200.0, 80.0, 60.0]], [0.9]))
            parts.append(live.drain_smoothed())
    rows = Trajectories.concatenate([*parts, live.finish()])
    assert len(rows) == len(set(zip(rows.t.tolist(), rows.track_id.tolist(), strict=True))) == 60
    assert set(rows.sensor_text()) == {"evt|rgb"}


def test_what_will_be_is_said_by_the_identities_that_were_given_out():
    live = LiveTracker(Tracker(CONFIG))
    for scan in shuffled(list(traffic(times=40)), 1):
        live.step(scan)
    now, soon = live.causal(), live.predict(live.time + 0.2)
    assert set(soon.track_id.tolist()) <= set(now.track_id.tolist())
    assert (np.diff(soon.track_id) > 0).all()


def test_boxes_of_a_sensor_with_a_picture_of_its_own_go_to_the_common_one():
    half = load_config("default", [*_PICTURE, "sensors.small={rate_hz: 20, image: [640, 360]}"])
    live, direct, plain = LiveTracker(Tracker(half)), Tracker(half), Tracker(CONFIG)
    for scan in traffic(times=20, sensors=("cam",)):
        own = Scan(scan.t, "small", scan.boxes / 2.0, scan.scores)
        live.step(own)
        direct.step(own)
        plain.step((scan.t, "small", scan.boxes, scan.scores))
    assert len(plain.causal())
    for made in (live.causal(), direct.causal()):
        np.testing.assert_allclose(made.boxes, plain.causal().boxes, atol=1e-6)
