"""Shapes that are no vehicles: they lie beside the vehicles, and come as often as they are asked for."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph_sehn.training.batches import Batches  # noqa: E402
from jeat_graph_sehn.training.clutter import draw_clutter  # noqa: E402
from jeat_graph_sehn.training.data_sets import read_pictures  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings, PictureChanges, TrainSettings  # noqa: E402

SIZE = (160, 96)
VEHICLES = np.array([[20.0, 10.0, 60.5, 40.2], [90.0, 50.0, 99.0, 58.0], [130.0, 70.0, 170.0, 110.0]])


def dark():
    return np.full((SIZE[1], SIZE[0], 3), 40, dtype=np.uint8)


@pytest.mark.parametrize("seed", range(12))
def test_vehicles_stay_as_they_are_and_something_else_does_not(seed):
    frame = dark()
    shown = draw_clutter(frame, VEHICLES, np.random.default_rng(seed))
    assert (frame == 40).all()  # what was given is not drawn into
    assert shown.shape == frame.shape
    assert shown.dtype == np.uint8
    changed = (shown != 40).any(axis=2)
    assert changed.any()
    for left, top, right, bottom in np.clip(VEHICLES, 0, [*SIZE, *SIZE]).tolist():
        inside = (
            slice(int(np.floor(top)), int(np.ceil(bottom))),
            slice(int(np.floor(left)), int(np.ceil(right))),
        )
        assert not changed[inside].any()


def test_a_picture_without_vehicles_is_drawn_into_anywhere():
    none = np.zeros((0, 4))
    changed = np.zeros((SIZE[1], SIZE[0]), dtype=bool)
    for seed in range(60):
        changed |= (draw_clutter(dark(), none, np.random.default_rng(seed)) != 40).any(axis=2)
        if changed.all():
            break
    assert changed.all()


def test_one_seed_draws_the_same_whatever_vehicles_there_are():
    """Far from the vehicle that takes its place from some shapes, the others are what they were."""
    everywhere, beside = (
        draw_clutter(dark(), boxes, np.random.default_rng(5))
        for boxes in (np.zeros((0, 4)), np.array([[0.0, 0.0, 4.0, 4.0]]))
    )
    equal = (everywhere == beside).all(axis=2)
    assert equal.mean() > 0.5
    assert not (beside == 40).all()


def test_shapes_come_in_as_many_cut_outs_as_are_asked_for(small_set):
    """Without noise and grain only the shapes are left to differ; the boxes stay."""
    members = read_pictures(small_set)

    def shown(share):
        changes = PictureChanges(clutter_share=share, noise=0.0, grey_share=0.0)
        settings = TrainSettings(crop_px=(32, 32), pictures=changes, batch=6)
        batches = Batches(members, NetSettings(width=4), settings)
        found = [batches.get(step) for step in range(10)]
        batches.close()
        return torch.cat([one.steps[0] for one in found]), [t for one in found for t in one.targets[0]]

    (plain, targets), *others = shown(0.0), shown(0.5), shown(1.0)
    for _, found in others:
        for one, two in zip(targets, found, strict=True):
            assert torch.equal(one.boxes, two.boxes)
    same = [sum(torch.equal(a, b) for a, b in zip(plain, other, strict=True)) for other, _ in others]
    # Of 60 cut-outs of 32 x 32 px few have no room beside the vehicles; binomial, five deviations are ± 20.
    assert same[0] - same[1] >= 10
    assert 60 - same[0] >= 10
