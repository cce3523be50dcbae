"""What nobody sees is reported for longer where it was right before, by what becomes of such tracks."""

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.tracking.reporting import longest_gap_s

RATE_HZ, GAP = 20.0, 8
PERIOD = 1.0 / RATE_HZ
# Scans from one gap of a lane to its next, and lanes.
EVERY, LANES = 40, 5


def drive(comes_back, overrides=(), scans=600):
    """Follow walkers, one a lane, each hidden for `GAP` scans once in `EVERY`, by turns.

    Args:
        comes_back: whether they go on where they went; otherwise another comes along elsewhere in the lane.
        overrides: of the settings.
        scans: so many.

    Returns:
        The tracker, and for each scan how many rows were of walkers that were hidden.
    """
    tracker = Tracker(load_config("default", ["smoother.engine=none", "image.width=4000", *overrides]))
    unseen, rng = [], np.random.default_rng(0)
    shift = np.zeros(LANES)
    for k in range(scans):
        boxes = []
        for lane in range(LANES):
            phase = (k + lane * EVERY // LANES) % EVERY
            if phase == 0 and not comes_back:
                shift[lane] += 150.0
            if phase >= GAP:
                error = rng.normal(0.0, 0.5, 2)
                boxes.append([50 + shift[lane] + 2.0 * k + error[0], 100 + 120 * lane + error[1], 40, 80])
        table = tracker.step((k * PERIOD, "rgb", np.array(boxes).reshape(-1, 4), np.full(len(boxes), 0.9)))
        unseen.append(int((table.used == 0).sum()))
    return tracker, np.array(unseen)


def gap_s(tracker):
    return longest_gap_s(tracker._scene, tracker._model, tracker._t)


def test_walkers_who_always_come_out_where_they_were_expected_are_reported_while_hidden():
    _, unseen = drive(comes_back=True)
    _, usual = drive(comes_back=True, overrides=["output.gap_memory=0"])
    # By itself `default` shows the first scan of each gap alone.
    assert usual[200:].mean() == pytest.approx(LANES / EVERY, abs=0.1)
    # Two right ones are not enough.
    assert unseen[:32].sum() == usual[:32].sum()
    assert unseen[300:].mean() > 0.7 * LANES * GAP / EVERY


def test_where_they_do_not_come_back_nothing_changes():
    tracker, unseen = drive(comes_back=False)
    _, usual = drive(comes_back=False, overrides=["output.gap_memory=0"])
    np.testing.assert_array_equal(unseen, usual)
    assert gap_s(tracker) < 3 * PERIOD


def test_what_changes_is_learnt_anew():
    tracker, _ = drive(comes_back=True)
    assert gap_s(tracker) >= GAP * PERIOD * 0.9
    memory = ["output.gap_memory=20"]
    tracker, _ = drive(comes_back=True, overrides=memory)
    for k in range(600, 1500):  # nobody is found again: everybody new stays for .4 s
        x = 100.0 + 700.0 * ((k // 8) % 4)
        tracker.step((k * PERIOD, "rgb", [[x, 300.0, 40.0, 80.0]], [0.9]))
    assert gap_s(tracker) < 3 * PERIOD
