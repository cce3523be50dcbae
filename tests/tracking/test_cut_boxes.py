"""A vehicle that enters, crosses and leaves the picture keeps its identity; its visible box is reported."""

import numpy as np
import pytest

from jeat_graph import Tracker
from jeat_graph.config.reading import load_config
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.smoothing.cut_sides import place_by_sides
from jeat_graph.tracking.smoothing.priors import size_prior_of
from jeat_graph.tracking.smoothing.sizes import SizeWindow

WIDTH, HEIGHT = 400.0, 200.0
CAR = np.array([120.0, 60.0])
SPEED, RATE = 150.0, 10.0


def crossing(edge_px, speed=SPEED, noise=0.5, engine="rts", fetch=False):
    """Track a car of 120 px that drives through a picture of 400 px; the detector cuts its boxes."""
    config = load_config("default", (f"image.edge_px={edge_px}", f"smoother.engine={engine}"))
    tracker = Tracker(config, image=(WIDTH, HEIGHT))
    rng, causal, shown = np.random.default_rng(0), [], {}
    for k in range(int((WIDTH + 2 * CAR[0]) / speed * RATE)):
        t, centre = k / RATE, -CAR[0] + speed * k / RATE
        low, high = max(centre - 60.0, 0.0), min(centre + 60.0, WIDTH)
        boxes, scores = np.zeros((0, 4)), np.zeros(0)
        if high - low > 5.0:
            error = rng.normal(0.0, noise, 2)
            low += error[0] if low > 0.0 else 0.0
            high += error[1] if high < WIDTH else 0.0
            boxes, scores = np.array([[low, 70.0, high - low, CAR[1]]]), np.array([0.95])
            shown[t] = (centre, low, high)
        causal.append(tracker.step((t, "rgb", boxes, scores)))
        if fetch and k % 7 == 0:
            tracker.smoothed()
    return Trajectories.concatenate([c for c in causal if len(c)]), tracker.finish(), shown


@pytest.fixture(scope="module")
def tracked():
    return crossing(3.0)


def test_one_identity_from_edge_to_edge(tracked):
    causal, smoothed, _ = tracked
    assert len(np.unique(causal.track_id)) == 1
    assert len(np.unique(smoothed.track_id)) == 1


def test_what_shows_is_reported_to_the_last(tracked):
    causal, _, shown = tracked
    # Confirmed at its second detection, at the latest, and lost at none.
    assert len(causal) >= len(shown) - 1
    for t, box in zip(causal.t, causal.boxes, strict=True):
        _, low, high = shown[float(t)]
        # Its sides are measured to half a pixel; the filter assumes 1.5 px and 4.5 % of the size.
        assert box[0] == pytest.approx(low, abs=6.0)
        assert box[0] + box[2] == pytest.approx(high, abs=6.0)


def test_the_centre_is_that_of_the_whole_vehicle(tracked):
    causal, smoothed, shown = tracked
    for table, since in ((causal, WIDTH - 60.0), (smoothed, -1e9)):
        leaving = [k for k, t in enumerate(table.t) if shown[float(t)][0] > since]
        assert len(leaving) > 3
        error = [table.mean[k, 0] - shown[float(table.t[k])][0] for k in leaving]
        # Of the part that shows, the middle would be up to 55 px off.
        assert np.abs(error).max() < 12.0


def test_taken_for_whole_its_centre_is_that_of_the_part_that_shows():
    causal, _, shown = crossing(0.0)
    last = shown[float(causal.t[-1])]
    assert causal.mean[-1, 0] < last[0] - 20.0


def test_variance_of_a_cut_box_owns_up_to_the_unknown_size(tracked):
    causal, _, shown = tracked
    centre = np.array([shown[float(t)][0] for t in causal.t])
    ratio = (causal.mean[:, 0] - centre) ** 2 / causal.var[:, 0]
    # What a first sliver belongs to may be anything; from a third of it on the size is guessed well enough.
    a_third = np.array([shown[float(t)][2] - shown[float(t)][1] > 40.0 for t in causal.t])
    assert ratio[a_third].max() < 9.0


# With a lag the size of the first sliver is a guess for ever: an eighth of the car.
@pytest.mark.parametrize(("engine", "off"), [("rts", 8.0), ("fixed-lag-rts", 16.0), ("fixed-lag", 16.0)])
def test_smoothed_boxes_end_where_what_shows_does(engine, off):
    _, smoothed, shown = crossing(3.0, engine=engine)
    assert len(smoothed) >= len(shown) - 2
    for t, box in zip(smoothed.t, smoothed.boxes, strict=True):
        _, low, high = shown[float(t)]
        assert box[0] == pytest.approx(low, abs=off)
        assert box[0] + box[2] == pytest.approx(high, abs=off)


@pytest.mark.parametrize("engine", ["rts", "full"])
def test_a_look_in_between_changes_nothing(engine):
    once, looked = (crossing(3.0, engine=engine, fetch=fetch)[1] for fetch in (False, True))
    assert np.array_equal(once.boxes, looked.boxes)
    assert np.array_equal(once.mean, looked.mean)


def test_two_detectors_that_disagree_about_a_cut_box_do_not_drive_its_size_off():
    """One sees the edge, the other stops short of it: a car beside ours for six seconds."""
    rng = np.random.default_rng(0)
    noise = "{rate_hz: 10, sigma_px: 0.7, rho_size: 0.02, sigma_log_width: 0.03, sigma_log_height: 0.03}"
    tracker = Tracker(
        load_config("default", (f"sensors.short={noise}", f"sensors.whole={noise}", "smoother.engine=none"))
    )
    for k in range(60):
        cut = np.array([[0.0, 200.0, 379.0 + rng.normal(0.0, 1.0), 160.0]])
        short = np.array([[10.0, 200.0, 355.0 + rng.normal(0.0, 1.0), 160.0]])
        table = tracker.step([(k / 10.0, "whole", cut, np.ones(1)), (k / 10.0, "short", short, np.ones(1))])
    assert len(table) == 1
    width = tracker.snapshot().tracks.size_mean[0, 0]
    assert abs(width[1]) < 0.2
    assert np.exp(width[0]) == pytest.approx(370.0, rel=0.04)


def test_a_size_that_nobody_measures_stays_within_that_of_vehicles():
    tracker = Tracker(load_config("default", ("smoother.engine=none",)))
    for k in range(200):
        box = np.array([[300.0, 600.0, 120.0, 120.0]])  # its lower side is below the picture
        tracker.step((k / 20.0, "rgb", box, np.ones(1)))
    snapshot = tracker.snapshot().tracks
    assert np.sqrt(snapshot.size_cov[0, 1, 0, 0]) <= 1.05
    assert np.sqrt(snapshot.cov[0, 1, 0, 0]) < 200.0


@pytest.mark.parametrize(("edge_px", "tracks"), [(3.0, 1), (0.0, 0)])
def test_a_vehicle_begins_where_it_would_not_end(edge_px, tracks):
    """A detector that guesses the whole of a car at the edge: its centre is outside, a part of it shows."""
    config = load_config("default", [f"image.edge_px={edge_px}", "smoother.engine=none"])
    tracker = Tracker(config, image=(1280, 720))
    for k in range(3):
        tracker.step((0.05 * k, "rgb", [[-60.0 + k, 300.0, 90.0, 50.0]], [0.9]))
        assert tracker.num_tracks == tracks


def test_smoothed_anew_the_side_that_shows_is_as_exact_as_the_filter_took_it_for():
    """By score and by sensor; what is added is what the size leaves open now."""
    settings = ["noise.score_weighting=true", "smoother.engine=none", "image.edge_px=3"]
    tracker = Tracker(load_config("default", settings), image=(640, 360), diagnostics=True)
    parts = []
    for k in range(30):
        left, right = max(-40.0 + 4.0 * k, 0.0), 40.0 + 4.0 * k
        score = 0.3 if k < 6 else 0.9
        tracker.step((0.05 * k, "rgb", [[left, 100.0, right - left, 50.0]], [score]))
        parts.append(tracker.last_measurements()[0])
    rows = np.concatenate(parts)
    rows = rows[rows["track_id"] == 1]
    cut = np.flatnonzero(rows["cut"][:, 0] != 0)
    assert len(cut) > 5
    window = SizeWindow(size_prior_of(rows[0]), tracker.config.size.rate_density)
    window.append(rows[1:])
    sizes = window.smooth()
    placed = place_by_sides(rows, sizes)
    at = np.searchsorted(sizes.t, rows["t"][cut])
    half = 0.5 * np.exp(sizes.mean[at, 0, 0])
    # The same noise along both axes here, and nothing cuts the box along y.
    np.testing.assert_allclose(placed["r"][cut, 0], rows["r"][cut, 1] + half**2 * sizes.cov[at, 0, 0, 0])
    np.testing.assert_allclose(placed["z"][cut, 0], 40.0 + 4.0 * cut - half)
    np.testing.assert_array_equal(placed["coloured_std"], rows["coloured_std"])
