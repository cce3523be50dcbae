"""`jeat-graph explain`: a track and a place of a run, in words and as a plot."""

from __future__ import annotations

import pytest

from jeat_graph.cli.main import main

RATE_HZ, SCANS = 10, 30


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A car that a camera sees well, and a window that it takes for one at a low score."""
    path = tmp_path_factory.mktemp("explain")
    rows = ["t,sensor,left,top,width,height,score"]
    for k in range(SCANS):
        t = k / RATE_HZ
        rows.append(f"{t},cam,{100 + 8 * k},300,80,50,0.9")
        rows.append(f"{t},cam,900,200,40,60,0.12")
    (path / "d.csv").write_text("\n".join(rows) + "\n")
    assert main(["track", str(path / "d.csv"), "--out", str(path / "run"), "--image", "1280x720"]) == 0
    return path


def explained(folder, capsys, *arguments: str) -> str:
    capsys.readouterr()
    assert main(["explain", str(folder / "run"), *arguments]) == 0
    return capsys.readouterr().out


def test_a_car_is_reported_because_of_its_scores_and_detections(folder, capsys):
    text = explained(folder, capsys, "--track", "1")
    assert "track 1: from 0.000 to 2.900 s" in text
    assert "reported first at" in text
    assert "cam: scores +" in text
    assert "cam: hits and misses" in text


def test_a_window_is_not_and_the_reason_is_said(folder, capsys):
    text = explained(folder, capsys, "--track", "2")
    assert "never reported" in text
    assert "cam: scores (-" in text


def test_a_place_tells_boxes_and_their_tracks(folder, capsys):
    text = explained(folder, capsys, "--at", "1.0,920,230")
    assert "boxes of sensors: 3, tracks: 1" in text
    assert "0.12" in text
    assert "track 2, existence 0." in text


def test_terms_have_the_names_of_their_sensors_whoever_looks_first(tmp_path, capsys):
    """The one that finds the car has names after and before the other's: what it says is the same."""
    terms = []
    for found, empty in (("a", "z"), ("z", "a")):
        rows = ["t,sensor,left,top,width,height,score"]
        for k in range(SCANS):
            rows.append(f"{k / RATE_HZ + 0.01},{empty},,,,,")
            rows.append(f"{k / RATE_HZ},{found},{100 + 8 * k},300,80,50,0.9")
        (tmp_path / "d.csv").write_text("\n".join(rows) + "\n")
        out = tmp_path / found
        assert main(["track", str(tmp_path / "d.csv"), "--out", str(out), "--image", "1280x720"]) == 0
        capsys.readouterr()
        assert main(["explain", str(out), "--track", "1", "--detections", str(tmp_path / "d.csv")]) == 0
        text = capsys.readouterr().out.split("log odds", 1)[1].splitlines()[0]
        terms.append(text.replace(f"{found}: ", "found: ").replace(f"{empty}: ", "empty: "))
    assert "found: scores +" in terms[0]
    assert terms[0] == terms[1]


def test_a_place_where_nothing_is(folder, capsys):
    assert "no sensor has a box, and no track is there" in explained(folder, capsys, "--at", "1,600,600")


def test_the_plot_is_the_same_each_time(folder, capsys, tmp_path):
    for name in ("a.png", "b.png"):
        explained(folder, capsys, "--track", "1", "--out", str(tmp_path / name))
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--track", "99"], "there is no track 99"),
        (["--at", "1,2,3", "--out", "x.png"], "needs --track"),
        (["--track", "1", "--out", "x.txt"], "must end in .png"),
    ],
)
def test_wrong_use_is_one_line_and_exit_2(folder, capsys, arguments, words):
    assert main(["explain", str(folder / "run"), *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert words in error
    assert len(error.splitlines()) == 1


def test_a_place_must_read_as_one(folder):
    with pytest.raises(SystemExit) as stop:
        main(["explain", str(folder / "run"), "--at", "1;2;3"])
    assert stop.value.code == 2


def test_of_several_sensors_it_says_what_is_known_of_them(tmp_path, capsys):
    """The second one repeats its boxes to the pixel and is off by a quarter of every car."""
    rows = ["t,sensor,left,top,width,height,score"]
    for k in range(8 * SCANS):
        for car in range(6):
            x, y, off = 100 + 6 * k % 800, 60 + 100 * car, (-20, 20)[car % 2]
            rows.append(f"{k / RATE_HZ},one,{x},{y},80,50,0.9")
            rows.append(f"{k / RATE_HZ},two,{x + off},{y},80,50,0.8")
    (tmp_path / "d.csv").write_text("\n".join(rows) + "\n")
    settings = ["--set", "sensors.one.lasting_error=0", "--set", "sensors.two.score_weight=0.5"]
    run = str(tmp_path / "run")
    assert main(["track", str(tmp_path / "d.csv"), "--out", run, "--image", "1280x720", *settings]) == 0
    capsys.readouterr()
    assert main(["explain", run, "--track", "1"]) == 0
    first, *others = capsys.readouterr().out.splitlines()
    assert first.startswith("sensor two: its boxes are off by ")
    assert "(learnt from the other sensors)" in first
    assert "its scores count 0.5 times (as given)" in first
    assert not any(line.startswith("sensor ") for line in others)
    [of_track] = [line for line in others if line.startswith("by what is known of two: ")]
    assert "a box of it counts 0." in of_track
    assert "of one of one" in of_track
    assert "the weight of its scores, by -" in of_track


def test_it_says_what_the_kind_of_a_sensor_did_to_a_parked_car(tmp_path, capsys):
    rows = ["t,sensor,left,top,width,height,score"]
    for k in range(2 * SCANS):
        rows.append(f"{k / RATE_HZ},cam,{100 + 8 * k},300,80,50,0.9")
        rows.append(f"{k / RATE_HZ},evt,{100 + 8 * k},300,80,50,0.9")
        rows.append(f"{k / RATE_HZ},cam,900,200,40,60,0.6")
    (tmp_path / "d.csv").write_text("\n".join(rows) + "\n")
    kind = ["--set", "sensors.evt.kind=event", "--set", "sensors.cam.kind=camera"]
    run = str(tmp_path / "run")
    assert main(["track", str(tmp_path / "d.csv"), "--out", run, "--image", "1280x720", *kind]) == 0
    text = explained(tmp_path, capsys, "--track", "2")
    assert "sensor evt: an event camera (as given), " in text
    assert "sensor cam: a camera (as given), " in text
    [line] = [line for line in text.splitlines() if line.startswith("by what is known of evt: ")]
    change = float(line.split("that it may not see what stands changed the log odds by ")[1].split(";")[0])
    assert change > 0.5
