"""`factor_graph`: a run's own graph, solved, is its smoothed table."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import jeat_graph
from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    rng = np.random.default_rng(0)
    rows = [
        (k / 20, "rgb", 200 + 100 * k / 20 + rng.normal(), 300 + rng.normal(), 80, 60, 0.9) for k in range(60)
    ]
    table = pd.DataFrame(rows, columns=["t", "sensor", "left", "top", "width", "height", "score"])
    table.to_csv(folder / "d.csv", index=False)
    command = ["track", str(folder / "d.csv"), "--out", str(folder / "run"), "--smoother", "full"]
    command += ["--image", "1920x1080"]
    assert main(command) == 0
    return folder / "run"


def test_solved_it_is_the_smoothed_table(run):
    table = pd.read_csv(run / "smoothed.csv")
    (number,) = table.track_id.unique()
    made = jeat_graph.factor_graph(run)
    motion = made.motion(made.solve(), number)
    rows = table.set_index(table.t.round(6))
    for t, state in zip(made.times_s[number][5:], motion[5:], strict=True):
        if round(t, 6) in rows.index:
            row = rows.loc[round(t, 6)]
            np.testing.assert_allclose(state[:, 0], [row.x, row.y], atol=0.1)
            np.testing.assert_allclose(state[0, 1], row.vx, atol=1.0)


def test_one_track_can_be_chosen_and_a_strange_one_is_refused(run):
    number = int(pd.read_csv(run / "smoothed.csv").track_id[0])
    assert list(jeat_graph.factor_graph(run, number).times_s) == [number]
    with pytest.raises(DataError, match=f"has no reported track 99; there are {number}"):
        jeat_graph.factor_graph(run, tracks=[99])
