"""`jeat-graph benchmark worlds`: does a net that was trained in simulated worlds know its way in others?

Small nets learn from varied worlds, and others from as many pictures of the one fixed world. Each is then
judged in the worlds that it learned from, with other traffic, and in worlds that none of them has seen.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.benchmark import common
from jeat_graph.benchmark.provenance import provenance
from jeat_graph.config.argument_types import counting, drawn_size, positive
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.extras import install
from jeat_graph.data.processes import available_cores
from jeat_graph.simulation.dataset.protocol import Protocol
from jeat_graph.simulation.dataset.recording import record_dataset
from jeat_graph.simulation.imaging.config import load_imaging
from jeat_graph.simulation.imaging.source import RenderedSource
from jeat_graph.simulation.scenario import load_scenario

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_LIGHTS = ("day", "night", "night-nolight")
_KINDS = ("frames", "events")
_WORLDS = ("varied", "fixed")
_UNSEEN_SEED = 1001  # of the worlds that nothing learns from
_TEST_FRAMES = 6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(
        parser, "worlds", {"seeds": "of worlds and nets (1)", "scenarios": f"({' '.join(_LIGHTS)})"}
    )
    parser.set_defaults(seeds=[1], scenarios=_LIGHTS)
    add = parser.add_argument
    add("--kinds", nargs="+", choices=_KINDS, default=_KINDS, help="of nets (frames events)")
    add("--segments", type=counting, default=12, metavar="N", help="to learn from, of each light (12)")
    add("--frames", type=counting, default=16, metavar="N", help="of each of them (16)")
    add("--tests", type=counting, default=6, metavar="N", help="segments to judge by, of each light (6)")
    add("--size", type=drawn_size, default=(384, 240), metavar="WxH", help="picture (384x240)")
    add("--epochs", type=positive, default=12.0, metavar="N", help="how often all is seen (12)")
    add("--work", metavar="DIR", help="keep the simulated sets there, and take those that are there already")
    add("--quick", action="store_true", help="two small segments by day, one epoch: to see that it runs")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    if args.quick:
        args.scenarios, args.segments, args.frames, args.tests = _LIGHTS[:1], 2, 12, 1
        args.size, args.epochs = (128, 80), 1.0
    return common.measure_or_read(args, "worlds", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Simulate, train and judge.

    Raises:
        ConfigError: PyTorch is not installed, or a size that the nets do not take.
    """
    try:
        import torch  # noqa: F401
    except ImportError:
        raise ConfigError(f"training needs PyTorch: {install('train')}") from None
    if any(side % 16 for side in args.size):
        raise ConfigError(f"--size: {args.size[0]}x{args.size[1]} must be whole multiples of 16 px")
    rows: list[dict[str, Any]] = []
    with ExitStack() as stack:
        work = Path(
            args.work or stack.enter_context(tempfile.TemporaryDirectory(prefix="jeat-graph-worlds-"))
        )
        begun = time.process_time(), time.perf_counter()
        sets = {seed: _simulate(args, seed, work) for seed in args.seeds}
        simulated = time.perf_counter() - begun[1]
        for seed in args.seeds:
            for kind in args.kinds:
                rows += [_trained(args, kind, world, seed, sets[seed], work) for world in _WORLDS]
    settings = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in vars(args).items()
        if name in ("seeds", "scenarios", "kinds", "segments", "frames", "tests", "size", "epochs")
    }
    return {
        "benchmark": "worlds",
        **provenance(settings, {}),
        "simulated_minutes": simulated / 60.0,
        "rows": rows,
    }


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """The table of a result, by the name of its markers."""
    from jeat_graph.eval.tables import Table

    records: list[dict[str, Cell]] = []
    for key in dict.fromkeys((row["kind"], row["world"]) for row in result["rows"]):
        mine = [row for row in result["rows"] if (row["kind"], row["world"]) == key]
        seen, unseen, minutes = (
            sum(row[name] for row in mine) / len(mine) for name in ("seen", "unseen", "minutes")
        )
        records.append(
            {
                "net of": "pictures" if key[0] == "frames" else "events",
                "trained on": "varied worlds" if key[1] == "varied" else "the fixed world",
                "AP50 there, other traffic": seen,
                "AP50 in unseen worlds": unseen,
                "difference": unseen - seen,
                "CPU minutes": minutes,
            }
        )
    number = ("AP50 there, other traffic", "AP50 in unseen worlds", "difference", "CPU minutes")
    title = f"AP50 (%), mean of {', '.join(result['settings']['scenarios'])}"
    return {"worlds": Table.from_records(records, title=title, digits=dict.fromkeys(number, 1))}


def _simulate(args: argparse.Namespace, seed: int, work: Path) -> dict[str, list[Path]]:
    """Make the sets of a seed: to learn from by world, the same with other traffic, and unseen worlds."""
    wanted = {
        "varied": ("varied", seed, args.segments, args.frames, 0),
        "fixed": ("fixed", seed, args.segments, args.frames, 0),
        "seen-varied": ("varied", seed, args.tests, _TEST_FRAMES, 1),
        "seen-fixed": ("fixed", seed, args.tests, _TEST_FRAMES, 1),
        "unseen": ("varied", _UNSEEN_SEED + seed, args.tests, _TEST_FRAMES, 0),
    }
    imaging = load_imaging({"render": {"width": args.size[0], "height": args.size[1]}})
    found: dict[str, list[Path]] = {}
    for name, (world, own, segments, frames, traffic) in wanted.items():
        for light in args.scenarios:
            folder = work / f"{name}-{light}-{seed}"
            source = partial(
                RenderedSource, load_scenario(light), imaging, own, frames, world, "pictures", traffic
            )
            jobs = min(args.jobs or available_cores(), segments)
            record_dataset(source, folder, Protocol(segments, own, video="png"), workers=jobs)
            found.setdefault(name, []).append(folder)
    return found


def _trained(
    args: argparse.Namespace, kind: str, world: str, seed: int, sets: Mapping[str, list[Path]], work: Path
) -> dict[str, Any]:
    """Train one net, and judge it in seen and in unseen worlds."""
    from jeat_graph.training.data_sets import Split, read_event_segments, read_pictures
    from jeat_graph.training.judging import judge
    from jeat_graph.training.settings import WIDTHS, NetSettings, TrainSettings
    from jeat_graph.training.trainer import Trainer, TrainingJob

    read: Any = read_pictures if kind == "frames" else read_event_segments
    learned = [member for path in sets[world] for member in read(path)]
    net = NetSettings(kind=kind, width=WIDTHS["small"])
    settings = TrainSettings(
        epochs=args.epochs, seed=seed, crop_px=args.size, judge_every=1.0, judged=1, average_steps=200.0
    )
    begun = time.process_time()
    with tempfile.TemporaryDirectory(dir=work) as folder:
        job = TrainingJob(
            *(net, settings, Split(learned, learned[:1], "all are learned from"), args.size, "cpu"),
            *(Path(folder) / "net.checkpoint", f"{kind} {world}"),
        )
        trainer = Trainer(job)
        trainer.run(lambda *_: None)
    precision = {}
    for name in (f"seen-{world}", "unseen"):
        members = [member for path in sets[name] for member in read(path)]
        found = judge(trainer.average, members, args.size, settings, 1_000_000)
        precision[name.split("-")[0]] = sum(found[path.name].ap50 for path in sets[name]) / len(sets[name])
    minutes = (time.process_time() - begun) / 60.0
    return {
        "kind": kind,
        "world": world,
        "seed": seed,
        "steps": trainer.step,
        "minutes": minutes,
        **precision,
    }
