"""Small networks to be taught."""

from __future__ import annotations

from dataclasses import asdict

from .drawn_road import SIZE

#: Settings of a training that takes a second.
FAST = {
    "crop_px": list(SIZE),
    "batch": 2,
    "steps": 3,
    "back": 3,
    "most_step_bins": 4,
    "events": {"mirror_share": 0.0, "zoom": 1.0, "drop_share": 0.0, "time_scale": 1.0, "noise_hz_px": 0.0},
}


def write_network(path, width, more=None, kind="events"):
    """Write a network that has learned nothing yet; returns its file."""
    import torch

    from jeat_graph_sehn.training.export import write_onnx
    from jeat_graph_sehn.training.making import new_network
    from jeat_graph_sehn.training.settings import NetSettings

    torch.manual_seed(0)
    settings = NetSettings(kind=kind, width=width)
    write_onnx(new_network(settings).eval(), SIZE, {"net": asdict(settings), **(more or {})}, path)
    return path
