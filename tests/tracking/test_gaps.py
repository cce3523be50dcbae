"""What nobody sees is reported for longer where it was right before, by what becomes of such tracks."""

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.tracking.reporting import longest_gaps_s

RATE_HZ, GAP = 20.0, 8
PERIOD = 1.0 / RATE_HZ
# Scans from one gap of a lane to its next, and lanes.
EVERY, LANES = 40, 5


def drive(comes_back, overrides=(), scans=600, since=0.0, jump=0.0):
    """Follow walkers, one a lane, each hidden for `GAP` scans once in `EVERY`, by turns.

    Args:
        comes_back: whether they go on where they went; otherwise another comes along elsewhere in the lane.
        overrides: of the settings.
        since: time of the first scan (s).
        jump: how far from where they were expected they come out (px).
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
            if phase == GAP:
                shift[lane] += jump
            if phase >= GAP:
                error = rng.normal(0.0, 0.5, 2)
                boxes.append([50 + shift[lane] + 2.0 * k + error[0], 100 + 120 * lane + error[1], 40, 80])
        table = tracker.step(
            (since + k * PERIOD, "rgb", np.array(boxes).reshape(-1, 4), np.full(len(boxes), 0.9))
        )
        unseen.append(int((table.used == 0).sum()))
    return tracker, np.array(unseen)


def gap_s(tracker):
    return longest_gaps_s(tracker._scene, tracker._model, tracker._t)[1]


def test_walkers_who_always_come_out_where_they_were_expected_are_reported_while_hidden():
    _, unseen = drive(comes_back=True)
    _, usual = drive(comes_back=True, overrides=["output.gap_memory=0"])
    # By itself `default` shows the first scan of each gap alone.
    np.testing.assert_array_equal(np.flatnonzero(usual[200:]) % (EVERY // LANES), 0)
    assert set(usual[200:]) == {0, 1}
    # Two right ones are not enough, three are.
    assert unseen[:32].sum() == usual[:32].sum()
    assert unseen[32:40].sum() > usual[32:40].sum()
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


def test_who_comes_out_elsewhere_was_not_where_the_rows_would_have_been():
    tracker, unseen = drive(comes_back=True, jump=24.0)
    _, usual = drive(comes_back=True, jump=24.0, overrides=["output.gap_memory=0"])
    assert len(tracker.causal()) >= LANES - 1  # they are found again, as themselves
    assert tracker._next_id < 4 * LANES
    assert gap_s(tracker) < 0.5 * GAP * PERIOD
    assert unseen[100:].sum() < 2.5 * usual[100:].sum()


@pytest.mark.parametrize("since", [-1000.0, 1.7e9])
def test_it_does_not_matter_when_the_clock_began(since):
    _, usual = drive(comes_back=True)
    _, unseen = drive(comes_back=True, since=since)
    np.testing.assert_array_equal(unseen, usual)


def test_what_is_learnt_holds_for_what_is_whole_in_the_picture():
    """Two walkers, one at the edge, are missed for six scans again and again, and found where they were."""
    tracker = Tracker(load_config("default", ["smoother.engine=none", "image.width=800", "image.height=600"]))
    rng, unseen = np.random.default_rng(2), np.zeros(2)
    for k in range(900):
        found = [[400.0, 100.0, 40.0, 80.0], [770.0, 400.0, 30.0, 80.0]] if k % 20 >= 6 else []
        boxes = np.array(found).reshape(-1, 4) + rng.normal(0.0, 0.2, (len(found), 4)) * [1, 1, 0, 0]
        table = tracker.step((k * PERIOD, "rgb", boxes, np.full(len(boxes), 0.9)))
        late = table.take(np.flatnonzero((table.used == 0) & (k > 300)))
        unseen += [np.count_nonzero(late.boxes[:, 0] < 600), np.count_nonzero(late.boxes[:, 0] > 600)]
    assert unseen[0] >= 4 * 30  # of six in each of thirty gaps
    assert unseen[1] <= 0.5 * unseen[0]  # by the usual gap


def test_of_two_sensors_boxes_the_better_counts_in_whatever_order_they_come():
    """One sensor's boxes lie beside the walker, who is missed by both for a while, again and again."""
    options = ["smoother.engine=none", "image.width=3000", "sensors.other={rate_hz: 20}"]
    aside, shares = np.array([12.0, 12.0, 0.0, 0.0]), []
    for order in (1, -1):
        tracker = Tracker(load_config("default", options))
        for k in range(400):
            boxes = np.array([[50.0 + 3.0 * k, 200.0, 40.0, 80.0]])
            seen = boxes if k % 20 >= 5 else boxes[:0]
            score = np.full(len(seen), 0.9)
            scans = [(k * PERIOD, "rgb", seen, score), (k * PERIOD, "other", seen + aside, score)]
            tracker.step(scans[::order])
        shares.append(tracker._scene.gap_share.copy())
    np.testing.assert_array_equal(*shares)
    assert shares[0][:3].min() > 0.7
