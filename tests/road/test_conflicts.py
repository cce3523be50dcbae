"""Near misses: closed forms, brute force, and intervals that hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jeat_graph.cli.main import main
from jeat_graph.drawing.palette import track_rgb
from jeat_graph.road.camera import RoadCamera, mounted
from jeat_graph.road.camera_file import write_camera
from jeat_graph.road.conflicts.encounters import _MANY, ConflictConfig, _errors, encounters, sure
from jeat_graph.road.conflicts.measures import collision, encroachment, separation
from jeat_graph.road.conflicts.poses import Poses

CONFIG = ConflictConfig()
#: Whatever comes close.
ALL = ConflictConfig(ttc_s=1e3, pet_s=1e3)
#: Standard deviations of x, y, speed, heading, length, width.
SIGMA = np.array([0.1, 0.25, 0.25, 0.01, 0.25, 0.1])
T = np.arange(0.0, 6.0, 0.05)


def state(x=0.0, y=0.0, speed=0.0, heading=0.0, length=4.5, width=1.8):
    return np.array([x, y, speed, heading, length, width])


def vehicle(track, x, y, speed, heading, sigma=SIGMA):
    columns = np.broadcast_arrays(x, y, speed, heading, 4.5, 1.8, T)[:-1]
    mean = np.stack(columns, axis=1).astype(float)
    return Poses(track, "car", T, mean, np.tile(sigma, (len(T), 1)))


def test_ttc_and_drac_of_a_rear_end_are_gap_over_closing_speed() -> None:
    found = collision(state(speed=20.0), state(y=24.5, speed=12.0))
    assert found.ttc == pytest.approx(20.0 / 8.0)
    assert found.drac == pytest.approx(8.0**2 / (2.0 * 20.0))
    apart = collision(state(speed=20.0), state(y=24.5, speed=20.0))
    assert (float(apart.ttc), float(apart.drac)) == (np.inf, 0.0)
    beside = collision(state(speed=20.0), state(x=3.5, y=24.5, speed=12.0))
    assert float(beside.ttc) == np.inf


def test_ttc_is_when_the_rectangles_first_overlap() -> None:
    """Brute force: both move on by a millisecond at a time until they overlap."""
    rng = np.random.default_rng(0)
    s = np.arange(0.0, 5.0, 1e-3)
    met = 0
    for _ in range(60):
        a, b = (state(*rng.uniform(-12, 12, 2), rng.uniform(0, 20), rng.uniform(-3, 3)) for _ in range(2))
        if separation(a, b) <= 0.0:
            continue
        moved = []
        for one in (a, b):
            way = np.repeat(one[None], len(s), axis=0)
            way[:, :2] += s[:, None] * one[2] * np.array([np.sin(one[3]), np.cos(one[3])])
            moved.append(way)
        together = np.flatnonzero(separation(*moved) <= 0.0)
        ttc = float(collision(a, b).ttc)
        if len(together):
            met += 1
            assert ttc == pytest.approx(s[together[0]], abs=2e-3)
        else:
            assert ttc > 4.9
    assert met > 2


def test_pet_of_square_paths_is_from_the_rear_that_leaves_to_the_front_that_comes() -> None:
    t = np.arange(0.0, 8.0, 0.02)
    first = np.stack([state(0.0, -30.0 + 10.0 * s, 10.0, 0.0) for s in t])
    second = np.stack([state(-60.0 + 12.0 * s, 0.0, 12.0, np.pi / 2.0) for s in t])
    leaves = (30.0 + 4.5 / 2.0 + 1.8 / 2.0) / 10.0
    comes = (60.0 - 4.5 / 2.0 - 1.8 / 2.0) / 12.0
    assert encroachment(first, t, second, t) == pytest.approx(comes - leaves, abs=0.02)
    assert encroachment(first, t, second + state(y=50.0, length=0.0, width=0.0), t) < np.inf
    assert encroachment(first, t, second + state(y=500.0, length=0.0, width=0.0), t) == np.inf


def drawn(rng, k):
    """One encounter: a follower that brakes late, or two on square paths."""
    if k % 2:
        speed = rng.uniform(6, 15, 2)
        lag = rng.uniform(0.5, 3.0)
        far = speed[1] * (30.0 / speed[0] + lag)
        return (
            vehicle(1, 0.0, -30.0 + speed[0] * T, speed[0], 0.0),
            vehicle(2, -far + speed[1] * T, 0.0, speed[1], np.pi / 2.0),
        )
    ahead, faster = rng.uniform(8, 15), rng.uniform(2, 8)
    speed = np.maximum(ahead + faster - rng.uniform(3, 6) * np.maximum(T - rng.uniform(0.5, 2.0), 0.0), ahead)
    way = np.concatenate([[0.0], np.cumsum(0.05 * speed[:-1])])
    gap = max(np.max(way - ahead * T), 0.0) + rng.uniform(2.0, 12.0)
    return vehicle(1, 0.0, gap + 4.5 + ahead * T, ahead, 0.0), vehicle(2, 0.3, way, speed, 0.0)


def calibration(count: int, seed: int) -> tuple[dict[str, list[bool]], int, int]:
    """Which intervals hold the truth, conflicts that are listed, and those that are none."""
    rng = np.random.default_rng(seed)
    held: dict[str, list[bool]] = {"ttc": [], "pet": []}
    listed = wrong = 0
    for k in range(count):
        pair = drawn(rng, k)
        exact = [one._replace(sigma=0.0 * one.sigma) for one in pair]
        seen = [one._replace(mean=one.mean + SIGMA * rng.standard_normal(6)) for one in pair]
        true, found = encounters(exact, ALL), encounters(seen, ALL)
        conflict = any(
            one.ttc.value < 1.5 or one.drac.value > 3.35 or (one.kind == "crossing" and one.pet.value < 1.0)
            for one in true
        )
        for one, own in zip(true, found, strict=False):
            for name, values in held.items():
                value, told = getattr(one, name).value, getattr(own, name)
                if np.isfinite(value) and np.isfinite(told.value):
                    values.append(told.low <= value <= told.high)
        reported = any(sure(one, CONFIG) for one in encounters(seen, CONFIG))
        listed += reported
        wrong += reported and not conflict
    return held, listed, wrong


def test_intervals_hold_the_truth_and_what_is_listed_is_a_conflict() -> None:
    held, listed, wrong = calibration(12, 4)
    both = held["ttc"] + held["pet"]
    assert len(both) >= 10
    assert np.mean(both) >= 0.95 - 3.0 * np.sqrt(0.05 * 0.95 / len(both))
    assert listed >= 1
    assert wrong <= 1


@pytest.mark.slow
def test_intervals_hold_as_often_as_they_say() -> None:
    """Intervals of 95 % hold 90 to 98 %, of draws that nothing was chosen by."""
    held, listed, wrong = calibration(400, 301)
    for name, values in held.items():
        assert len(values) > 150
        assert 0.90 <= np.mean(values) <= 0.98, name
    assert wrong <= 0.05 * listed, (listed, wrong)


def write_road(folder: Path, vehicles: list[Poses]) -> None:
    folder.mkdir()
    names = ("x", "y", "speed_kmh", "heading_deg", "length", "width")
    units = np.array([1.0, 1.0, 3.6, 180.0 / np.pi, 1.0, 1.0])
    rows = []
    for one in vehicles:
        part = pd.DataFrame(one.mean * units, columns=list(names))
        part[[f"var_{name}" for name in names]] = (one.sigma * units) ** 2
        rows.append(part.assign(t=one.t, track_id=one.track_id))
    pd.concat(rows).to_csv(folder / "road.csv", index=False)
    (folder / "speeds.csv").write_text("track_id,lane,class\n1,1,car\n2,1,truck\n")


def test_the_command_lists_conflicts_and_what_is_in_doubt_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ahead = vehicle(1, 0.0, 40.0 + 10.0 * T, 10.0, 0.0)
    close = np.minimum(T, 3.0)  # 10 m/s faster for 3 s: 5.5 m are left, TTC .55 s
    behind = vehicle(2, 0.0, 10.0 * T + 10.0 * close, np.where(T < 3.0, 20.0, 10.0), 0.0)
    unsure = [one._replace(track_id=one.track_id + 2, sigma=8.0 * one.sigma) for one in (ahead, behind)]
    unsure = [one._replace(mean=one.mean + state(x=50.0, length=0.0, width=0.0)) for one in unsure]
    write_road(tmp_path / "road", [ahead, behind, *unsure])
    out = tmp_path / "out"
    assert main(["conflicts", str(tmp_path / "road"), "--out", str(out)]) == 0
    assert "1 conflicts among 4 vehicles" in capsys.readouterr().out
    (row,) = pd.read_csv(out / "conflicts.csv").itertuples()
    assert (row.first_id, row.second_id, row.kind, row.second_class) == (1, 2, "rear-end", "truck")
    assert row.ttc_s_low < 0.6 < row.ttc_s_high
    assert row.probability >= 0.95
    assert pd.read_csv(out / "doubtful.csv").first_id.tolist() == [3]
    assert (out / "conflicts.png").read_bytes().startswith(b"\x89PNG")
    assert main(["conflicts", str(tmp_path / "road"), "--out", str(out), "--picture", "a.png"]) == 2
    assert "--picture says nothing without --camera" in capsys.readouterr().err


def test_what_lies_in_one_another_and_what_only_stands_is_no_near_miss(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One vehicle seen twice; and one that stands beside the lane, whose heading is noise."""
    one = vehicle(1, 0.0, 10.0 * T, 10.0, 0.0)
    twice = vehicle(2, 0.4, 10.0 * T + 1.0, 10.0, 0.0)
    heading = np.random.default_rng(0).uniform(-3.0, 3.0, len(T))
    stands = vehicle(3, 2.5, 30.0, 0.05, heading)
    write_road(tmp_path / "road", [one, twice, stands])
    assert main(["conflicts", str(tmp_path / "road"), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr()
    assert "0 conflicts among 2 vehicles" in told.out
    assert "1 tracks stand all the time" in told.err
    assert len(pd.read_csv(tmp_path / "out" / "doubtful.csv")) == 0


def test_a_road_of_points_has_no_sizes_and_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_road(tmp_path / "road", [vehicle(1, 0.0, 10.0 * T, 10.0, 0.0)])
    table = pd.read_csv(tmp_path / "road" / "road.csv")
    table["length"] = np.nan
    table.to_csv(tmp_path / "road" / "road.csv", index=False)
    assert main(["conflicts", str(tmp_path / "road"), "--out", str(tmp_path / "out")]) == 2
    assert "make it from boxes" in capsys.readouterr().err
    assert not (tmp_path / "out" / "conflicts.csv").exists()


def film_of(path: Path) -> list[np.ndarray]:
    cv2 = pytest.importorskip("cv2")
    capture, pictures = cv2.VideoCapture(str(path)), []
    while (read := capture.read())[0]:
        pictures.append(read[1][..., ::-1])
    return pictures


def coloured(picture: np.ndarray, track: int) -> np.ndarray:
    """Pixels (x, y) of a vehicle's colour."""
    off = np.abs(picture.astype(float) - track_rgb(track)).max(axis=2)
    return np.argwhere(off < 40.0)[:, ::-1]


@pytest.fixture
def near_miss(tmp_path: Path) -> Path:
    ahead = vehicle(1, 2.0, 40.0 + 10.0 * T, 10.0, 0.0)
    close = np.minimum(T, 3.0)
    behind = vehicle(2, 2.0, 10.0 * T + 10.0 * close, np.where(T < 3.0, 20.0, 10.0), 0.0)
    write_road(tmp_path / "road", [ahead, behind])
    return tmp_path


def test_draws_say_where_an_interval_ends_in_every_direction_of_the_errors() -> None:
    """Of what is linear in the errors a 95 % interval ends 1.96 standard deviations away."""
    directions = np.random.default_rng(8).normal(size=(12, 500))
    directions /= np.linalg.norm(directions, axis=0)
    ends = np.quantile(_errors(_MANY)[1:] @ directions, [0.025, 0.975], axis=0)
    assert np.abs(ends).mean() == pytest.approx(1.96, abs=0.02)
    assert np.abs(ends).min() > 1.75
    assert np.abs(ends).max() < 2.2


def test_a_film_is_drawn_without_a_video(near_miss: Path) -> None:
    out = near_miss / "out"
    assert main(["conflicts", str(near_miss / "road"), "--films", "--out", str(out)]) == 0
    pictures = film_of(out / "conflict-1-2.webm")
    row = pd.read_csv(out / "conflicts.csv").iloc[0]
    begin = max(row.t - 4.0, T[0])
    assert len(pictures) == round((min(row.t + 4.0, T[-1]) - begin) * 20.0) + 1
    for k in (10, 50):
        middles = [coloured(pictures[k], track).mean(axis=0) for track in (1, 2)]
        t = begin + k / 20.0
        gap_m = 40.0 - 10.0 * min(t, 3.0)
        # From above, driving upwards, 12 px a metre, both vehicles around the middle.
        assert middles[0][1] - middles[1][1] == pytest.approx(-12.0 * gap_m, abs=4.0)
        assert np.mean(middles, axis=0) == pytest.approx([360.0, 360.0], abs=4.0)


def test_a_film_is_drawn_in_the_picture_of_the_camera(near_miss: Path) -> None:
    pose = mounted(np.radians(14.0), 0.0, 0.0)
    camera = RoadCamera(640, 360, 600.0, 600.0, 320.0, 180.0, 0.0, 0.0, pose, np.array([0.0, 0.0, 8.0]))
    write_camera(camera, near_miss / "camera.yaml")
    view, out = ["--camera", str(near_miss / "camera.yaml")], near_miss / "out"
    assert main(["conflicts", str(near_miss / "road"), "--films", *view, "--out", str(out)]) == 0
    picture = film_of(out / "conflict-1-2.webm")[20]
    assert picture.shape[:2] == (camera.height, camera.width)
    begin = max(pd.read_csv(out / "conflicts.csv").t[0] - 4.0, T[0])
    true = camera.project(np.array([[2.0, 40.0 + 10.0 * (begin + 1.0), 0.0]]))[0][0]
    assert coloured(picture, 1).mean(axis=0) == pytest.approx(true, abs=4.0)


def test_films_of_a_video_say_what_else_draws_them(
    near_miss: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(near_miss / "out")
    assert main(["conflicts", str(near_miss / "road"), "--frames", "a.mp4", "--out", out]) == 2
    assert "--films draws them without a video" in capsys.readouterr().err
