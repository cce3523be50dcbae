"""`jeat-graph demo`: the whole way on a simulated highway, from detections to scores and a picture.

What is tracked comes with the package; other scenarios, lengths and seeds, and raw pictures and events, are
simulated by jeat-graph-sehn.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.api.beside import COMMAND_GROUP, FUNCTION_GROUP, find
from jeat_graph.cli.options import add_config
from jeat_graph.cli.progress import stages
from jeat_graph.cli.terminal import say
from jeat_graph.data.errors import ConfigError

if TYPE_CHECKING:
    from jeat_graph.config.schema import Config
    from jeat_graph.data.arrays import FloatArray
    from jeat_graph.data.detections import Detections
    from jeat_graph.data.trajectories import Trajectories
    from jeat_graph.eval.metrics import Scores
    from jeat_graph.eval.tables import Table
    from jeat_graph.runs.demo_recording import DemoRecording

HELP = (
    "track a simulated highway at night with both sensors and with each alone; write the "
    "recording, tracks, scores and a picture"
)
COLUMNS = ("sensors", "MOTA", "HOTA", "IDF1", "FP", "FN", "IDSW")
SCENARIO = "night-nolight"
DURATION_S = 24.0
SEED = 7
#: Options of `--film`.
_OF_FILMS = ("frames", "events", "line", "lines")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument("--out", default="demo", metavar="DIR", help="folder to write into (default demo)")
    add_config(parser, settings=False)
    simulated = parser.add_argument_group(
        "other recordings than the one that comes along (needs jeat-graph-sehn)"
    )
    add = simulated.add_argument
    add("--scenario", metavar="NAME", help=f"a scenario of `simulate` (default {SCENARIO})")
    add("--duration", type=float, metavar="S", help=f"length (default {DURATION_S:g})")
    add("--seed", type=int, metavar="N", help=f"seed of the simulation (default {SEED})")
    add(
        "--from-raw",
        action="store_true",
        help="also start from raw data: simulate a short clip of pictures and events, detect the "
        "vehicles, track and evaluate them, and draw a film and a strip of pictures",
    )
    film = parser.add_argument_group("a film instead")
    add = film.add_argument
    add(
        "--film",
        action="store_true",
        help="make film.mp4 of twenty seconds of a simulated highway at night, both cameras side by side, "
        "with causal and smoothed tracks and counts (needs jeat-graph-sehn; ten minutes of one core), or of "
        "a recording of yours: jeat-graph demo --film --frames street.mp4 --line 0,400,1280,400",
    )
    add("--frames", metavar="VIDEO|DIR", help="with --film: draw and track this video, folder or AEDAT4 file")
    add("--events", metavar="FILE", help="with --frames: events of the same scene, beside the pictures")
    add("--line", action="append", default=[], metavar="[NAME=]X1,Y1,X2,Y2", help="with --frames: count here")
    add("--lines", action="append", default=[], metavar="FILE.yaml", help="with --frames: lines of `draw`")


def run(args: argparse.Namespace) -> int:
    """Track, judge, draw, and say where everything is."""
    out = Path(args.out)
    if args.film:
        return _film(args, out)
    given = next((name for name in _OF_FILMS if getattr(args, name)), None)
    if given is not None:
        raise ConfigError(f"--{given} is of the film: add --film")
    if not args.from_raw:
        _show(args, out)
        _say_next()
        return 0
    from jeat_graph.cli.demo_raw import go_the_whole_way

    find(COMMAND_GROUP, "simulate", "--from-raw")  # says so now if it is not installed
    _show(args, out)
    if code := go_the_whole_way(out):
        return code
    _say_next()
    return 0


def _film(args: argparse.Namespace, out: Path) -> int:
    """Make the film of the simulated highway, or of the user's own recording."""
    from jeat_graph.cli.demo_film import make_film, recorded_commands, simulated_commands

    if args.from_raw or _is_simulated(args):
        raise ConfigError(
            "--film has a scenario of its own: leave out --from-raw, --scenario, --duration, --seed"
        )
    if args.frames is not None:
        return make_film(out, recorded_commands(out, args))
    given = next((name for name in _OF_FILMS[1:] if getattr(args, name)), None)
    if given is not None:
        raise ConfigError(f"--{given} goes with --frames: the simulated film has its own")
    find(COMMAND_GROUP, "simulate", "--film")  # says so now if it is not installed
    return make_film(out, simulated_commands(out, args.config))


def _is_simulated(args: argparse.Namespace) -> bool:
    return any(getattr(args, name) is not None for name in ("scenario", "duration", "seed"))


def _recording(args: argparse.Namespace) -> DemoRecording:
    """The recording that comes along, or the one that is asked for."""
    if not _is_simulated(args):
        from jeat_graph.runs.demo_recording import read_demo_recording

        return read_demo_recording()
    record = find(FUNCTION_GROUP, "record_demo", "another highway")
    duration_s = DURATION_S if args.duration is None else args.duration
    with stages("demo", 1) as stage:
        stage(f"simulating {duration_s:g} s")
        made: DemoRecording = record(
            SCENARIO if args.scenario is None else args.scenario,
            None,
            duration_s,
            SEED if args.seed is None else args.seed,
        )
    return made


def _show(args: argparse.Namespace, out: Path) -> None:
    """Track a recording and judge the tracks, and draw them."""
    from jeat_graph.config.reading import as_config, load_config
    from jeat_graph.io.tables.detections_io import write_detections
    from jeat_graph.io.tables.sensor_columns import as_settings, takes_declared
    from jeat_graph.io.tables.trajectories_io import read_trajectories
    from jeat_graph.io.tables.truth_io import write_truth
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.directory import RunDirectory
    from jeat_graph.runs.input_checks import check_detections
    from jeat_graph.runs.inputs import describe_inputs
    from jeat_graph.runs.run_options import RunOptions, RunRecord
    from jeat_graph.runs.tracking_run import write_run

    load_config(args.config)  # what is wrong in it is reported before anything is simulated
    recording = _recording(args)
    declared = as_settings(recording.declared) if takes_declared(args.config) else []
    config = load_config(args.config, declared)
    config = as_config(config, (recording.width, recording.height))
    config = fit_input(config, recording.detections)[0]
    directory = RunDirectory(out / "run")
    warnings = check_detections(recording.detections, config, recording.name)
    source = out / "detections.csv"
    write_detections(recording.detections, source, declared=recording.declared)
    write_truth(recording.truth, out / "gt.csv")

    length_s = float(recording.detections.scan_t[-1] - recording.detections.scan_t[0])
    say("demo", f"{length_s:.0f} s of {recording.name}, simulated; tracking with both sensors …")
    origin = {"config_name": args.config, "inputs": describe_inputs([source])}
    origin["reading"] = {"detections": [str(source)]}  # as `track` has it: `compare` reads the inputs again
    details = RunRecord(source=origin, warnings=warnings)
    with directory:
        write_run(recording.detections, config, directory, details, RunOptions(progress=sys.stderr.isatty()))
    table = read_trajectories(out / "run" / "causal.csv")
    say("demo", "tracking with each sensor alone, and judging …")
    scores = _compare(recording, config, table, out / "run" / "smoothed.csv")
    _write_text(scores.render("markdown"), out / "scores.md")
    say("demo", "drawing …")
    with stages("demo", 1) as stage:
        stage("drawing")
        pictures = _draw(recording, table, out / "tracks")

    print(scores.render())
    print(f"picture   {pictures[0]} (and {pictures[1].name})")
    print(f"tracks    {out / 'run'}: causal.csv and smoothed.csv")
    print(f"input     {source}, truth {out / 'gt.csv'}")
    print()


def _say_next() -> None:
    print(
        "Next: track your own detections with `jeat-graph track my.csv --out run` (columns t, sensor, left,"
    )
    print("top, width, height, score), and judge them with `jeat-graph eval run --gt gt.csv`.")


def _compare(recording: DemoRecording, config: Config, causal: Trajectories, smoothed: Path) -> Table:
    """Scores of all sensors together (tracked already) and of each alone, at the truth's times."""
    from jeat_graph.eval.metrics import evaluate
    from jeat_graph.eval.tables import Cell, Table
    from jeat_graph.io.tables.trajectories_io import read_trajectories
    from jeat_graph.tracking.whole import track

    detections, truth = recording.detections, recording.truth
    names = " + ".join(detections.sensors)
    rows = {names: _causal_scores(recording, detections, causal)}
    if smoothed.is_file():
        rows[f"{names}, smoothed"] = evaluate([(truth, read_trajectories(smoothed))], kind="smoothed")
    with stages("demo", len(detections.sensors)) as stage:
        for name in detections.sensors:
            stage(f"tracking with {name} alone")
            alone = detections.select([name])
            rows[f"{name} alone"] = _causal_scores(recording, alone, track(config, alone))
    records: list[dict[str, Cell]] = [{"sensors": name, **one.as_dict()} for name, one in rows.items()]
    return Table.from_records(records, COLUMNS)


def _causal_scores(recording: DemoRecording, detections: Detections, table: Trajectories) -> Scores:
    import numpy as np

    from jeat_graph.eval.metrics import evaluate

    return evaluate([(recording.truth, table)], instants=[np.unique(detections.scan_t)])


def _draw(recording: DemoRecording, table: Trajectories, stem: Path) -> list[Path]:
    import numpy as np

    from jeat_graph.drawing.palette import DAY, NIGHT
    from jeat_graph.drawing.picture.figure import save_pictures
    from jeat_graph.drawing.picture.plane import Backdrop

    end = float(recording.truth.frame_times()[-1])
    table = table.take(table.t <= end)
    missed, false = _errors(recording, table, end)
    count = len(np.unique(table.track_id))
    backdrop = Backdrop(
        width=recording.width,
        height=recording.height,
        lines=recording.lines,
        missed=missed,
        false=false,
        title=f"{recording.name}: {count} tracks in {end:.0f} s",
        subtitle=" + ".join(table.sensors) + f" · the picture at t = {end:.1f} s, trails of the last 3 s",
    )
    return save_pictures(table, backdrop, stem, DAY if recording.name.startswith("day") else NIGHT)


def _errors(recording: DemoRecording, table: Trajectories, t: float) -> tuple[FloatArray, frozenset[int]]:
    """True boxes (M, 4) at a time of the truth that no track lies on, and tracks that lie on no true box."""
    import numpy as np

    from jeat_graph.association.overlap import pairwise_iou
    from jeat_graph.eval.matching import match

    truth = recording.truth
    now = truth.t == t
    boxes, ignored = truth.boxes[now], truth.ignore[now]
    tracks = table.take(table.t == table.t.max(initial=-np.inf))
    found = match(pairwise_iou(boxes, tracks.boxes), 0.5)
    missed = [k for k in range(len(boxes)) if not ignored[k] and k not in set(found.tolist())]
    return boxes[missed], frozenset(tracks.track_id[found < 0].tolist())


def _write_text(text: str, path: Path) -> None:
    from jeat_graph.io.files.atomic import open_atomic

    with open_atomic(path) as file:
        file.write(text)
