from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.event_noise import ALL, BASELINE, matched, measures
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
    assert main(["events", *arguments, "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "all three" in shown
    result = json.loads((tmp_path / "events.json").read_text(encoding="utf-8"))
    noise = {r["row"]: r["noise_hz"] for r in result["noise"]}
    assert noise[BASELINE] > 3.0 * noise[ALL]
    assert result["rates"][0]["motion_hz"] > 0.0
    assert main(["events", "--from", str(tmp_path / "events.json")]) == 0
    assert capsys.readouterr().out == shown
