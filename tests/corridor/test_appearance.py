"""Appearance between cameras: what is learnt of it, and what it is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("jeat_graph_sehn")

from jeat_graph.association.appearance import centred, learn_appearance
from jeat_graph.cli.main import main
from jeat_graph.corridor.gap_model import Gap
from jeat_graph.corridor.handover import KnownGap, solve
from jeat_graph.corridor.passage_appearance import check_appearance, track_appearance, with_appearance
from jeat_graph.corridor.passages import read_passages
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph_sehn.simulation.corridor.cameras import CameraErrors, write_seen
from jeat_graph_sehn.simulation.corridor.traffic import CorridorTraffic
from jeat_graph_sehn.simulation.corridor.writing import simulate_corridor

NUMBERS = 16


def test_means_and_spreads_follow_from_unsure_pairs():
    rng = np.random.default_rng(0)
    p = rng.beta(0.4, 1.5, 40_000)
    same = rng.random(len(p)) < p
    x = np.where(same, rng.normal(0.5, 0.1, len(p)), rng.normal(0.1, 0.2, len(p)))
    found = learn_appearance(x, p)
    assert found.same == pytest.approx(0.5, abs=0.01)
    assert found.other == pytest.approx(0.1, abs=0.01)
    assert found.sigma == pytest.approx(np.sqrt((0.1**2 + 0.2**2) / 2.0), rel=0.03)
    # Of normal densities with one variance.
    at = np.array([0.25, 0.4, np.nan])
    normal = -0.5 * ((at - found.same) ** 2 - (at - found.other) ** 2) / found.sigma**2
    np.testing.assert_allclose(found.log_ratio(at), [*normal[:2], 0.0])
    assert found.log_ratio(np.array([9.0]))[0] == 6.0


def test_nothing_is_learnt_of_nothing():
    rng = np.random.default_rng(1)
    p = rng.beta(0.4, 1.5, 2000)
    assert learn_appearance(np.full(2000, np.nan), p) is None
    assert learn_appearance(rng.normal(size=2000), np.full(2000, 0.3)) is None
    found = [learn_appearance(rng.normal(size=2000), p) for _ in range(50)]
    assert max(0.0 if one is None else one.d_prime for one in found) < 0.3
    assert sum(one is None for one in found) > 25


def test_what_a_camera_does_to_all_counts_for_nothing():
    appearance = np.random.default_rng(2).normal(size=(30, 5))
    appearance[3] = np.nan
    np.testing.assert_allclose(centred(appearance + 7.0), centred(appearance), atol=1e-12)
    assert np.isnan(centred(appearance)[3]).all()


@pytest.fixture(scope="module")
def dense(tmp_path_factory):
    """Five minutes of 2400 vehicles an hour, 500 m apart: passages and true vehicles of both cameras."""
    _, seen, _ = simulate_corridor(CorridorTraffic(300.0, 2400.0, 110.0, (0.0, 500.0), 0.04, 0.04), 1)
    found = []
    for name, one in zip("AB", seen, strict=True):
        folder = tmp_path_factory.mktemp(name)
        write_seen(one, folder, CameraErrors())
        passages = read_passages(folder, name)
        found.append((passages, one.vehicle[passages.track_id - 1]))
    return found


def dressed(dense, similarity):
    """The gap with embeddings; the cosine of one vehicle at both is about `similarity`, of two about 0."""
    rng = np.random.default_rng(7)
    own = rng.normal(size=(2000, NUMBERS))
    out = []
    for passages, vehicle in dense:
        noise = rng.normal(size=(len(vehicle), NUMBERS))
        known = np.where(vehicle[:, None] >= 0, own[vehicle], rng.normal(size=noise.shape))
        appearance = np.sqrt(similarity) * known + np.sqrt(1.0 - similarity) * noise
        out.append(replace(passages, appearance=appearance + 0.3))
    return Gap.of(*out)


def f1_of(over, dense):
    (_, first), (_, second) = dense
    right = (first[over.first] == second[over.second]) & (first[over.first] >= 0)
    common = len(np.intersect1d(first[first >= 0], second[second >= 0]))
    return 2.0 * right.sum() / (len(right) + common)


def solved(gap):
    return solve(KnownGap("A", "B", 500.0, 5.0), gap)


def test_appearance_of_known_value_is_learnt_and_helps(dense):
    gap = dressed(dense, 0.45)
    cosine = gap.appearance[0] @ gap.appearance[1].T
    same = (dense[0][1][:, None] == dense[1][1][None]) & (dense[0][1][:, None] >= 0)
    truth = cosine[same].mean() - cosine[~same].mean()
    truth /= np.sqrt((cosine[same].var() + cosine[~same].var()) / 2.0)
    assert truth == pytest.approx(2.0, abs=0.3)
    over = solved(gap)
    assert over.fitted.parameters.appearance.d_prime == pytest.approx(truth, rel=0.2)
    plain = solved(Gap.of(dense[0][0], dense[1][0]))
    assert f1_of(over, dense) > f1_of(plain, dense) + 0.015


def test_appearance_that_tells_nothing_changes_nothing(dense):
    over, plain = solved(dressed(dense, 0.0)), solved(Gap.of(dense[0][0], dense[1][0]))
    appearance = over.fitted.parameters.appearance
    assert appearance is None or appearance.d_prime < 0.3
    assert f1_of(over, dense) == pytest.approx(f1_of(plain, dense), abs=0.01)


def test_the_appearance_of_a_track_is_that_of_its_detections():
    boxes = np.array([[0.0, 0, 10, 10], [50, 0, 10, 10]])
    t = np.repeat([0.0, 0.1], 2)
    appearance = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    rows = np.array([*boxes, *boxes, [200.0, 0, 10, 10]])
    found = Detections.from_rows([*t, 0.1], np.full(5, "rgb"), rows, np.ones(5), embeddings=appearance)
    tracks = Trajectories(
        t, np.array([4, 9, 4, 9]), np.tile(boxes, (2, 1)), np.ones(4), np.zeros((4, 6)), np.zeros((4, 6)),
        np.ones(4, dtype=np.int64), ("rgb",),
    )  # fmt: skip
    ids, mean = track_appearance(tracks, found)
    assert ids.tolist() == [4, 9]
    np.testing.assert_allclose(centred(mean) @ centred(mean).T, [[1.0, -1.0], [-1.0, 1.0]], atol=1e-6)
    np.testing.assert_allclose(mean / np.linalg.norm(mean, axis=1, keepdims=True), np.eye(2), atol=1e-6)


def test_embeddings_that_are_not_there_are_refused(dense, tmp_path):
    (a, _), (b, _) = dense
    with pytest.raises(DataError, match=r"has no detections\.csv"):
        with_appearance(a, tmp_path)
    boxes = np.array([[0.0, 0, 10, 10]])
    write_detections(Detections.from_rows([0.0], ["rgb"], boxes, [1.0]), tmp_path / "detections.csv")
    with pytest.raises(DataError, match="has no embeddings"):
        with_appearance(a, tmp_path)
    with pytest.raises(DataError, match="no camera beside it"):
        check_appearance([replace(a, appearance=np.ones((len(a), 2))), b])
    with pytest.raises(DataError, match="2 numbers and those of B 3"):
        check_appearance(
            [replace(a, appearance=np.ones((len(a), 2))), replace(b, appearance=np.ones((len(b), 3)))]
        )


def test_an_unknown_camera_is_refused(road, tmp_path, capsys):
    cameras = [f"{name}={road / name}" for name in "AB"]
    arguments = ["--distance", "A-B=300±3", "--embeddings", "D=run", "--out", str(tmp_path / "x")]
    assert main(["handover", *cameras, *arguments]) == 2
    assert "--embeddings D: there is no such camera" in capsys.readouterr().err


def test_the_command_takes_them_from_runs(road, tmp_path, capsys):
    rng = np.random.default_rng(3)
    own = rng.normal(size=(2000, NUMBERS))
    truth = [line.split(",") for line in (road / "truth.csv").read_text().splitlines()[1:]]
    told = ["--distance", "A-B=300±3"]
    for name in "AB":
        rows = [(int(row[1]), int(row[2])) for row in truth if row[0] == name]
        ids, vehicle = np.array(rows).T
        t, box = ids * 0.1, np.tile([10.0, 10.0, 20.0, 20.0], (len(ids), 1))
        appearance = own[vehicle] + 0.5 * rng.normal(size=(len(ids), NUMBERS))
        found = Detections.from_rows(t, np.full(len(t), "rgb"), box, np.ones(len(t)), embeddings=appearance)
        run = tmp_path / name
        run.mkdir()
        write_detections(found, run / "detections.csv")
        table = "".join(f"{time:.6f},{k},10,10,20,20\n" for time, k in zip(t, ids, strict=True))
        (run / "causal.csv").write_text("t,track_id,left,top,width,height\n" + table)
        told += ["--embeddings", f"{name}={run}"]
    cameras = [f"{name}={road / name}" for name in "AB"]
    assert main(["handover", *cameras, *told, "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().err
    assert float(said.split("apart by d′ ")[1].split()[0]) > 3.0
