"""The table of diagnostics: what `track --diagnostics` says of each update."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.cli.main import main
from jeat_graph.data.detections import Detections
from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.io.tables.diagnostics_io import COLUMNS, DiagnosticsWriter, read_diagnostics
from jeat_graph.io.tables.trajectories_io import read_trajectories
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import record

HEAD = ",".join(COLUMNS)


@pytest.fixture(scope="module")
def recording():
    return record(load_scenario("night"), 5, 2.0).detections


@pytest.fixture(scope="module")
def tracked(tmp_path_factory, recording):
    """A folder with the recording, as `d.csv`, and the run of it with the option, `run`."""
    folder = tmp_path_factory.mktemp("tracked")
    write_detections(recording, folder / "d.csv")
    assert main(["track", str(folder / "d.csv"), "--out", str(folder / "run"), "--diagnostics"]) == 0
    return folder


def collect(config, detections):
    tracker = Tracker(config, diagnostics=True)
    parts = []
    for batch in detections.batches():
        tracker.step(batch)
        parts.append(tracker.last_updates())
    return Diagnostics.concatenate(parts)


def still(noise_px: float, scans: int = 400) -> Detections:
    """One box that stands still, with noise on each of its sides."""
    rng = np.random.default_rng(0)
    sides = np.array([500.0, 300.0, 580.0, 360.0]) + noise_px * rng.standard_normal((scans, 4))
    boxes = np.hstack([sides[:, :2], sides[:, 2:] - sides[:, :2]])
    return Detections.from_rows(np.arange(scans) / 20.0, np.full(scans, "rgb"), boxes, np.full(scans, 0.9))


KNOWN = ["sensors={rgb: {rate_hz: 20}, evt: {rate_hz: 100}}", "image={width: 1280, height: 720}"]
#: What is assumed of a side's noise before anything is learnt, of a box 80 x 60 px (px).
ASSUMED_PX = ModelConstants().side_std * np.sqrt(80.0 * 60.0)


def test_nis_is_chi_square_where_the_noise_is_as_assumed():
    table = collect(load_config("default", KNOWN), still(ASSUMED_PX))
    assert np.isnan(table.nis[0]), "what begins a track was not expected"
    # Of 200 numbers of chi square with two degrees of freedom the mean is 2 ± 0.14; the noise that is learnt
    # meanwhile may be wrong by a third.
    assert table.nis[200:].mean() == pytest.approx(2.0, rel=0.35)


def test_noise_scale_follows_the_noise_that_is_seen():
    less, more = (collect(load_config("default", KNOWN), still(k * ASSUMED_PX)) for k in (0.3, 1.5))
    assert less.noise_scale[-1] < 1.0 < more.noise_scale[-1]
    assert less.nis[200:].mean() < more.nis[200:].mean()


def test_each_update_of_a_reported_track_stands_in_the_column_sensors(tracked):
    causal = read_trajectories(tracked / "run" / "causal.csv")
    table = read_diagnostics(tracked / "run" / "diagnostics.csv")
    told = {
        (t, i, name)
        for t, i, text in zip(causal.t, causal.track_id, causal.sensor_text(), strict=True)
        for name in text.split("|")
        if name
    }
    logged = {(t, i, table.sensors[s]) for t, i, s in zip(table.t, table.track_id, table.sensor, strict=True)}
    assert told <= logged
    confirmed = set(zip(causal.t, causal.track_id, strict=True))
    assert {one for one in logged if one[:2] in confirmed} == told


def test_the_option_changes_no_byte_of_the_other_tables_and_without_it_its_table_goes(tmp_path, tracked):
    source, out = tracked / "d.csv", tmp_path / "run"
    assert main(["track", str(source), "--out", str(out), "--diagnostics"]) == 0
    assert (out / "diagnostics.csv").read_bytes() == (tracked / "run" / "diagnostics.csv").read_bytes()
    assert main(["track", str(source), "--out", str(out)]) == 0
    assert not (out / "diagnostics.csv").exists()
    for file in ("causal.csv", "smoothed.csv"):
        assert (out / file).read_bytes() == (tracked / "run" / file).read_bytes()


def test_it_works_without_a_smoother_too(recording):
    with_smoother = collect(load_config("default", KNOWN), recording)
    without = collect(load_config("default", [*KNOWN, "smoother.engine=none"]), recording)
    np.testing.assert_array_equal(with_smoother.nis, without.nis)


def test_what_is_written_is_read_again(tmp_path: Path):
    table = Diagnostics(
        t=np.array([0.0, 0.5]),
        track_id=np.array([3, 4]),
        sensor=np.array([1, 0]),
        nis=np.array([np.nan, 2.25]),
        noise_scale=np.array([1.0, 1.5]),
        existence=np.array([0.75, np.nan]),
        sensors=("evt", "rgb"),
    )
    with DiagnosticsWriter(tmp_path / "d.csv") as writer:
        writer.append(table)
    back = read_diagnostics(tmp_path / "d.csv")
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(back, name), getattr(table, name))
    assert back.sensors == table.sensors


def test_a_tracker_without_diagnostics_says_how_to_get_them():
    with pytest.raises(JeatGraphError, match="diagnostics=True"):
        Tracker(load_config("default")).last_updates()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0,1,rgb,-1,1,1", "nis must not be negative"),
        ("0,1,rgb,1,0,1", "noise_scale must be positive"),
        ("0,1,rgb,1,1,1.5", "existence must be in"),
        ("0,1,,1,1,1", "sensor is missing"),
        ("0,x,rgb,1,1,1", "track_id"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, line, message):
    path = tmp_path / "diagnostics.csv"
    path.write_text(f"{HEAD}\n0,1,rgb,,1,0.5\n{line}\n", encoding="utf-8")
    with pytest.raises(DataError, match=rf"diagnostics\.csv:3: .*{message}"):
        read_diagnostics(path)
