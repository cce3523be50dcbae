from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.event_noise import ALL, BASELINE, matched, measures
from benchmarks.event_throughput import (
    FORMATS,
    HISTOGRAM,
    OURS,
    SURFACE,
    Work,
    _timed,
    count_bins,
    make_stream,
    measure_throughput,
    time_surfaces,
)
from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.config import CarlaEventConfig


def events(rows: list[tuple[int, int, int, int]]) -> EventArray:
    t, x, y, p = np.array(sorted(rows)).reshape(-1, 4).T
    return EventArray(t, x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8))


def test_an_event_is_matched_by_one_of_its_pixel_and_polarity_near_in_time() -> None:
    reference = events([(100, 3, 4, 1), (200, 3, 4, 0), (300, 5, 4, 1), (900, 5, 4, 1)])
    found = events([(110, 3, 4, 1), (200, 3, 4, 1), (330, 5, 4, 1), (850, 4, 5, 1)])
    assert matched(found, reference, 20) == 0.25
    assert matched(found, reference, 30) == 0.5
    assert matched(reference, reference, 0) == 1.0
    assert matched(events([(0, 0, 0, 0)]).take(slice(0, 0)), reference, 1000) == 0.0


def test_matching_agrees_with_looking_at_every_pair() -> None:
    rng = np.random.default_rng(0)
    one, two = (
        events(
            [
                tuple(r)
                for r in np.column_stack([rng.integers(0, 9000, 300), rng.integers(0, [6, 5, 2], (300, 3))])
            ]
        )
        for _ in range(2)
    )
    near = np.abs(one.t_us[:, None] - two.t_us) <= 150
    near &= (one.x[:, None] == two.x) & (one.y[:, None] == two.y) & (one.polarity[:, None] == two.polarity)
    assert matched(one, two, 150) == pytest.approx(near.any(axis=0).mean())


def test_each_measure_alone_changes_one_setting_and_all_change_three() -> None:
    rows = measures(CarlaEventConfig(sigma_threshold=0.1))
    base = rows[BASELINE]

    def changed(name: str) -> set[str]:
        return {f for f in base.__dataclass_fields__ if getattr(rows[name], f) != getattr(base, f)}

    alone = [changed(name) for name in rows if name not in (BASELINE, ALL)]
    assert alone == [{"sigma_threshold"}, {"refractory_period_ns"}, {"log_eps"}]
    assert changed(ALL) == set().union(*alone)


def test_the_command_writes_and_shows_both_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--frames", "3", "--size", "128x80", "--scenarios", "night-nolight", "--jobs", "1"]
    assert main(["event-cameras", *arguments, "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "all three" in shown
    result = json.loads((tmp_path / "event-cameras.json").read_text(encoding="utf-8"))
    noise = {r["row"]: r["noise_hz"] for r in result["noise"]}
    assert noise[BASELINE] > 3.0 * noise[ALL]
    assert result["rates"][0]["motion_hz"] > 0.0
    assert main(["event-cameras", "--from", str(tmp_path / "event-cameras.json")]) == 0
    assert capsys.readouterr().out == shown


def test_the_stream_is_in_order_within_the_picture_and_has_runs_along_rows() -> None:
    stream = make_stream(20_000, (64, 48), 0)
    assert 18_000 < len(stream) <= 20_000
    assert (np.diff(stream.t_us) >= 0).all()
    assert stream.x.max() < 64
    assert stream.y.max() < 48
    neighbours = (np.diff(stream.x.astype(int)) == 1) & (np.diff(stream.t_us) == 0) & (np.diff(stream.y) == 0)
    assert 0.4 < neighbours.mean() < 0.7


def test_every_package_that_is_here_gives_the_events_of_the_stream() -> None:
    rows = {(r["task"], r["package"]): r for r in measure_throughput(5_000, (64, 48), 0, 1)}
    for task in (*FORMATS, HISTOGRAM):
        assert rows[task, OURS]["why"] == ""
        assert float(rows[task, OURS]["mev_s"] or 0.0) > 0.0
    assert rows["evt2", "evt3"]["mev_s"] is None
    assert all("other" not in str(r["why"]) for r in rows.values())


def test_histograms_hold_the_events_of_whole_windows_at_most_255_a_cell() -> None:
    rows = [(1000, 3, 4, 1)] * 300 + [
        (1000, 3, 4, 0),
        (52_000, 1, 1, 1),
        (99_999, 1, 1, 1),
        (100_001, 0, 0, 0),
    ]
    assert count_bins(events(rows), (8, 6)) == 255 + 1 + 2


def test_a_time_surface_decays_from_the_newest_event_of_each_pixel() -> None:
    stream = events([(0, 1, 2, 1), (20_000, 1, 2, 1), (60_000, 3, 0, 0), (120_000, 0, 0, 1)])
    first, second = time_surfaces(stream, (4, 3))
    assert first[1, 2, 1] == pytest.approx(np.exp(-30 / 50))
    assert second[1, 2, 1] == pytest.approx(np.exp(-80 / 50))
    assert (first[0, 0, 3], second[0, 0, 3]) == (0.0, pytest.approx(np.exp(-40 / 50)))
    assert np.count_nonzero(second) == 2


def test_sparse_and_dense_files_are_decoded_in_processes_of_their_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A package that is not there is said to fail, and ours gives the events of both streams."""
    assert main(["decoders", "--quick", "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "EVT3, sparse" in shown
    assert "DAT, dense" in shown
    result = json.loads((tmp_path / "decoders.json").read_text(encoding="utf-8"))
    ours = [row for row in result["decoders"] if row["package"] == OURS]
    assert len(ours) == 2 * len(FORMATS)
    assert all(row["why"] == "" and row["mev_s"] > 0.0 for row in ours)


def test_who_fails_or_gives_other_events_has_no_figure() -> None:
    def broken() -> int:
        raise OSError("no such format")

    work = [
        Work("evt3", OURS, lambda: 1, lambda made: made == 1),
        Work("evt2", OURS, lambda: 2, lambda made: made == 1),
        Work("dat", OURS, broken, lambda made: True),
    ]
    rows = {r["task"]: r for r in _timed(work, 1000, 1) if r["package"] == OURS}
    assert rows["evt3"]["mev_s"] is not None
    assert (rows["evt2"]["mev_s"], rows["evt2"]["why"]) == (None, "gives other events")
    assert (rows["dat"]["mev_s"], rows["dat"]["why"]) == (None, "fails (OSError)")
    assert rows[SURFACE]["why"] == "–"


def test_the_table_of_throughput_says_what_is_not_installed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("benchmarks.event_throughput.find_spec", lambda name: None)
    assert main(["events", "--stream", "3000", "--size", "64x48"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("not installed") >= 10
    assert "decode EVT3" in shown
