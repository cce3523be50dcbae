"""`stream` finds the clocks of running sensors: within a minute, to the ms, or it leaves them as they are."""

from __future__ import annotations

import io
import json
from functools import cache
from itertools import groupby

import numpy as np
import pandas as pd
import pytest

from jeat_graph import evaluate, load_config
from jeat_graph.cli.main import main
from jeat_graph.data.detections import Scan
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.streams.scan_batch import ScanBatch
from jeat_graph.live.clock_watch import ClockWatch
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.messages import ScanMessage
from jeat_graph.live.service.metrics import Metrics
from jeat_graph.live.service.status import Status
from jeat_graph.live.session import Ends, Session
from jeat_graph.tracking.tracker import Tracker

SETTINGS = ["image.width=1920", "image.height=1080", "smoother.engine=none"]
SETTINGS += ["sensors.rgb.rate_hz=10", "sensors.evt.rate_hz=25"]
CONFIG = load_config("default", SETTINGS)
SECONDS, MINUTE_S = 76, 60.0
RATES = {"rgb": (10, 0.0), "evt": (25, 0.003)}


def vehicles(seconds: float = SECONDS, seed: int = 1):
    """Vehicles of both directions, one every two seconds: speed (px/s), scale, and when each enters (s)."""
    rng = np.random.default_rng(seed)
    enters = np.arange(-4.0, seconds, 2.0)
    speed = rng.uniform(200, 400, len(enters)) * np.where(np.arange(len(enters)) % 2, -1, 1)
    return speed, rng.uniform(0.7, 1.4, len(enters)), enters


def seen(t: float, traffic, lower: float = 0.0):
    """Boxes (N, 4) at a time, and whose they are."""
    speed, scale, enters = traffic
    w, h = 80 * scale, 60 * scale
    x = np.where(speed > 0, 0, 1920) + speed * (t - enters)
    y = 300 + 250 * (np.arange(len(speed)) % 2) + lower
    there = np.flatnonzero((t > enters - 1) & (x > w / 2) & (x < 1920 - w / 2))
    return np.column_stack([x - w / 2, y - h / 2, w, h])[there], there


def sensor(
    name: str, late_s: float = 0.0, traffic=None, seconds: float = SECONDS
) -> list[tuple[float, Scan]]:
    """Scans of a near-perfect detector whose clock is late, each with its true time."""
    rng = np.random.default_rng(sum(map(ord, name)))
    rate, begin = RATES[name]
    scans = []
    for k in range(round(seconds * rate)):
        t = k / rate + begin
        boxes, _ = seen(t, traffic or vehicles())
        boxes = boxes + np.column_stack([rng.normal(0, 1, (len(boxes), 2)), np.zeros((len(boxes), 2))])
        scans.append((t, Scan(round(t + late_s, 6), name, boxes, rng.uniform(0.55, 0.97, len(boxes)))))
    return scans


def both(late_s: float, arrival: str) -> list[Scan]:
    """Scans of both sensors, of which `evt` is late: in the order of their stamps, or of the true time."""
    scans = sensor("rgb") + sensor("evt", late_s)
    return [scan for _, scan in sorted(scans, key=lambda one: one[1].t if arrival == "stamps" else one[0])]


def truth() -> pd.DataFrame:
    rows = []
    for k in range(round((SECONDS - 1) * 10)):
        boxes, whose = seen(k / 10, vehicles())
        rows += [(k / 10, v, *box) for v, box in zip(whose, boxes, strict=True)]
    return pd.DataFrame(rows, columns=["t", "object_id", "left", "top", "width", "height"])


def message(scan: Scan) -> ScanMessage:
    return ScanMessage(ScanBatch([scan], [1]), "", None)


class Lived:
    """A session that has run, with what it gave out: as CSV has it, no rows after a late scan."""

    def __init__(self, scans, config=CONFIG, live=None, more=None, checkpoint=None) -> None:
        self.said: list[str] = []
        self.events: list = []
        self.answers: list[tuple[float, Trajectories]] = []
        self.all: list[tuple[float, bytes]] = []
        ends = Ends(tracks=self._take, event=self.events.append, warn=self.said.append)
        self.live = LiveTracker(Tracker(config)) if live is None else live
        self.session = Session(self.live, ends, checkpoint, 10.0, more)
        for scan in scans:
            self.session.accept(message(scan))

    def _take(self, t, table, _, late_s) -> None:
        self.all.append((t, table.boxes.tobytes() + table.track_id.tobytes()))
        if late_s == 0.0:
            self.answers.append((t, table))

    def mota(self) -> float:
        """Of the minute's end on."""
        gt = truth()
        tables = [table for t, table in self.answers if t >= MINUTE_S]
        found = evaluate(Trajectories.concatenate(tables), gt[gt.t > MINUTE_S], outside="ignored")
        return float(found["causal"]["MOTA"])


@cache
def usual(late_s: float, arrival: str) -> Lived:
    """A session that is looked at by several tests."""
    return Lived(both(late_s, arrival))


@pytest.fixture(scope="module")
def without() -> float:
    return usual(0.0, "stamps").mota()


@pytest.mark.parametrize(
    ("late_s", "arrival"), [(0.15, "true"), (1.0, "true"), (1.0, "stamps"), (10.0, "stamps")]
)
def test_within_a_minute_an_offset_costs_nothing_any_more(late_s, arrival, without):
    lived = usual(late_s, arrival)
    (clock,) = lived.live.clocks.values()
    assert lived.live.clocks.keys() == {"evt"}
    assert clock["lag_s"] == pytest.approx(late_s, abs=1.5e-3)
    assert clock["std_s"] < 1e-3
    assert clock["at_s"] < MINUTE_S
    assert without > 97.0
    assert lived.mota() == pytest.approx(without, abs=1.0)


def test_it_is_said_once_and_stands_in_the_record_and_on_the_output():
    lived = usual(1.0, "true")
    lines = [line for line in lived.said if "sensor 'evt': its times are " in line]
    assert len(lines) == 1
    assert lived.session.summary()["clocks"] == lived.live.clocks
    (event,) = [one for one in lived.events if one.what == "clock"]
    told = json.loads(event.line())
    assert told["event"] == "sensor-clock"
    assert told["sensor"] == "evt"
    assert told["lag_s"] == lived.live.clocks["evt"]["lag_s"]


@pytest.mark.parametrize("late_s", [1.0, 10.0])
def test_nothing_is_lost_or_given_out_twice_where_others_wait_for_the_slow_one(late_s):
    scans = both(late_s, "stamps")
    lived = usual(late_s, "stamps")
    at_s = lived.live.clocks["evt"]["at_s"]
    times = [t for t, _ in lived.answers]
    assert times == sorted(times)
    assert len(set(times)) == len(times)
    # From when the slow one has caught up, each scan of both that came in time has its answer.
    wanted = {scan.t for scan in scans if scan.sensor == "rgb" and at_s < scan.t < SECONDS - 1}
    assert wanted <= set(times)
    assert lived.live.lateness.summary()["rgb"].dropped == 0
    dropped = lived.live.lateness.summary()["evt"].dropped
    assert dropped == pytest.approx(25 * (late_s - 0.3), abs=3)  # from before what had been reached
    assert sum("answers wait" in line for line in lived.said) == 1


def test_who_wants_no_waiting_has_none():
    config = load_config("default", [*SETTINGS, "live.wait_s=0"])
    lived = Lived(both(1.0, "stamps"), config)
    assert sum("is more than answers wait" in line for line in lived.said) == 1
    assert max(t for t, _ in lived.answers) > SECONDS - 0.2
    assert lived.mota() > 97.0  # of one sensor alone


@pytest.mark.parametrize("policy", ["skip", "refuse"])
def test_where_no_scan_may_come_late_others_wait_too(policy):
    lived = Lived(both(0.15, "stamps")[:1400], live=LiveTracker(Tracker(CONFIG), policy))
    assert lived.live.clocks["evt"]["lag_s"] == pytest.approx(0.15, abs=1.5e-3)
    assert lived.live.lateness.summary()["evt"].dropped <= 6  # those of the .15 s that had gone by


@pytest.mark.parametrize(("arrival", "stop"), [("stamps", 1300), ("true", 900)])
def test_a_restart_goes_on_with_the_clock_and_gives_the_same(stop, arrival, tmp_path):
    """It is stopped while it compares, and while others wait; the input is given once more."""
    scans = both(2.0, arrival)[:1600]
    whole = Lived(scans)
    path = tmp_path / "state.npz"
    first = Lived(scans[:stop], checkpoint=path)
    first.session.save()
    saved = len(first.all)
    live, more = LiveTracker.load(path, CONFIG)
    again = Lived(scans, live=live, more=more)
    assert again.live.clocks == whole.live.clocks
    assert first.all[:saved] + again.all == whole.all
    if arrival == "stamps":  # what is too late in any case may count as given once more
        assert again.session.summary()["lateness"] == whole.session.summary()["lateness"]


def test_without_an_offset_nothing_changes():
    scans = both(0.0, "stamps")[:1500]
    found, believed = (
        Lived(scans, load_config("default", [*SETTINGS, f"input.clocks={how}"]))
        for how in ("find", "as_given")
    )
    assert found.all == believed.all
    assert found.said == believed.said
    assert found.events == believed.events == []
    assert found.live.clocks == {}


@pytest.mark.parametrize(
    "setting",
    [
        "input.clocks=as_given",
        "sensors.evt.clock={offset_s: 0.1}",
        "sensors.rgb.clock={offset_s: 0}",
        "sensors.evt.latency_s=0.1",
    ],
)
def test_who_says_the_clocks_is_believed(setting):
    watch = ClockWatch(load_config("default", [*SETTINGS, setting]))
    assert all(watch.saw([scan]) is None for scan in both(0.5, "stamps")[:1500])
    assert watch.clocks == {}


def opposed() -> list[Scan]:
    """The same places, quite other vehicles."""
    scans = sensor("rgb")
    for t, scan in sensor("evt"):
        boxes = scan.boxes.copy()
        boxes[:, 0] = 1920 - boxes[:, 0] - 1.8 * boxes[:, 2]
        boxes[:, 1] -= 0.8 * boxes[:, 3]
        boxes[:, 2:] *= 2.6
        scans.append((t, Scan(scan.t, "evt", boxes, scan.scores)))
    return [scan for _, scan in sorted(scans, key=lambda one: one[0])]


def test_detectors_that_never_agree_are_told_of_once_with_what_to_do():
    watch = ClockWatch(CONFIG)
    told = [news.lines for scan in opposed() if (news := watch.saw([scan])) is not None]
    ((line,),) = told
    assert "never the same ones, by whatever their clocks differ" in line
    assert "jeat-graph register" in line
    assert "--set input.clocks=as_given" in line
    assert watch.clocks == {}


def test_one_comparison_alone_is_not_believed(monkeypatch):
    """A row of vehicles at equal distances fits at several differences of the clocks."""
    from jeat_graph.live import clock_watch
    from jeat_graph.runs.clock_comparison import ClockComparison, FoundClock

    lags = iter([0.5, 1.5, 2.5, 2.501])

    def compare(*_, **__):
        yield
        return ClockComparison(False, FoundClock(next(lags), 1e-3, True), "")

    monkeypatch.setattr(clock_watch, "compare_in_steps", compare)
    watch, found = ClockWatch(CONFIG), []
    for scan in both(0.0, "stamps"):
        if watch.saw([scan]) is not None:
            found.append(scan.t)
            break
    assert found == [pytest.approx(60.0, abs=0.5)]
    assert [one["lag_s"] for one in watch.clocks.values()] == [2.501]


def test_a_single_wrong_time_does_not_end_what_was_heard():
    watch = ClockWatch(CONFIG)
    for k, scan in enumerate(both(0.5, "stamps")):
        wrong = [Scan(scan.t + 1e6, scan.sensor, scan.boxes, scan.scores)] if k == 500 else []
        for one in [*wrong, scan]:
            if watch.saw([one]) is not None:
                assert watch.clocks["evt"]["at_s"] < 40.0
                return
    pytest.fail("no clock was found")


def test_a_third_sensor_is_brought_to_the_others_when_it_comes():
    RATES["lidar"] = (20, 0.007)
    traffic = vehicles(110.0)
    scans = sensor("rgb", 0.0, traffic, 110.0) + sensor("evt", 0.5, traffic, 110.0)
    scans += [one for one in sensor("lidar", -0.7, traffic, 110.0) if one[0] > 60.0]
    watch = ClockWatch(CONFIG)
    for _, scan in sorted(scans, key=lambda one: one[0]):
        lag_s = watch.lag_s(scan.sensor)
        watch.saw([Scan(scan.t - lag_s, scan.sensor, scan.boxes, scan.scores)])
    assert watch.clocks["evt"]["lag_s"] == pytest.approx(0.5, abs=1.5e-3)
    # Those that are known stay as they are: a clock that is early is set forward.
    assert watch.clocks["lidar"]["lag_s"] == pytest.approx(-0.7, abs=1.5e-3)
    assert watch.clocks.keys() == {"evt", "lidar"}


def test_each_message_costs_little():
    """Steps of the work are bounded in number, and so is what is kept."""
    watch = ClockWatch(CONFIG)
    most = 0
    for scan in both(0.5, "stamps"):
        before = watch.state()["done"]
        watch.saw([scan])
        most = max(most, watch.state()["done"] - before)
        kept = watch.state()["heard"].values()
        assert all(one["scans"][-1].t - one["scans"][0].t <= 60.0 for one in kept)
        if watch.clocks:
            break
    assert 0 < most <= 25


def test_stream_finds_it_and_the_record_has_it(tmp_path, monkeypatch, capsys):
    lines = "".join(
        json.dumps({"t": t, "sensor": name, "boxes": scan.boxes.tolist(), "scores": scan.scores.tolist()})
        + "\n"
        for (t, name), some in groupby(both(0.5, "true")[:1400], key=lambda scan: (scan.t, scan.sensor))
        for scan in some
    )
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(lines.encode())))
    record = tmp_path / "record.json"
    assert main(["stream", "--image", "1920x1080", "--record", str(record)]) == 0
    caught = capsys.readouterr()
    assert caught.err.count("sensor 'evt': its times are ") == 1
    assert json.loads(record.read_text())["clocks"]["evt"]["lag_s"] == pytest.approx(0.5, abs=1.5e-3)
    events = [one for text in caught.out.splitlines() if "event" in (one := json.loads(text))]
    assert [one["event"] for one in events if one["event"] == "sensor-clock"] == ["sensor-clock"]


def test_a_service_shows_the_clock_of_each_sensor():
    status = Status("gantry7", 10.0)
    lived = usual(0.15, "true")
    status.came([scan for _, scan in sensor("rgb", seconds=1.0) + sensor("evt", seconds=1.0)], ["rgb", "evt"])
    status.clocks = lived.live.clocks
    shown = status.health()["sensors"]
    assert shown["rgb"]["clock"] is None
    assert shown["evt"]["clock"]["lag_s"] == pytest.approx(0.15, abs=1.5e-3)
    pytest.importorskip("prometheus_client", reason="pip install 'prometheus-client>=0.21,<1'")
    text = Metrics(status).text().decode()
    assert f'jeat_graph_sensor_clock_lag_seconds{{sensor="evt"}} {shown["evt"]["clock"]["lag_s"]}' in text
    assert 'lag_seconds{sensor="rgb"}' not in text
