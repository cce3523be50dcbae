"""Rehearsal against forgetting: a few newly rendered scenes of the kind that a network was trained on."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from jeat_graph.data.processes import available_cores
from jeat_graph_sehn.simulation.compiling import prepare_renderer
from jeat_graph_sehn.simulation.dataset.protocol import Protocol
from jeat_graph_sehn.simulation.dataset.recording import record_dataset
from jeat_graph_sehn.simulation.imaging.config import load_imaging
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario, scenario_to_yaml

#: Lights of the worlds, and segments of each, a quarter of which is held back.
SCENARIOS, SEGMENTS = ("day", "night", "night-nolight"), 4
#: The division has a seed of its own, by which one of four segments is held back, the second one.
_SHARES, _SPLIT_SEED = (0.75, 0.25, 0.0), 0
#: Pictures of a segment (1 s), and their size (px).
_FRAMES, _SIZE = 20, (640, 384)
#: Seeds from here on belong to these worlds: those of training and of tests are small numbers.
_FIRST_SEED = 90_000


def render_old_worlds(
    folder: Path, events: bool, seed: int, on_frames: Callable[[int], object] = lambda n: None
) -> list[Path]:
    """Render small data sets of varied worlds, or what is missing of them; returns their folders.

    Args:
        folder: where they are made, one folder a light.
        events: whether events are rendered, else pictures.
        seed: not negative.
        on_frames: called with the number of pictures that are done since the last call.
    """
    width, height = _SIZE
    imaging = load_imaging({"render": {"width": width, "height": height}})
    workers = min(available_cores(), SEGMENTS)
    prepare_renderer(workers)
    made = []
    for name in SCENARIOS:
        scenario, own_seed = load_scenario(name, None), _FIRST_SEED + seed
        sensors = "events" if events else "rgb"
        factory = partial(RenderedSource, scenario, imaging, own_seed, _FRAMES, "varied", sensors)
        protocol = Protocol(SEGMENTS, _SPLIT_SEED, _SHARES, video="png")
        record_dataset(
            factory,
            folder / name,
            protocol,
            scenario_yaml=scenario_to_yaml(scenario),
            workers=workers,
            on_frames=on_frames,
        )
        made.append(folder / name)
    return made


def old_frames() -> int:
    """Return how many pictures `render_old_worlds` makes."""
    return len(SCENARIOS) * SEGMENTS * _FRAMES
