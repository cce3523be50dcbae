"""A vehicle that no sensor sees for a while: it is held where it was going, and found again."""

import numpy as np

from jeat_graph import Tracker, load_config

_RATE_HZ = 25.0


def walk(seed, unseen=(1.2, 1.9), duration=2.6):
    """Scans of somebody who walks at constant speed, whose box swings; for a while he is out of sight."""
    rng = np.random.default_rng(seed)
    for k in range(int(duration * _RATE_HZ)):
        t = k / _RATE_HZ
        # The box is as wide as the stride, and a little late or early for half a second at a time.
        width = 60.0 * (1.0 + 0.15 * np.sin(2.0 * np.pi * t / 0.9))
        x = 200.0 + 60.0 * t + 3.0 * np.sin(2.0 * np.pi * t / 1.1) + rng.normal(0.0, 2.0)
        box = [x - 0.5 * width, 100.0 + rng.normal(0.0, 2.0), width, 180.0]
        seen = not unseen[0] <= t < unseen[1]
        yield t, "rgb", np.array([box] if seen else []).reshape(-1, 4), np.full(int(seen), 0.9)


def coasted(seed, *changes):
    """Track one walk: the state just before he is seen again, and the identities that were given."""
    tracker = Tracker(load_config("default", changes), image=(640, 480))
    ids, held = set(), {}
    for scan in walk(seed):
        ids |= set(tracker.step(scan).track_id.tolist())
        if scan[0] < 1.89:
            held = {name: a[:1].copy() for name, a in tracker._tracks._asdict().items()}
    return held, ids


def test_the_one_out_of_sight_neither_grows_nor_is_thrown_across_the_picture():
    off, grown = [], []
    for seed in range(6):
        held, ids = coasted(seed)
        assert ids == {1}
        off.append(abs(held["mean"][0, 0, 0] - (200.0 + 60.0 * 1.88)))
        grown.append(abs(held["size_mean"][0, 0, 0] - np.log(60.0)))
    assert np.median(off) < 30.0  # half of his width, after .7 s
    assert np.max(grown) < 0.4


def test_what_is_forgotten_is_what_would_throw_him():
    kept, forgotten = [], []
    for seed in range(6):
        for out, changes in ((kept, ("motion.unseen_memory_s=0",)), (forgotten, ())):
            held, _ = coasted(seed, *changes)
            out.append(abs(held["size_mean"][0, 0, 0] - np.log(60.0)))
    assert np.median(forgotten) < 0.7 * np.median(kept)
