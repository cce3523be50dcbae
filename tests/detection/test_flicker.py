"""Lamps that flicker with the mains are left out of events; what moves, and noise, stays."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.core import detection as core
from jeat_graph.data.events import EventArray
from jeat_graph.detection.event_detector import EventDetector
from jeat_graph.detection.lamps import RULE
from jeat_graph.detection.settings import EventSettings

SIZE = (64, 48)


def twin(t, x, y, polarity):
    """The rule, event by event: which stay."""
    shortest, longest, forgotten, least = RULE
    rise, kept, brighter = {}, {}, {}
    stays = []
    for now, at, sign in zip(
        t.tolist(), zip(x.tolist(), y.tolist(), strict=True), polarity.tolist(), strict=True
    ):
        since = now - rise.get(at, -(1 << 62))
        count = 0 if since > forgotten else kept.get(at, 0)
        if sign and not brighter.get(at, False) and since >= shortest // 4:
            if since < shortest or since > 3 * longest:
                count = max(count - 1, 0)
            elif since <= longest:
                count = min(count + 1, 2 * least)
            rise[at] = now
        kept[at], brighter[at] = count, bool(sign)
        stays.append(count < least)
    return np.array(stays)


def lamp(hz, seconds=1.0, jitter_us=600.0, share=0.8, at=(30, 20), side=7, seed=0):
    """Events of a square lamp: brighter and darker once a period, some of them missing, all a little off."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:side, :side]
    found = []
    for k in range(int(seconds * hz)):
        for sign, later in ((1, 0.0), (0, 0.5)):
            times = 1e6 * (k + later) / hz + 5_000 + rng.normal(0.0, jitter_us, side * side)
            kept = rng.random(side * side) < share
            found.append(
                np.column_stack(
                    [times, at[0] + column.ravel(), at[1] + row.ravel(), np.full(side * side, sign)]
                )[kept]
            )
    return np.concatenate(found)


def edge(speed_px_s=60.0, seconds=0.9):
    """Events of a bright bar that crosses the picture: its front brighter, its back darker."""
    found = []
    for column in range(4, 56):
        for sign, width in ((1, 0), (0, 8)):
            t = 1e6 * (column + width - 4) / speed_px_s
            found += [[t + 40 * row, column, row, sign] for row in range(4, 12) if t < 1e6 * seconds]
    return np.array(found, dtype=float)


def noise(rng, count, columns, rows):
    """Events at any time, in some columns and rows, of any polarity."""
    places = rng.integers(*columns, count), rng.integers(*rows, count)
    return np.column_stack([rng.uniform(0, 1e6, count), *places, rng.integers(0, 2, count)])


def events(*parts):
    rows = np.concatenate(parts)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    t, x, y, p = rows.T
    return EventArray(t.astype(np.int64), x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8))


def stays(given, size=SIZE):
    """Which events are of no pixel that flickers."""
    width, height = size
    good = np.ones(len(given), dtype=bool)
    rise = np.full((height, width), -(1 << 62), dtype=np.int64)
    state = np.zeros((height, width), dtype=np.uint8)
    for part in np.array_split(np.arange(len(given)), 7):  # pieces of any size
        one = given.take(part)
        core.leave_flicker(
            one.t_us, one.x, one.y, one.polarity, rise, state, RULE, good[part[0] : part[-1] + 1]
        )
    return good


@pytest.mark.parametrize("seed", range(3))
def test_the_core_does_what_the_rule_says(seed):
    rng = np.random.default_rng(seed)
    noise = np.column_stack(
        [
            rng.uniform(0, 1e6, 3000),
            rng.integers(28, 36, 3000),
            rng.integers(18, 26, 3000),
            rng.integers(0, 2, 3000),
        ]
    )
    given = events(lamp(100, seed=seed), noise)
    good = stays(given)
    np.testing.assert_array_equal(good, twin(given.t_us, given.x, given.y, given.polarity))
    assert 0 < np.count_nonzero(good) < len(given)


@pytest.mark.parametrize("hz", [100.0, 120.0])
def test_a_lamp_is_left_out_after_a_tenth_of_a_second(hz):
    given = events(lamp(hz))
    good = stays(given)
    late = given.t_us > 150_000
    assert good[~late].any()
    assert good[late].mean() < 0.02


@pytest.mark.parametrize("hz", [10.0, 50.0, 200.0])
def test_what_flickers_otherwise_stays(hz):
    given = events(lamp(hz, jitter_us=100.0, share=1.0))
    assert stays(given).mean() > 0.95


def test_an_edge_that_moves_stays_and_so_does_random_noise():
    rng = np.random.default_rng(3)
    places = rng.integers(0, 64, 4000), rng.integers(0, 48, 4000)
    noise = np.column_stack([rng.uniform(0, 1e6, 4000), *places, rng.integers(0, 2, 4000)])
    assert stays(events(edge())).all()
    assert stays(events(noise)).mean() > 0.999


def test_motion_finds_no_lamp():
    def scans_of(pieces, settings=None):
        detector = EventDetector(SIZE, settings=settings)
        given = events(lamp(100))
        found = [
            scan
            for part in np.array_split(np.arange(len(given)), pieces)
            for scan in detector.push(given.take(part))
        ]
        return [*found, *detector.finish()]

    scans = scans_of(1)
    assert len(scans) > 40
    assert sum(len(scan) for scan in scans if scan.t < 0.1) <= 3
    assert not any(len(scan) for scan in scans if scan.t > 0.1)
    for one, other in zip(scans, scans_of(33), strict=True):  # the pieces do not show
        np.testing.assert_array_equal(one.boxes, other.boxes)
    assert sum(map(len, scans_of(1, EventSettings(lamps=False)))) > 40
