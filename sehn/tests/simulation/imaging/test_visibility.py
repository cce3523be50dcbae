from __future__ import annotations

import numpy as np

from jeat_graph_sehn.simulation.imaging.shapes import FACE_CORNERS, shape_of
from jeat_graph_sehn.simulation.imaging.visibility import buffers
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

from .scenes import CAR, renderer_of

TRAFFIC = [
    CAR,
    (3, 4.3, 27.0, 22.0, 11.0, 2.5, 3.7),
    (1, -4.0, 30.0, -25.0, 4.7, 1.9, 1.72),
    (2, -4.2, 38.0, -25.0, 5.6, 2.0, 2.4),
    (0, -7.6, 33.0, -25.0, 4.4, 1.8, 1.4),
]


def cast(rows, renderer, width: int, height: int):  # type: ignore[no-untyped-def]
    """Depth and identity at every pixel's centre by casting rays on the bodies' faces, one by one."""
    camera = renderer.scene.camera
    v, u = np.mgrid[0:height, 0:width] + 0.5
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=2)
    rays = rays @ camera.rotation
    depth = np.full((height, width), np.inf)
    who = np.zeros((height, width), dtype=np.int64)
    for number, (kind, x, y, speed, length, wide, high) in enumerate(rows, 1):
        way = 1.0 if speed >= 0 else -1.0
        for body in shape_of(str(KIND_NAMES[kind]), 0)[:3]:
            corners = np.array(
                [
                    (
                        x + way * wide * body[4 + (k & 1)] * (1 if k & 2 else -1),
                        y + way * length * body[2 * (k & 1) + (k >> 2)],
                        high * body[6 + (k & 1)],
                    )
                    for k in range(8)
                ]
            )
            middle = corners.mean(axis=0)
            # A convex body is the meeting of its faces' half spaces: clip the ray by one after the other.
            low, last = np.zeros((height, width)), np.full((height, width), np.inf)
            for face in FACE_CORNERS:
                a, b, c = corners[face[0]], corners[face[1]], corners[face[2]]
                normal = np.cross(b - a, c - a)
                normal *= np.sign(normal @ (a - middle))
                start, rate = normal @ (camera.position - a), rays @ normal
                with np.errstate(divide="ignore", invalid="ignore"):
                    t = -start / rate
                low = np.where(rate < 0, np.maximum(low, t), low)
                last = np.where(rate > 0, np.minimum(last, t), last)
            hit = (low < last) & (low < depth)
            depth[hit], who[hit] = low[hit], number
    return depth, who


def test_depth_and_identity_are_those_of_rays_cast_by_brute_force() -> None:
    renderer = renderer_of(TRAFFIC)
    moments = renderer.moments(np.array([0.0]), renderer.plan(0.0, 0.0).look)
    nothing = np.full((112, 192), np.inf)
    depth, instance, _ = buffers(moments, renderer.plan(0.0, 0.0).look, nothing, np.zeros((112, 192)))
    expected_depth, expected = cast(TRAFFIC, renderer, 192, 112)
    same = instance == expected
    # Rays along an outline may fall to either side by rounding.
    assert (~same).sum() <= 2
    seen = same & (expected > 0)
    assert set(np.unique(expected)) == {0, 1, 2, 3, 4, 5}
    np.testing.assert_allclose(depth[seen], expected_depth[seen], rtol=1e-6)


def test_visible_part_is_the_share_of_the_pixels_that_are_left() -> None:
    renderer = renderer_of(TRAFFIC)
    look = renderer.plan(0.0, 0.0).look
    moments = renderer.moments(np.array([0.0]), look)
    _, _, visible = buffers(moments, look, np.full((112, 192), np.inf), np.zeros((112, 192)))
    _, together = cast(TRAFFIC, renderer, 192, 112)
    for k in range(len(TRAFFIC)):
        _, alone = cast(TRAFFIC[k : k + 1], renderer, 192, 112)
        share = (together == k + 1).sum() / (alone == 1).sum()
        assert abs(visible[k] - share) < 0.02
    assert 0.0 < visible.min() < 0.5 < visible.max()


def test_what_lies_outside_the_picture_counts_as_not_visible() -> None:
    leaving = [(0, 4.0, 12.0, 20.0, 4.4, 1.8, 1.46)]
    renderer = renderer_of(leaving)
    look = renderer.plan(0.0, 0.0).look
    moments = renderer.moments(np.array([0.0]), look)
    _, instance, visible = buffers(moments, look, np.full((112, 192), np.inf), np.zeros((112, 192)))
    # With rows added below, the whole vehicle is in the picture.
    tall = renderer_of(leaving, height=336)
    whole = tall.moments(np.array([0.0]), look)
    _, all_of_it, free = buffers(whole, look, np.full((336, 192), np.inf), np.zeros((336, 192)))
    assert free[0] == 1.0
    assert abs(visible[0] - (instance > 0).sum() / (all_of_it > 0).sum()) < 0.01
    assert 0.05 < visible[0] < 0.95


def test_a_barrier_covers_what_is_behind_it() -> None:
    renderer = renderer_of([CAR])
    look = renderer.plan(0.0, 0.0).look
    moments = renderer.moments(np.array([0.0]), look)
    near, cover = np.full((112, 192), 5.0), np.zeros((112, 192))
    _, free, all_of_it = buffers(moments, look, near, cover)
    rows = np.flatnonzero((free > 0).any(axis=1))
    cover[rows[len(rows) // 2] :] = 1.0
    _, instance, visible = buffers(moments, look, near, cover)
    assert all_of_it[0] == 1.0
    assert visible[0] == (instance > 0).sum() / (free > 0).sum()
    assert 0.0 < visible[0] < 1.0
