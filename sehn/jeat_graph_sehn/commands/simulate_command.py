"""`jeat-graph simulate`: detections, or pictures and events, of a highway, with truth; and their check."""

from __future__ import annotations

import argparse
import sys
from argparse import ArgumentTypeError
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.config.argument_types import counting, drawn_size, positive, share
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.progress import refreshing

if TYPE_CHECKING:
    from jeat_graph_sehn.simulation.dataset.protocol import Protocol
    from jeat_graph_sehn.simulation.dataset.workers import SourceFactory
    from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
    from jeat_graph_sehn.simulation.scenario import Scenario
    from jeat_graph_sehn.simulation.world.rig import RigConfig

HELP = "simulate a highway seen by an RGB and an event camera: detections or pictures, and truth"
_DENSITIES = ("sparse", "normal", "dense")
_DURATION_S = 30.0
_SEGMENTS = 1
_FRAMES = 100
_SIZE = (640, 384)
# Arguments that only mean something with pictures, by the name of the attribute.
_PICTURE_ONLY = (
    *("segments", "frames", "size", "workers", "video", "compression", "split", "imaging"),
    *("world", "event_camera", "masks"),
)
_CARLA_ONLY = ("carla_host", "carla_port")
_CORRIDOR_ONLY = ("cameras", "flow", "ramps", "queue")
_CORRIDOR_DURATION_S = 900.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        "scenario",
        metavar="SCENARIO",
        nargs="?",
        help="a name (day, night, night-nolight, …) or a YAML file",
    )
    parser.add_argument("--out", metavar="DIR", help="folder to write into")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed (default 0)")
    parser.add_argument("--density", choices=_DENSITIES, help="traffic density (default: the scenario's)")
    parser.add_argument(
        "--sensors",
        choices=("detections", "pictures", "rgb", "events", "carla"),
        default="detections",
        help="detections (default); pictures: RGB frames and events of the built-in renderer; rgb, events: "
        "one of them without the other's cost; carla: those of a running CARLA server (experimental)",
    )
    parser.add_argument(
        "--verify",
        metavar="DIR",
        help="only check a simulated folder: missing, changed and extra files, and whether all fit together; "
        "exit code 1 if not",
    )
    only = parser.add_argument_group("with --sensors detections")
    only.add_argument("--duration", type=float, metavar="S", help=f"length (default {_DURATION_S:g})")
    parser.add_argument(
        "--rig",
        metavar="drawn|FILE",
        help="the event camera gets a place, lens, picture and clock of its own: drawn from the seed, or as "
        "a YAML file says, such as {right_m: 0.3, width: 640, height: 480, focal_px: 550, offset_s: 2.5}; "
        "the true rig.yaml is written beside (with --sensors pictures two sets and rigs/000000.yaml, …)",
    )
    pictures = parser.add_argument_group(
        "with --sensors pictures or carla",
        "Repeat the command to continue an interrupted run; the result has the same bytes.",
    )
    pictures.add_argument(
        "--segments",
        type=counting,
        metavar="N",
        help=f"number of segments (default {_SEGMENTS}; the full set: 500)",
    )
    pictures.add_argument(
        "--frames-per-segment",
        "--frames",
        dest="frames",
        type=counting,
        metavar="N",
        help=f"RGB frames per segment (default {_FRAMES}; for training 20, and more segments)",
    )
    pictures.add_argument(
        "--world",
        choices=("fixed", "varied", "near"),
        help="fixed (default): the scenario's road and camera in all segments; varied: for each segment a "
        "camera, road, surroundings, vehicles, light and traffic of its own; near: likewise, the camera low "
        "beside the road and turned to it, so that vehicles pass close, from the side",
    )
    pictures.add_argument(
        "--event-camera",
        choices=("v2e", "davis346", "imx636", "iebcs", "ideal"),
        help="thresholds and noise of this event camera (default v2e)",
    )
    pictures.add_argument(
        "--masks",
        action="store_true",
        default=None,
        help="also write a mask per frame: which vehicle each pixel shows",
    )
    pictures.add_argument("--size", type=_size, metavar="WxH", help="of the pictures (default 640x384)")
    pictures.add_argument("--workers", type=counting, metavar="K", help="processes (default: one per core)")
    pictures.add_argument(
        "--video",
        choices=("mp4", "webm", "lossless", "png"),
        help="how frames are stored: mp4 (default; quick, lossy, not for browsers), webm (browsers play it; "
        "ten times slower to write), lossless, png (default with --world varied)",
    )
    pictures.add_argument(
        "--compression",
        choices=("gzip", "none", "blosc"),
        help="of events (default gzip; blosc needs the extra `hdf5`)",
    )
    pictures.add_argument(
        "--split", type=_shares, metavar="A:B:C", help="shares of train, val, test (default 70:15:15)"
    )
    pictures.add_argument(
        "--imaging",
        metavar="FILE",
        help="YAML with settings of renderer and cameras (sections render, rgb, evt)",
    )
    corridor = parser.add_argument_group("with SCENARIO corridor", "what `road` would write of each camera")
    corridor.add_argument(
        "--cameras", type=_places, metavar="M,M,…", help="places of the cameras along the road (m; 0,500)"
    )
    corridor.add_argument("--flow", type=positive, metavar="N", help="vehicles an hour (2400)")
    corridor.add_argument(
        "--ramps", type=share, metavar="SHARE", help="that leaves and joins in each gap (0.04)"
    )
    corridor.add_argument(
        "--queue", type=_span, metavar="S,S", help="from when until when the first gap is slow (s; never)"
    )
    carla = parser.add_argument_group("with --sensors carla (experimental)")
    carla.add_argument("--carla-host", metavar="HOST", help="host of the server (default localhost)")
    carla.add_argument(
        "--carla-port", type=counting, metavar="PORT", help="port of the server (default 2000)"
    )


def run(args: argparse.Namespace) -> int:
    """Simulate or check, and print what was written or found."""
    if args.verify is not None:
        if args.scenario is not None or args.out is not None:
            raise ConfigError("--verify DIR stands alone, without SCENARIO and --out")
        return _verify(Path(args.verify))
    if args.scenario is None or args.out is None:
        raise ConfigError("SCENARIO and --out DIR are needed (or --verify DIR)")
    misplaced = [name for name in _CORRIDOR_ONLY if getattr(args, name) is not None]
    if args.scenario == "corridor":
        return _corridor(args)
    if misplaced:
        raise ConfigError(f"--{misplaced[0]} goes with the scenario corridor")
    unfit = [*(_PICTURE_ONLY if args.sensors == "detections" else ("duration",))]
    unfit += [] if args.sensors in ("detections", "pictures") else ["rig"]
    unfit += [] if args.sensors == "carla" else _CARLA_ONLY
    unfit += ["imaging", "workers", "world", "event_camera", "masks"] if args.sensors == "carla" else []
    for name in unfit:
        if getattr(args, name) is not None:
            flag = "--" + name.replace("_", "-")
            raise ConfigError(f"{flag} does not go with --sensors {args.sensors}")
    from jeat_graph_sehn.simulation.scenario import load_scenario

    scenario = load_scenario(args.scenario, args.density)
    if args.sensors == "detections":
        return _detections(args, scenario)
    return _pictures(args, scenario)


def _detections(args: argparse.Namespace, scenario: Scenario) -> int:
    from tqdm import tqdm

    from jeat_graph_sehn.simulation.dataset.detection_set import STEPS, write_detection_set

    duration = _DURATION_S if args.duration is None else args.duration
    with tqdm(total=STEPS, desc="simulate", disable=not sys.stderr.isatty(), leave=False) as bar:
        manifest = write_detection_set(
            scenario, str(args.scenario), Path(args.out), args.seed, duration, bar.update, _rig(args.rig)
        )
    for name, count in manifest["sensors"].items():
        print(f"{name}: {count['detections']} boxes in {count['scans']} scans")
    print(f"truth: {manifest['truth']['objects']} vehicles in {manifest['truth']['frames']} frames")
    print(f"wrote {args.out}")
    return 0


def _pictures(args: argparse.Namespace, scenario: Scenario) -> int:
    from jeat_graph_sehn.simulation.dataset.protocol import Protocol

    given = {
        "video": args.video or ("png" if args.world not in (None, "fixed") else None),
        "compression": args.compression,
        "shares": args.split,
    }
    protocol = Protocol(
        args.segments or _SEGMENTS,
        args.seed,
        **{key: value for key, value in given.items() if value is not None},
    )
    frames = args.frames or _FRAMES
    if args.rig is not None:
        return _rig_pictures(args, scenario, protocol, frames)
    carla = args.sensors == "carla"
    factory = _carla_source(args, scenario, frames) if carla else _renderer(args, scenario, frames)
    return _record(args, scenario, protocol, frames, factory, Path(args.out))


def _rig_pictures(args: argparse.Namespace, scenario: Scenario, protocol: Protocol, frames: int) -> int:
    """Render a rig: a set of each camera, and the true rig of each segment."""
    from jeat_graph.io.files.atomic import open_atomic
    from jeat_graph_sehn.simulation.dataset.layout import RIGS, segment_name
    from jeat_graph_sehn.simulation.imaging.rig_source import RigEventSource

    rig = _rig(args.rig)
    assert rig is not None
    imaging, world = _imaging(args), args.world or "fixed"
    second = partial(RigEventSource, scenario, imaging, args.seed, frames, world, rig)
    source = second()
    texts = [source.rig_text(index) for index in range(protocol.segments)]  # refused before anything is made
    _record(
        args, scenario, protocol, frames, _renderer(args, scenario, frames, "rgb"), Path(args.out) / "rgb"
    )
    _record(args, scenario, protocol, frames, second, Path(args.out) / "evt")
    folder = Path(args.out) / RIGS
    folder.mkdir(exist_ok=True)
    for index, text in enumerate(texts):
        with open_atomic(folder / f"{segment_name(index)}.yaml") as file:
            file.write(text)
    print(f"wrote {folder}")
    return 0


def _record(
    args: argparse.Namespace,
    scenario: Scenario,
    protocol: Protocol,
    frames: int,
    factory: SourceFactory,
    out: Path,
) -> int:
    """Make a set of pictures, and print what is in it."""
    from tqdm import tqdm

    from jeat_graph.data.processes import available_cores
    from jeat_graph_sehn.simulation.compiling import prepare_renderer
    from jeat_graph_sehn.simulation.dataset.recording import record_dataset
    from jeat_graph_sehn.simulation.scenario import scenario_to_yaml

    carla = args.sensors == "carla"
    # One server renders for CARLA, so there is nothing to gain from several processes.
    workers = 1 if carla else min(args.workers or available_cores(), protocol.segments)
    total = protocol.segments * frames
    quiet = not sys.stderr.isatty()
    if not carla:
        prepare_renderer(workers)
    with (
        tqdm(total=total, desc="simulate", unit=" frames", disable=quiet, leave=False) as bar,
        refreshing(bar),
    ):
        manifest = record_dataset(
            factory,
            out,
            protocol,
            scenario_yaml=scenario_to_yaml(scenario),
            workers=workers,
            on_frames=bar.update,
        )
    totals = manifest["totals"]
    splits = ", ".join(f"{len(names)} {name}" for name, names in manifest["splits"].items())
    print(f"segments: {manifest['segments']} ({splits})")
    print(f"frames: {totals['frames']}, events: {totals['events']}, {totals['bytes'] / 1e6:.1f} MB")
    print(f"truth: {totals['boxes']} boxes, {totals['ignored']} of them hidden or far")
    asked = max(1, totals["boxes"] - totals["ignored"])
    print(
        f"contrast-to-noise below 2 in the RGB pictures: {100 * totals['faint'] / asked:.1f} % of the others"
    )
    print(f"wrote {out}")
    return 0


def _imaging(args: argparse.Namespace) -> ImagingConfig:
    from jeat_graph_sehn.simulation.imaging.config import load_imaging

    tree: dict[str, Any] = {} if args.imaging is None else _read_yaml(Path(args.imaging))
    if args.size is not None or "width" not in (tree.get("render") or {}):
        width, height = args.size or _SIZE
        tree["render"] = {**(tree.get("render") or {}), "width": width, "height": height}
    if args.event_camera is not None:
        tree["evt"] = {**(tree.get("evt") or {}), "sensor": args.event_camera}
    return load_imaging(tree)


def _renderer(
    args: argparse.Namespace, scenario: Scenario, frames: int, sensors: str | None = None
) -> SourceFactory:
    from jeat_graph_sehn.simulation.imaging.source import RenderedSource

    return partial(
        RenderedSource,
        scenario,
        _imaging(args),
        args.seed,
        frames,
        args.world or "fixed",
        sensors or args.sensors,
        masks=bool(args.masks),
    )


def _carla_source(args: argparse.Namespace, scenario: Scenario, frames: int) -> SourceFactory:
    from jeat_graph_sehn.simulation.carla.config import CarlaConfig
    from jeat_graph_sehn.simulation.carla.session import client_api
    from jeat_graph_sehn.simulation.carla.source import CarlaSource

    client_api()  # says so now if it is not installed
    width, height = args.size or _SIZE
    config = CarlaConfig(width=width, height=height)
    host, port = args.carla_host or "localhost", args.carla_port or 2000
    return partial(CarlaSource, scenario, config, args.seed, frames, host, port)


def _rig(given: str | None) -> RigConfig | str | None:
    """Settings of the second camera: none, to be drawn, or those of a file."""
    from jeat_graph.config.section_tree import build
    from jeat_graph_sehn.simulation.world.rig import DRAWN, RigConfig

    if given is None or given == DRAWN:
        return given
    found: RigConfig = build(RigConfig, _read_yaml(Path(given)), "")
    return found


def _corridor(args: argparse.Namespace) -> int:
    """Simulate a road with several cameras and write what `road` would write of each."""
    from jeat_graph.io.files.outputs import check_folder
    from jeat_graph_sehn.simulation.corridor.traffic import CorridorTraffic
    from jeat_graph_sehn.simulation.corridor.writing import write_corridor_world

    other = [
        name for name in (*_PICTURE_ONLY, *_CARLA_ONLY, "rig", "density") if getattr(args, name) is not None
    ]
    if other or args.sensors != "detections":
        name = other[0] if other else "sensors"
        raise ConfigError(f"--{name.replace('_', '-')} does not go with the scenario corridor")
    check_folder(args.out)
    ramps = 0.04 if args.ramps is None else args.ramps
    start, end = (0.0, 0.0) if args.queue is None else args.queue
    config = CorridorTraffic(
        duration_s=_CORRIDOR_DURATION_S if args.duration is None else args.duration,
        flow_per_h=2400.0 if args.flow is None else args.flow,
        places_m=(0.0, 500.0) if args.cameras is None else args.cameras,
        leave=ramps,
        join=ramps,
        queue_from_s=start,
        queue_until_s=end,
    )
    folders = write_corridor_world(config, args.seed, Path(args.out))
    print(f"{len(folders)} cameras: {args.out}")
    return 0


def _places(text: str) -> tuple[float, ...]:
    try:
        places = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ArgumentTypeError(f"must be places in m such as 0,500,1200, not {text!r}") from None
    apart = [b - a for a, b in pairwise(places)]
    if len(places) < 2 or not all(20.0 <= gap <= 20_000.0 for gap in apart):
        raise ArgumentTypeError("must be two places or more, each 20 m to 20 km beyond the one before")
    return places


def _span(text: str) -> tuple[float, float]:
    try:
        start, end = (float(part) for part in text.split(","))
    except ValueError:
        raise ArgumentTypeError(f"must be two times in s such as 200,400, not {text!r}") from None
    if not 0.0 <= start < end:
        raise ArgumentTypeError("must be two times, the second one later")
    return start, end


def _verify(folder: Path) -> int:
    from tqdm import tqdm

    from jeat_graph_sehn.simulation.dataset.verify import file_count, verify

    problems = 0
    count = file_count(folder)
    quiet = not sys.stderr.isatty()
    with tqdm(total=count, desc="verify", unit=" files", disable=quiet, leave=False) as bar:
        for problem in verify(folder, bar.update):
            problems += 1
            with bar.external_write_mode(file=sys.stdout):
                print(problem)
    if not problems:
        print(f"{folder}: {count} files, all as they should be")
    return 1 if problems else 0


def _read_yaml(path: Path) -> dict[str, Any]:
    from jeat_graph.config.section_tree import read_tree

    if not path.is_file():
        raise ConfigError(f"{path}: no such file")
    return read_tree(str(path), (), str, "imaging file")


def _size(text: str) -> tuple[int, int]:
    width, height = drawn_size(text)
    if width % 2 or height % 2:
        raise ArgumentTypeError(f"must be even numbers, not {text!r}")
    return width, height


def _shares(text: str) -> tuple[float, float, float]:
    try:
        train, val, test = (float(part) for part in text.split(":"))
    except ValueError:
        raise ArgumentTypeError(f"must read like 70:15:15, not {text!r}") from None
    return train, val, test
