"""Windows of events hold what a histogram of their events holds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.windows import EventBins

from .moving import events_of

SIZE = (64, 40)
THINGS = [((5, 5), (200, 60), (20, 10))]


def brute_force(events, end_us, bins, bin_us):
    edges = end_us - bin_us * np.arange(bins, -1, -1)
    columns = []
    for first, last in pairwise(edges.tolist()):
        part = events.between(first, last)
        for polarity in (0, 1):
            of_it = part.take(part.polarity == polarity)
            counts, *_ = np.histogram2d(
                of_it.y, of_it.x, bins=(SIZE[1], SIZE[0]), range=((0, SIZE[1]), (0, SIZE[0]))
            )
            columns.append(counts)
    return np.array(columns)


@pytest.mark.parametrize("dense", [False, True])
def test_every_window_is_the_histogram_of_its_events(dense):
    """Bins of many events are emptied as a whole, those of few event by event."""
    events = events_of(THINGS, 0.2, noise_hz_px=5.0, size=SIZE)
    events = events if dense else events.take(slice(None, None, 20))
    ring = EventBins(SIZE, bins=10, bin_s=0.005)
    for k in range(40):
        ring.advance(events.between(k * 5000, (k + 1) * 5000))
        assert ring.end_us == (k + 1) * 5000
        expected = brute_force(events, ring.end_us, 10, 5000)
        np.testing.assert_array_equal(ring.stack(), expected)
        np.testing.assert_array_equal(ring.stack(by_polarity=True), [*expected[::2], *expected[1::2]])
        np.testing.assert_array_equal(ring.total, expected.sum(axis=0))
        y, x = np.nonzero(ring.total)
        for part in (slice(None), slice(20)):  # many pixels are asked for otherwise than few
            np.testing.assert_array_equal(
                ring.recent(3, y[part], x[part]), expected[-6:].sum(axis=0)[y[part], x[part]]
            )


def test_a_leap_empties_the_window():
    ring = EventBins(SIZE)
    ring.advance(events_of(THINGS, 0.005, size=SIZE))
    assert ring.total.any()
    ring.skip_to(10_000_000)
    assert not ring.total.any()
    assert not ring.stack().any()


def test_many_events_of_one_pixel_do_not_overflow():
    events = events_of(THINGS, 0.005, size=SIZE)
    many = events.take(np.zeros(600, dtype=np.int64))
    ring = EventBins(SIZE, bins=2)
    ring.advance(many)
    assert ring.total.max() == 255
    ring.advance(many)
    ring.advance(many.take(slice(0, 0)))
    ring.advance(many.take(slice(0, 0)))
    assert not ring.total.any()


def test_a_window_needs_bins():
    with pytest.raises(ConfigError, match="windows need bins"):
        EventBins(SIZE, bins=0)


def test_whoever_gives_events_may_use_their_memory_again():
    ring, again = EventBins(SIZE, bins=4), EventBins(SIZE, bins=4)
    rng = np.random.default_rng(0)
    events = events_of(THINGS, 0.2, noise_hz_px=5.0, size=SIZE).take(slice(None, None, 20))
    for k in range(20):
        part = events.between(k * 5000, (k + 1) * 5000)
        ring.advance(part)
        own = part.take(np.arange(len(part)))
        again.advance(own)
        own.x[:], own.y[:] = rng.integers(0, SIZE[0], len(own)), rng.integers(0, SIZE[1], len(own))
        np.testing.assert_array_equal(ring.stack(), again.stack())
        np.testing.assert_array_equal(ring.total, again.total)
