"""`road` counts what `count` counts, also at the picture's edge, or says which crossings it does not have."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from road_scenes import HEIGHT, WIDTH, camera, see

from jeat_graph.cli.main import main
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.road.camera_file import write_camera
from jeat_graph.road.cuboid import sides
from jeat_graph.road.inputs import RoadMarks
from jeat_graph.road.lanes import LaneConfig
from jeat_graph.road.motion_fit import MotionFitConfig
from jeat_graph.road.picture_crossings import agreement_notes, with_unplaced
from jeat_graph.road.points_road import summarise
from jeat_graph.road.results import LeftOut, RoadResult
from jeat_graph.road.speeds import ContactConfig, fit_vehicle

CAMERA = camera()
ON_ROAD = ContactConfig(0.0, 0.0, 0.0)
GATE = tuple(see(CAMERA, np.array([[0.0, 30.0], [8.0, 30.0]])).ravel().tolist())
T = np.arange(0.0, 1.0, 0.02)


def _table(tracks: dict[int, np.ndarray]) -> Trajectories:
    """A table of boxes of 10 px around the pixels (50, 2) of each track."""
    ids = np.repeat(list(tracks), len(T))
    pixels = np.concatenate(list(tracks.values()))
    mean, n = np.c_[pixels, np.zeros((len(pixels), 4))], len(pixels)
    boxes, none = np.c_[pixels - 5.0, np.full((n, 2), 10.0)], np.full((n, 6), np.nan)
    t = np.tile(T, len(tracks))
    return Trajectories(t, ids, boxes, np.ones(n), mean, none, np.ones(n, dtype=np.int64))


def _result(tracks: dict[int, np.ndarray], left_out: list[LeftOut]) -> RoadResult:
    fits = [fit_vehicle(k, T, pixels, CAMERA, MotionFitConfig(), ON_ROAD) for k, pixels in tracks.items()]
    vehicles = [one for one in fits if one is not None]
    marks = RoadMarks({"gate": GATE}, {})
    return summarise(vehicles, CAMERA, marks, ON_ROAD, LaneConfig(), (), (0.0, 1.0), left_out)


def _path(x: float, y: np.ndarray) -> np.ndarray:
    return see(CAMERA, np.c_[np.full(len(T), x), y])


def test_every_crossing_of_count_is_on_the_road_or_left_out_with_a_reason() -> None:
    down = 42.0 - 20.0 * T
    tracks = {1: _path(4.0, down), 2: _path(6.0, down), 3: _path(2.0, down)}
    out = LeftOut(3, 0.0, 0.98, "too little of it is on the road")
    result = _result({k: tracks[k] for k in (1, 2)}, [out])
    # The road has lost sight of the second vehicle long before the line.
    early = replace(result.vehicles[1], fit=result.vehicles[1].fit._replace(t=result.vehicles[1].fit.t - 5.0))
    result = replace(
        result,
        vehicles=[result.vehicles[0], early],
        crossings=[row for row in result.crossings if row[1] == 0],
    )
    found, (one,) = with_unplaced(result, _table(tracks), {"gate": GATE})
    assert (one.in_picture, one.not_placed, one.only_on_road) == (3, 2, 0)
    assert len(found.crossings) == one.in_picture - one.not_placed + one.only_on_road
    assert found.left_out[0] == out
    reasons = {row.track_id: row.reason for row in found.left_out[1:]}
    assert reasons == {2: "the picture's edge cuts the vehicle there", 3: out.reason}
    assert all(
        row.line == "gate" and row.t_first == pytest.approx(0.6, abs=0.01) for row in found.left_out[1:]
    )
    (note,) = agreement_notes([one])
    assert note.startswith("2 of 3 crossings of `gate` were not placed on the road")


def test_who_goes_back_and_comes_again_counts_once_on_the_road_and_that_is_said() -> None:
    y = np.interp(T, [0.0, 0.3, 0.6, 0.98], [35.0, 25.0, 35.0, 25.0])
    x = np.interp(T, [0.3, 0.35, 0.55, 0.6], [4.0, 12.0, 12.0, 4.0])  # back beyond the end of the line
    result = _result({1: _path(4.0, 36.0 - 10.0 * T)}, [])
    found, (one,) = with_unplaced(result, _table({1: see(CAMERA, np.c_[x, y])}), {"gate": GATE})
    assert (one.in_picture, one.not_placed, one.only_on_road) == (2, 1, 0)
    assert [row.reason for row in found.left_out] == [
        "it crosses the line again, and counts once on the road"
    ]


def test_a_crossing_that_only_the_road_has_is_reported() -> None:
    result = _result({1: _path(4.0, 42.0 - 20.0 * T)}, [])
    elsewhere = {1: _path(4.0, 60.0 - 20.0 * T)}
    found, agreements = with_unplaced(result, _table(elsewhere), {"gate": GATE})
    assert (agreements[0].in_picture, agreements[0].only_on_road) == (0, 1)
    assert found.left_out == []
    assert "`count` does not have 1 of the crossings" in agreement_notes(agreements)[0]


def test_agreement_needs_no_note() -> None:
    track = {1: _path(4.0, 42.0 - 20.0 * T)}
    _, agreements = with_unplaced(_result(track, []), _table(track), {"gate": GATE})
    assert agreement_notes(agreements) == []


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def edge(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four cars come by, two of them so far aside that the picture cuts them before the line."""
    folder, t = tmp_path_factory.mktemp("edge"), np.arange(0.0, 2.4, 0.04)
    lines = ["t,track_id,left,top,width,height,class"]
    for k, (x, kind) in enumerate(((1.0, "car"), (4.0, "van"), (-2.2, "car"), (-2.2, "")), 1):
        y = 70.0 - 22.0 * t
        box, _ = sides(
            CAMERA, np.c_[np.full(len(t), x), y], np.full(len(t), np.pi), np.array([4.5, 1.8, 1.5])
        )
        box = np.clip(box, 0.0, [WIDTH, HEIGHT, WIDTH, HEIGHT])
        left, top, right, bottom = box.T
        shown = (right - left > 5.0) & (bottom - top > 5.0)
        lines += [
            f"{a + 3.0 * k:.3f},{k},{b:.2f},{c:.2f},{d:.2f},{e:.2f},{kind}"
            for a, b, c, d, e in np.c_[t, left, top, right - left, bottom - top][shown]
        ]
    (folder / "tracks.csv").write_text("\n".join(lines) + "\n")
    write_camera(CAMERA, folder / "camera.yaml")
    return folder


def _road(folder: Path, row: float, *more: str) -> Path:
    (folder / "lines.yaml").write_text(f"lines:\n  main: [0, {row}, {WIDTH}, {row}]\n")
    out = folder / f"out-{row:g}"
    command = ["road", str(folder / "tracks.csv"), "--camera", str(folder / "camera.yaml")]
    assert main([*command, "--lines", str(folder / "lines.yaml"), "--out", str(out), *more]) == 0
    return out


def test_road_and_count_agree_or_say_what_is_missing(edge: Path, capsys: pytest.CaptureFixture[str]) -> None:
    notes = {}
    for row in range(200, 1000, 50):
        out = _road(edge, float(row))
        notes[row] = capsys.readouterr().err
        crossings, single = _rows(out / "crossings.csv"), edge / "single.csv"
        line = ["--lines", str(edge / "lines.yaml")]
        assert main(["count", str(edge / "tracks.csv"), *line, "--crossings", str(single)]) == 0
        counted = _rows(single)
        capsys.readouterr()
        missing = [one for one in _rows(out / "left_out.csv") if one["line"] == "main"]
        only = {one["track_id"] for one in crossings} - {one["track_id"] for one in counted}
        assert len(crossings) == len(counted) - len(missing) + len(only)
        assert bool(missing) == ("were not placed on the road" in notes[row])
        assert bool(only) == ("`count` does not have" in notes[row])
        by_track = {one["track_id"]: one["direction"] for one in counted}
        assert all(one["direction"] == by_track.get(one["track_id"], one["direction"]) for one in crossings)


def test_counts_have_the_classes_of_the_tracks_and_dates(edge: Path) -> None:
    out = _road(edge, 300.0, "--begin", "2026-11-27T07:30:00", "--interval", "900")
    rows = _rows(out / "counts.csv")
    whole = {row["class"]: int(row["count"]) for row in rows if row["direction"] == row["lane"] == "all"}
    assert whole == {"all": 4, "car": 2, "van": 1, "": 1}
    assert {row["begin"] for row in rows} == {"2026-11-27T07:30:00"}
    assert {row["end"] for row in rows} == {"2026-11-27T07:45:00"}
    assert all(row["time"].startswith("2026-11-27T07:30:") for row in _rows(out / "crossings.csv"))
    assert [row["class"] for row in _rows(out / "speeds.csv")] == ["car", "van", "car", ""]


def test_a_date_that_is_none_is_one_clear_line(edge: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["road", str(edge / "tracks.csv"), "--camera", str(edge / "camera.yaml")]
    assert main([*command, "--begin", "noon", "--out", str(edge / "none")]) == 2
    assert "--begin noon: must be a date and time" in capsys.readouterr().err
    assert not (edge / "none").exists()
