"""What the network learns from: which cell stands for which vehicle, and what its mistakes cost.

A cell may stand for a vehicle if its middle lies in the box, or nearer to the box's middle than one stride.
Of those, the ones that already say it best (score^α IoU^β) are asked to say it, and the others not to. What
they are asked to score is how well they fit.

Sources: Feng et al., "TOOD: Task-aligned One-stage Object Detection" (2021); Rezatofighi et al., "Generalized
Intersection over Union" (2019).
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from jeat_graph_sehn.training.network import ROW, centred_boxes, corners_of, mean_errors

#: α and β of the alignment, and how many cells stand for one vehicle.
SCORE_POWER, IOU_POWER, CELLS = 0.5, 6.0, 10
_TINY = 1e-9


class Target(NamedTuple):
    """What one picture holds, in px of the network's input.

    Attributes:
        boxes: (G, 4) left, top, right, bottom of the vehicles asked for.
        ignored: (I, 4) of what is neither asked for nor wrong.
    """

    boxes: Tensor
    ignored: Tensor


class Assigned(NamedTuple):
    """Which vehicle each cell stands for.

    Attributes:
        vehicle: (N,) its row; -1 for none.
        score: (N,) what the cell is asked to score.
    """

    vehicle: Tensor
    score: Tensor


class Cost(NamedTuple):
    """What mistakes cost: all, and its parts; that of spreads is 0 where there are none."""

    total: Tensor
    scores: Tensor
    boxes: Tensor
    spreads: Tensor


def paired_overlaps(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    """Return IoU and GIoU of boxes (…, 4) with boxes (…, 4), by their corners; shapes are broadcast.

    GIoU = IoU - (E - U) / E, where U is the area of both and E that of the smallest box about them.
    """
    width_a, width_b = a[..., 2:] - a[..., :2], b[..., 2:] - b[..., :2]
    inner = (torch.minimum(a[..., 2:], b[..., 2:]) - torch.maximum(a[..., :2], b[..., :2])).clamp(min=0.0)
    outer = torch.maximum(a[..., 2:], b[..., 2:]) - torch.minimum(a[..., :2], b[..., :2])
    both = inner.prod(dim=-1)
    union = width_a.prod(dim=-1) + width_b.prod(dim=-1) - both
    hull = outer.prod(dim=-1)
    iou = both / union.clamp(min=_TINY)
    return iou, iou - (hull - union) / hull.clamp(min=_TINY)


@torch.no_grad()
def assign(corners: Tensor, scores: Tensor, places: Tensor, strides: Tensor, boxes: Tensor) -> Assigned:
    """Choose the cells that stand for each vehicle of one picture.

    Args:
        corners: (N, 4) what the cells say.
        scores: (N,) how sure they are, 0 to 1.
        places: (N, 2) column and row of each cell.
        strides: (N,) px.
        boxes: (G, 4) vehicles.
    """
    count = len(corners)
    vehicle = torch.full((count,), -1, dtype=torch.long, device=corners.device)
    wanted = torch.zeros(count, device=corners.device)
    if not len(boxes):
        return Assigned(vehicle, wanted)
    iou, _ = paired_overlaps(boxes[:, None], corners[None])
    away = ((places + 0.5) * strides[:, None])[None] - ((boxes[:, :2] + boxes[:, 2:]) / 2.0)[:, None]
    reach = torch.maximum((boxes[:, 2:] - boxes[:, :2])[:, None] / 2.0, strides[None, :, None])
    near = (away.abs() < reach).all(dim=-1)
    fit = scores[None].pow(SCORE_POWER) * iou.pow(IOU_POWER) * near
    best = fit.topk(min(CELLS, count), dim=1)
    chosen = torch.zeros_like(near)
    chosen.scatter_(1, best.indices, best.values > 0.0)
    # A cell that two vehicles want goes to the one it overlaps more.
    owner = torch.where(chosen, iou, iou.new_tensor(-1.0)).argmax(dim=0)
    taken = chosen.any(dim=0)
    chosen &= torch.arange(len(boxes), device=corners.device)[:, None] == owner[None]
    fit, iou = fit * chosen, iou * chosen
    # The best cell of a vehicle is asked for its own IoU, the others for less.
    scale = iou.amax(dim=1, keepdim=True) / fit.amax(dim=1, keepdim=True).clamp(min=_TINY**4)
    vehicle[taken] = owner[taken]
    return Assigned(vehicle, (fit * scale).amax(dim=0))


def cost_of(rows: Tensor, targets: list[Target], places: Tensor, strides: Tensor, box_weight: float) -> Cost:
    """Say what a batch's mistakes cost.

    Args:
        rows: (B, N, 5 and more) of the network.
        targets: of each picture.
        places: (N, 2) column and row of each cell.
        strides: (N,) px.
        box_weight: of the boxes beside that of the scores.
    """
    corners = corners_of(centred_boxes(rows, places, strides))
    logits = rows[..., 4]
    errors = mean_errors(rows, strides) if rows.shape[-1] > ROW else None
    asked, weight, box_cost, box_score, spread_cost = [], [], [], [], [strides.new_zeros(0)]
    for k, target in enumerate(targets):
        given = assign(corners[k].detach(), logits[k].detach().sigmoid(), places, strides, target.boxes)
        mine = torch.nonzero(given.vehicle >= 0).squeeze(1)
        asked.append(given.score)
        weight.append(_counts(given.vehicle >= 0, places, strides, target.ignored))
        wanted_boxes = target.boxes[given.vehicle[mine]]
        _, giou = paired_overlaps(corners[k][mine], wanted_boxes)
        box_cost.append(1.0 - giou)
        box_score.append(given.score[mine])
        if errors is not None:
            spread_cost.append(_surprise(corners[k][mine].detach() - wanted_boxes, errors[k][mine]))
    wanted = torch.stack(asked)
    share = wanted.sum().clamp(min=1.0)
    entropy = torch.nn.functional.binary_cross_entropy_with_logits(
        logits, wanted, torch.stack(weight), reduction="sum"
    )
    of_scores = entropy / share
    trusted = torch.cat(box_score)
    of_boxes = (torch.cat(box_cost) * trusted).sum() / share
    of_spreads = share.new_zeros(()) if errors is None else (torch.cat(spread_cost) * trusted).sum() / share
    return Cost(of_scores + box_weight * of_boxes + of_spreads, of_scores, of_boxes, of_spreads)


def _surprise(error: Tensor, mean_error: Tensor) -> Tensor:
    """Return the negative logarithmic likelihood (M,) of errors of sides (M, 4), but for a constant.

    Their distribution is Laplace's: few boxes are hidden, or of another vehicle, and far off; a Gaussian
    would be as wide as those.
    """
    return (error.abs() / mean_error + torch.log(mean_error)).mean(dim=1)


def _counts(taken: Tensor, places: Tensor, strides: Tensor, ignored: Tensor) -> Tensor:
    """Weight (N,) of each cell's score: 0 in what is ignored, unless it stands for a vehicle."""
    if not len(ignored):
        return torch.ones_like(strides)
    middle = (places + 0.5) * strides[:, None]
    inside = ((middle[None] >= ignored[:, None, :2]) & (middle[None] <= ignored[:, None, 2:])).all(dim=-1)
    return (taken | ~inside.any(dim=0)).to(strides.dtype)
