"""Overlap, assignment and cost against plain loops and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph_sehn.training.learning import (  # noqa: E402
    CELLS,
    IOU_POWER,
    SCORE_POWER,
    Target,
    assign,
    cost_of,
    paired_overlaps,
)
from jeat_graph_sehn.training.network import (  # noqa: E402
    DetectionNet,
    cell_places,
    centred_boxes,
    corners_of,
)
from jeat_graph_sehn.training.settings import NetSettings  # noqa: E402

SIDE = (32, 16)


def raster_overlaps(a, b):
    """IoU and GIoU of two boxes with whole corners, by counting pixels."""
    hull = (min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3]))
    both = either = 0
    for y in range(hull[1], hull[3]):
        for x in range(hull[0], hull[2]):
            inside = [box[0] <= x < box[2] and box[1] <= y < box[3] for box in (a, b)]
            both += all(inside)
            either += any(inside)
    area = (hull[2] - hull[0]) * (hull[3] - hull[1])
    return both / either, both / either - (area - either) / area


WHOLE_BOX = st.tuples(st.integers(0, 8), st.integers(0, 8), st.integers(1, 6), st.integers(1, 6)).map(
    lambda b: (b[0], b[1], b[0] + b[2], b[1] + b[3])
)


@given(WHOLE_BOX, WHOLE_BOX)
def test_overlaps_are_those_counted_pixel_by_pixel(a, b):
    found = paired_overlaps(torch.tensor(a).double(), torch.tensor(b).double())
    np.testing.assert_allclose([float(value) for value in found], raster_overlaps(a, b), atol=1e-12)


def test_the_gradient_of_giou_leads_boxes_apart_together():
    box = torch.tensor([0.0, 0.0, 2.0, 2.0], requires_grad=True)
    _, giou = paired_overlaps(box, torch.tensor([10.0, 0.0, 12.0, 2.0]))
    giou.backward()
    assert giou.item() == pytest.approx(-8.0 / 12.0)
    assert box.grad[2] > 0.0


def plain_assignment(corners, scores, places, strides, boxes):
    """The same by loops over vehicles and cells."""
    count = len(corners)
    iou = np.array([[raster_free_iou(box, cell) for cell in corners] for box in boxes]).reshape(-1, count)
    wants = [set() for _ in boxes]
    fit = np.zeros_like(iou)
    for g, box in enumerate(boxes):
        for n in range(count):
            middle = (places[n] + 0.5) * strides[n]
            reach = [max((box[2 + a] - box[a]) / 2.0, strides[n]) for a in range(2)]
            if all(abs(middle[a] - (box[a] + box[2 + a]) / 2.0) < reach[a] for a in range(2)):
                fit[g, n] = scores[n] ** SCORE_POWER * iou[g, n] ** IOU_POWER
        best = sorted(range(count), key=lambda n: -fit[g, n])[:CELLS]
        wants[g] = {n for n in best if fit[g, n] > 0.0}
    vehicle = np.full(count, -1)
    for n in range(count):
        claims = [g for g in range(len(boxes)) if n in wants[g]]
        if claims:
            vehicle[n] = max(claims, key=lambda g: iou[g, n])
    score = np.zeros(count)
    for g in range(len(boxes)):
        own = np.flatnonzero(vehicle == g)
        for n in own:
            score[n] = fit[g, n] / fit[g, own].max() * iou[g, own].max()
    return vehicle, score


def raster_free_iou(a, b):
    sides = [max(min(a[2 + k], b[2 + k]) - max(a[k], b[k]), 0.0) for k in range(2)]
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return sides[0] * sides[1] / (sum(areas) - sides[0] * sides[1])


@pytest.mark.parametrize("seed", range(6))
def test_cells_are_assigned_as_by_loops(seed):
    rng = np.random.default_rng(seed)
    places, strides = cell_places(SIDE)
    rows = torch.from_numpy(rng.normal(0.0, 0.7, (1, len(strides), 5)))
    corners = corners_of(centred_boxes(rows, places.double(), strides.double()))[0]
    scores = rows[0, :, 4].sigmoid()
    start = rng.uniform(0.0, 12.0, (3, 2))
    boxes = torch.from_numpy(np.hstack([start, start + rng.uniform(3.0, 15.0, (3, 2))]))
    found = assign(corners, scores, places.double(), strides.double(), boxes)
    vehicle, score = plain_assignment(
        corners.numpy(), scores.numpy(), places.numpy(), strides.numpy(), boxes.numpy()
    )
    assert (vehicle >= 0).sum() > 5
    np.testing.assert_array_equal(found.vehicle.numpy(), vehicle)
    np.testing.assert_allclose(found.score.numpy(), score, rtol=1e-5)


def test_a_picture_without_vehicles_asks_for_nothing():
    places, strides = cell_places(SIDE)
    rows = torch.zeros(1, len(strides), 5)
    cost = cost_of(rows, [Target(torch.zeros(0, 4), torch.zeros(0, 4))], places, strides, 2.5)
    assert cost.boxes.item() == 0.0
    assert cost.total.item() == pytest.approx(len(strides) * math.log(2.0), rel=1e-5)


def test_cells_in_what_is_ignored_cost_nothing():
    places, strides = cell_places(SIDE)
    rows = torch.zeros(1, len(strides), 5)
    half = torch.tensor([[0.0, 0.0, SIDE[0] / 2.0, float(SIDE[1])]])
    cost = cost_of(rows, [Target(torch.zeros(0, 4), half)], places, strides, 2.5)
    assert cost.total.item() == pytest.approx(len(strides) / 2.0 * math.log(2.0), rel=1e-5)


@pytest.mark.parametrize("numbers", [5, 9])
def test_the_cost_of_one_vehicle_is_that_of_its_formula(numbers):
    places, strides = cell_places(SIDE)
    rows = torch.randn(
        1, len(strides), numbers, generator=torch.Generator().manual_seed(1), dtype=torch.float64
    )
    places, strides = places.double(), strides.double()
    box = torch.tensor([[9.0, 3.0, 21.0, 12.0]], dtype=torch.float64)
    cost = cost_of(rows, [Target(box, torch.zeros(0, 4))], places, strides, 4.0)
    corners = corners_of(centred_boxes(rows, places, strides))[0]
    given = assign(corners, rows[0, :, 4].sigmoid(), places, strides, box)
    share = max(float(given.score.sum()), 1.0)
    entropy = boxes = spreads = 0.0
    for n in range(len(strides)):
        p, y = 1.0 / (1.0 + math.exp(-float(rows[0, n, 4]))), float(given.score[n])
        entropy -= y * math.log(p) + (1.0 - y) * math.log(1.0 - p)
        if given.vehicle[n] >= 0:
            boxes += y * (1.0 - float(paired_overlaps(corners[n], box[0])[1]))
            for side, log_cells in enumerate(rows[0, n, 5:].tolist()):
                mean = math.exp(log_cells) * float(strides[n])
                off = abs(float(corners[n, side] - box[0, side]))
                spreads -= y * math.log(math.exp(-off / mean) / mean) / 4.0
    assert cost.scores.item() == pytest.approx(entropy / share, rel=1e-6)
    assert cost.spreads.item() == pytest.approx(spreads / share, rel=1e-6)
    assert cost.total.item() == pytest.approx((entropy + 4.0 * boxes + spreads) / share, rel=1e-6)


def test_how_far_off_sides_are_changes_neither_boxes_nor_what_they_are_found_by():
    torch.manual_seed(3)
    net = DetectionNet(NetSettings(kind="frames", width=2)).train()
    rows, _ = net(torch.rand(2, 3, *SIDE[::-1]))
    rows[..., 5:].sum().backward()
    touched = {name for name, value in net.named_parameters() if value.grad is not None and value.grad.any()}
    assert touched == {"head.spread.weight", "head.spread.bias"}


def test_boxes_that_fit_and_are_sure_cost_least():
    """A perfect answer costs next to nothing; the same box without its score costs much."""
    places, strides = cell_places(SIDE)
    box = torch.tensor([[8.0, 4.0, 16.0, 12.0]])
    rows = torch.zeros(1, len(strides), 5)
    rows[..., 4] = -20.0
    near = [
        n for n in range(len(strides)) if strides[n] == 4 and 1 < places[n, 0] < 4 and 0 < places[n, 1] < 3
    ]
    for n in near:
        rows[0, n, :2] = torch.tensor([12.0, 8.0]) / 4.0 - places[n] - 0.5
        rows[0, n, 2:4] = math.log(2.0)
        rows[0, n, 4] = 12.0
    target = [Target(box, torch.zeros(0, 4))]
    right = cost_of(rows, target, places, strides, 2.5)
    rows[..., 4] = -20.0
    assert right.total.item() < 1e-3
    assert cost_of(rows, target, places, strides, 2.5).scores.item() > 5.0
