"""Looks of vehicles while they drive: they count as they do afterwards, where they can be compared."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("jeat_graph_sehn")

from jeat_graph.corridor.corridor_file import read_learnt_gaps, write_corridor
from jeat_graph.corridor.corridor_tables import Corridor
from jeat_graph.corridor.gap_model import Gap
from jeat_graph.corridor.handover import KnownGap, solve
from jeat_graph.corridor.live_appearance import CameraAppearance
from jeat_graph.corridor.live_corridor import LiveCorridor
from jeat_graph.corridor.live_gap import LivePassage
from jeat_graph.corridor.passages import read_passages
from jeat_graph.data.embeddings import packed_embedding, unpacked_embedding
from jeat_graph.data.errors import DataError
from jeat_graph_sehn.simulation.corridor.cameras import CameraErrors, write_seen
from jeat_graph_sehn.simulation.corridor.traffic import CorridorTraffic
from jeat_graph_sehn.simulation.corridor.writing import simulate_corridor

NUMBERS, SIMILARITY, GAP_M = 16, 0.45, 800.0
EVERY_S = 5.0


@pytest.fixture(scope="module")
def days(tmp_path_factory):
    """Two days of one dense road, one to learn from: passages with appearance, and vehicles, of A and B."""
    found = []
    for seed in (1, 2):
        traffic = CorridorTraffic(400.0, 2400.0, 110.0, (0.0, GAP_M), 0.04, 0.04)
        _, seen, _ = simulate_corridor(traffic, seed)
        rng, cameras = np.random.default_rng(seed), []
        own = rng.normal(size=(3000, NUMBERS))
        for name, one in zip("AB", seen, strict=True):
            folder = tmp_path_factory.mktemp(f"{name}{seed}")
            write_seen(one, folder, CameraErrors())
            passages = read_passages(folder, name)
            vehicle = one.vehicle[passages.track_id - 1]
            noise = rng.normal(size=(len(vehicle), NUMBERS))
            known = np.where(vehicle[:, None] >= 0, own[vehicle], rng.normal(size=noise.shape))
            appearance = np.sqrt(SIMILARITY) * known + np.sqrt(1.0 - SIMILARITY) * noise
            # What each camera does to all of its vehicles.
            appearance = appearance + rng.normal(scale=0.5, size=NUMBERS)
            cameras.append((replace(passages, appearance=appearance), vehicle))
        found.append(cameras)
    return found


@pytest.fixture(scope="module")
def learnt(days, tmp_path_factory):
    """The gap as a file has it, with appearance and without: the paths."""
    out = []
    for appearance in (True, False):
        a, b = (one if appearance else replace(one, appearance=None) for one, _ in days[0])
        over = solve(KnownGap("A", "B", GAP_M, 8.0), Gap.of(a, b))
        path = tmp_path_factory.mktemp("learnt") / "corridor.yaml"
        write_corridor(Corridor.of(["A", "B"], {"A": a, "B": b}, [over]), path)
        out.append(path)
    return out


def gaps_of(path, day):
    """The gaps learnt, with the offset of the clocks that is true of a day: the common vehicles tell it."""
    over = solve(KnownGap("A", "B", GAP_M, 8.0), Gap.of(*(passages for passages, _ in day)))
    offset = over.fitted.parameters.offset_s
    return [
        replace(one, parameters=replace(one.parameters, offset_s=offset)) for one in read_learnt_gaps(path)
    ]


def drive(live, day, offset, *, appearance=True, until=np.inf, since=-np.inf):
    """Send a day's passages in order of true time; the pairs (track at A, track at B) that are found."""
    rows = []
    for name, (p, _), clock in zip("AB", day, (0.0, offset), strict=True):
        for k in range(len(p)):
            numbers = (p.t[k], p.sigma_t[k], p.log_speed[k], p.sigma_speed[k])
            packed = packed_embedding(p.appearance[k]) if appearance else ""
            one = LivePassage(
                int(p.track_id[k]), *map(float, numbers), p.lanes[p.lane[k]], p.kinds[p.kind[k]], packed
            )
            rows.append((one.t - clock, name, one))
    rows.sort(key=lambda row: row[0])
    pairs, step, k = set(), rows[0][0] - EVERY_S, 0
    while step < rows[-1][0] + 200.0:
        step += EVERY_S
        while k < len(rows) and rows[k][0] <= step:
            if since < step <= until:
                live.passed(rows[k][1], rows[k][2])
            k += 1
        if since < step <= until:
            live.at("A", step)
            live.at("B", step + offset)
            pairs |= {
                (one["from_track_id"], one["to_track_id"])
                for one in live.decide()
                if one["event"] == "passage"
            }
    return pairs


def f1(pairs, day):
    (a, first), (b, second) = day
    who = [dict(zip(p.track_id.tolist(), v.tolist(), strict=True)) for p, v in ((a, first), (b, second))]
    common = len(np.intersect1d(first[first >= 0], second[second >= 0]))
    return 2.0 * sum(who[0][i] == who[1][j] >= 0 for i, j in pairs) / (len(pairs) + common)


def followed(path, day, appearance=True):
    gaps = gaps_of(path, day)
    live = LiveCorridor(gaps, 300.0)
    return drive(live, day, gaps[0].parameters.offset_s, appearance=appearance), live


def test_appearance_helps_while_vehicles_drive(days, learnt):
    with_looks, live = followed(learnt[0], days[1])
    without, plain = followed(learnt[1], days[1])
    assert f1(with_looks, days[1]) > f1(without, days[1]) + 0.03
    assert live.shown()["gaps"][0]["d_prime"] == pytest.approx(2.0, abs=0.5)
    assert plain.shown()["gaps"][0]["d_prime"] is None


def test_appearance_that_does_not_come_changes_nothing(days, learnt):
    """A corridor that was learnt with them, and a camera without an embedder."""
    gaps = gaps_of(learnt[0], days[1])
    plain = [replace(gap, parameters=replace(gap.parameters, appearance=None), numbers=0) for gap in gaps]
    found = [
        drive(LiveCorridor(one, 300.0), days[1], gaps[0].parameters.offset_s, appearance=False)
        for one in (gaps, plain)
    ]
    assert found[0] == found[1]


def test_a_file_has_what_was_learnt_of_appearance_only_where_something_was(learnt):
    with_looks, without = (read_learnt_gaps(path)[0] for path in learnt)
    assert with_looks.numbers == NUMBERS
    assert with_looks.parameters.appearance.d_prime == pytest.approx(2.0, abs=0.5)
    assert without.numbers == 0
    assert without.parameters.appearance is None
    assert "appearance" not in learnt[1].read_text()


@pytest.mark.parametrize(
    ("old", "new"), [("sigma: ", "sigma: -"), ("numbers: 16", "numbers: 0"), ("same:", "x:")]
)
def test_a_file_with_damaged_appearance_is_refused(old, new, learnt, tmp_path):
    text = learnt[0].read_text()
    assert old in text
    (tmp_path / "c.yaml").write_text(text.replace(old, new))
    with pytest.raises(DataError, match="its model has no valid"):
        read_learnt_gaps(tmp_path / "c.yaml")


def test_embeddings_of_another_network_are_warned_of_and_not_compared(days, learnt):
    shorter = [(replace(p, appearance=p.appearance[:, :5]), v) for p, v in days[1]]
    gaps = gaps_of(learnt[1], days[1])
    live = LiveCorridor(
        [
            replace(one, parameters=replace(one.parameters, offset_s=gaps[0].parameters.offset_s))
            for one in read_learnt_gaps(learnt[0])
        ],
        300.0,
    )
    drive(live, shorter, gaps[0].parameters.offset_s, until=shorter[0][0].t[60])
    problems = live.shown()["problems"]
    assert any("embeddings of 5 numbers come, and those learnt have 16" in text for text in problems)
    assert live.shown()["gaps"][0]["d_prime"] is None


def test_a_state_goes_on_with_the_means_of_both_cameras(days, learnt):
    gaps = gaps_of(learnt[0], days[1])
    offset, stop = gaps[0].parameters.offset_s, float(days[1][0][0].t[120])
    whole = drive(LiveCorridor(gaps, 300.0), days[1], offset)
    first, second = LiveCorridor(gaps, 300.0), LiveCorridor(gaps, 300.0)
    found = drive(first, days[1], offset, until=stop)
    second.set_state(json.loads(json.dumps(first.state())))
    found |= drive(second, days[1], offset, since=stop)
    # The means are kept to three digits.
    assert len(found ^ whole) <= 0.02 * len(whole)


def test_the_mean_of_a_camera_follows_the_light():
    rng, camera = np.random.default_rng(3), CameraAppearance(4)
    own, light = rng.normal(size=(2000, 4)), np.array([0.0, 5.0, 0.0, 0.0])
    for one in (*(own + light), *(own - light)):
        camera.add(packed_embedding(one))
    assert camera.known
    shown = camera.centred([*map(packed_embedding, own[:50] - light), ""])
    true = own[:50] / np.linalg.norm(own[:50], axis=1, keepdims=True)
    assert np.isnan(shown[50]).all()
    assert np.einsum("ne,ne->n", shown[:50], true).mean() > 0.97


def test_an_embedding_is_a_short_text_and_back():
    values = np.random.default_rng(5).normal(size=66)
    text = packed_embedding(values)
    assert len(text) == 176
    np.testing.assert_allclose(unpacked_embedding(text), values, rtol=1e-3)
    assert unpacked_embedding("").shape == (0,)
