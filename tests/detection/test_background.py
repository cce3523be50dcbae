"""What stands out of the events that a place always has; and what of a cloud that falls into pieces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import poisson

from jeat_graph.detection.background import BackgroundSettings, UsualActivity
from jeat_graph.detection.components import Marked
from jeat_graph.detection.event_detector import EventDetector
from jeat_graph.detection.memory import CloudMemory
from jeat_graph.detection.noise import NoiseSettings
from jeat_graph.detection.settings import EventSettings

from .moving import SIZE, box_at, events_of, iou

CAR = ((10, 60), (260, 20), (40, 20))
RATE_HZ = 50.0


def windows(mean, count, seed=0, size=(96, 80)):
    """Windows (H, W) of independent events, so many in a pixel on average."""
    rng = np.random.default_rng(seed)
    return rng.poisson(mean, (count, size[1], size[0])).astype(np.uint16)


def around(window, side):
    """Sums of squares around each pixel, mirrored at the edges but for the edge itself."""
    half = side // 2
    padded = np.pad(window.astype(float), half, mode="reflect")
    height, width = window.shape
    return np.array([[padded[r : r + side, c : c + side].sum() for c in range(width)] for r in range(height)])


def test_what_stands_out_is_what_a_slow_search_finds():
    settings = BackgroundSettings(sigmas=3.0, around_px=3, adapt_s=0.2)
    background = UsualActivity((32, 32), RATE_HZ, settings)
    shown = windows(0.4, 6, size=(32, 32))
    shown[3:, 10:16, 12:20] += 2
    mean = None
    for k, window in enumerate(shown):
        sums = around(window, 3)
        found = background.standing_out(window)
        if mean is None:
            mean = background._mean.astype(float)
            continue  # what was usual at first: below
        least = mean + 3.0 * np.sqrt(mean) + 2.0
        np.testing.assert_array_equal(found, np.where(sums > least, window, 0))
        slow = 1.0 / (0.2 * RATE_HZ)
        more = np.minimum(sums - mean, np.sqrt(mean) + 0.5)
        mean += np.where(sums > least, slow * more, max(slow, 1.0 / (k + 2.0)) * (sums - mean))
        np.testing.assert_allclose(background._mean, mean, rtol=1e-5)
        mean = background._mean.astype(float)
    assert found[11:15, 13:19].all()


def test_at_first_a_vehicle_that_fills_half_of_what_is_near_stands_out_of_noise():
    window = windows(0.5, 1, size=(320, 200))[0]
    window[60:160, 100:180] += windows(2.0, 1, seed=3, size=(80, 100))[0]
    found = UsualActivity((320, 200), RATE_HZ, BackgroundSettings()).standing_out(window) > 0
    shown = window > 0
    assert found[62:158, 102:178][shown[62:158, 102:178]].mean() > 0.95
    found[55:165, 95:185] = False
    assert found.mean() < 0.001


@pytest.mark.parametrize("mean", [0.0005, 0.02, 0.2, 1.0, 4.0])
def test_noise_of_any_strength_hardly_stands_out(mean):
    """By independent events a share of Q(5) would; that means are learnt and whole adds to it."""
    background = UsualActivity((96, 80), RATE_HZ, BackgroundSettings())
    found = [background.standing_out(window) > 0 for window in windows(mean, 200)]
    assert np.mean(found[20:]) < 1e-4
    # A mean of none in the squares of a hundred windows leaves no more than what two events are rarer than.
    assert poisson.sf(2, 25 * 0.0005) < 1e-5


def test_more_events_stand_out_until_they_are_usual():
    """A lamp that trembles is usual after some time; a vehicle that passes is not for as long as it takes."""
    background = UsualActivity((96, 80), RATE_HZ, BackgroundSettings(adapt_s=0.5))
    shown = windows(0.3, 500)
    lamp = windows(2.0, 500, seed=1)[:, :8, :8]
    shown[100:, 30:38, 40:48] += lamp[100:]
    found = np.array([(background.standing_out(w)[30:38, 40:48] > 0).mean() for w in shown])
    assert found[:100].max() == 0.0
    assert found[100:115].min() > 0.5
    assert found[-50:].max() < 0.05


def test_all_events_count_where_nothing_is_to_stand_out():
    window = windows(0.5, 1)[0]
    background = UsualActivity((96, 80), RATE_HZ, BackgroundSettings(sigmas=0.0))
    np.testing.assert_array_equal(background.standing_out(window), window)


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (16, 16), (33, 100)])
def test_pictures_of_any_size(size):
    background = UsualActivity(size, RATE_HZ, BackgroundSettings())
    for window in windows(0.2, 3, size=size):
        assert background.standing_out(window).shape == window.shape


def test_what_was_usual_is_forgotten():
    """After a leap in time the light may be another: what is usual is learnt again, at once."""
    settings = BackgroundSettings()
    first, then = UsualActivity((96, 80), RATE_HZ, settings), UsualActivity((96, 80), RATE_HZ, settings)
    for window in windows(0.1, 5):
        first.standing_out(window)
    first.forget()
    for window in windows(3.0, 5, seed=2):
        np.testing.assert_array_equal(first.standing_out(window), then.standing_out(window))


def test_a_vehicle_is_found_in_noise_in_which_all_is_one_cloud():
    """Some .8 events of noise a pixel and window: without a background everything is linked."""

    def overlaps(settings):
        detector, events = EventDetector(SIZE, settings=settings), events_of([CAR], 1.0, noise_hz_px=20.0)
        found = []
        for rows in np.array_split(np.arange(len(events)), 20):
            found += detector.push(events.take(rows))
        scans = [scan for scan in found if scan.t > 0.2]
        best = [max((iou(box, box_at(*CAR, s.t)) for box in s.boxes), default=0.0) for s in scans]
        return best, [len(scan) for scan in scans]

    best, counts = overlaps(EventSettings())
    assert np.mean(np.array(best) > 0.5) > 0.95
    assert np.mean(counts) < 1.3
    best, _ = overlaps(
        EventSettings(background=BackgroundSettings(sigmas=0.0), noise=NoiseSettings(alone=True))
    )
    assert np.mean(np.array(best) > 0.5) < 0.05


def body(ends):
    """Pixels of a body of 60 x 10 px, or of its ends alone: two clouds."""
    columns = np.r_[0:60] if not ends else np.r_[0:8, 52:60]
    y, x = np.meshgrid(np.arange(20, 30), columns + 30, indexing="ij")
    group = np.where(x < 60, 1, 2) if ends else np.ones_like(x)
    order = np.lexsort([x.ravel(), y.ravel()])
    parts = [part.ravel()[order].astype(np.int32) for part in (x, y, group, np.ones_like(x))]
    return (2 if ends else 1), Marked(*parts)


def test_pieces_are_one_for_a_while_after_the_whole_and_then_two():
    memory = CloudMemory(link_px=5, apart_steps=2, piece_steps=4)
    counts = []
    for step in range(16):
        count, marked = memory.relabel(*body(ends=5 <= step < 8 or step >= 9))
        counts.append(count)
        extents = [marked.x[marked.group == k + 1] for k in range(count)]
        memory.remember(np.array([[x.min(), 20.0, x.max() + 1 - x.min(), 10.0] for x in extents]))
    # Three steps in pieces are bridged; after one more as a whole four are again, and no more.
    assert counts == [1] * 13 + [2] * 3
