"""Things that move, with what an event camera and a camera would see of them."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.events import EventArray

SIZE = (320, 200)


def box_at(start, velocity, side, t):
    """Left, top, width, height (px) of a rectangle at time t (s)."""
    return np.array([start[0] + velocity[0] * t, start[1] + velocity[1] * t, side[0], side[1]])


def events_of(things, duration_s, noise_hz_px=0.0, seed=0, size=SIZE):
    """Events of rectangles (start, velocity in px/s, side in px), all over their bodies, and of noise."""
    rng = np.random.default_rng(seed)
    t, x, y = [], [], []
    for start, velocity, side in things:
        speed = float(np.hypot(*velocity))
        count = int(duration_s * speed * side[1] * 6)
        times = rng.uniform(0, duration_s, count)
        inside = rng.uniform(0, 1, (count, 2))
        inside[: count // 4] = np.rint(inside[: count // 4])  # more of them at the edges
        t.append(times)
        x.append(start[0] + velocity[0] * times + inside[:, 0] * side[0])
        y.append(start[1] + velocity[1] * times + inside[:, 1] * side[1])
    count = int(noise_hz_px * size[0] * size[1] * duration_s)
    t.append(rng.uniform(0, duration_s, count))
    x.append(rng.uniform(0, size[0], count))
    y.append(rng.uniform(0, size[1], count))
    t, x, y = (np.concatenate(parts) for parts in (t, x, y))
    good = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1])
    order = np.argsort(t[good], kind="stable")
    columns = [part[good][order] for part in (t, x, y)]
    return EventArray(
        (columns[0] * 1e6).astype(np.int64),
        columns[1].astype(np.uint16),
        columns[2].astype(np.uint16),
        rng.integers(0, 2, len(order)).astype(np.uint8),
    )


def picture_of(things, t, background, rng, noise=3.0):
    """A grey picture (H, W, 3) with the rectangles at time t over a background."""
    out = background.astype(np.float64).copy()
    for (start, velocity, side), level in things:
        left, top, width, height = np.rint(box_at(start, velocity, side, t)).astype(int)
        out[max(top, 0) : max(top + height, 0), max(left, 0) : max(left + width, 0)] = level
    out += rng.normal(0, noise, out.shape)
    return np.repeat(np.clip(out, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def iou(a, b):
    """Intersection over union of two boxes."""
    low, high = np.maximum(a[:2], b[:2]), np.minimum(a[:2] + a[2:], b[:2] + b[2:])
    common = np.prod(np.clip(high - low, 0, None))
    return common / (a[2] * a[3] + b[2] * b[3] - common)
