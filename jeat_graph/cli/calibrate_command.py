"""`jeat-graph calibrate`: estimate a configuration from recordings."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.cli.options import add_config, add_image, add_reading, add_rig, reading, tables_read
from jeat_graph.cli.progress import stages
from jeat_graph.cli.terminal import say
from jeat_graph.data.errors import ConfigError, DataError

if TYPE_CHECKING:
    from jeat_graph.calibration.procedure import Calibration, MeasuredSetting
    from jeat_graph.config.schema import Config
    from jeat_graph.data.detections import Detections
    from jeat_graph.data.tables.reading import ReadingOptions
    from jeat_graph.data.trajectories import GroundTruth
    from jeat_graph.eval.tables import Cell, Table
    from jeat_graph.runs.beside import Facts

WRITES = ("out",)
HELP = (
    "estimate sensor rates, clocks and what scores mean from recordings, with or without "
    "ground truth; write a configuration"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add(
        "detections",
        nargs="+",
        metavar="DETECTIONS",
        help="one file per recording; all are pooled; NAME=path names a sensor",
    )
    add("--gt", nargs="+", action="extend", metavar="FILE", help="truth of each recording, in the same order")
    add("--out", required=True, metavar="CONFIG.yaml", help="the configuration to write")
    add_config(parser, settings=False)
    add_image(parser)
    add_rig(parser)
    add_reading(parser)
    add(
        "--frames",
        metavar="VIDEO|DIR",
        help="pictures of one of the recordings, for the picture's size and the frame rate of all",
    )
    add(
        "--no-tune",
        action="store_true",
        help="keep every measured even_score and lasting_error, without tracking the recordings to check it",
    )


def run(args: argparse.Namespace) -> int:
    """Calibrate, write the configuration, and print what was estimated."""
    from jeat_graph.config.reading import as_config, load_config
    from jeat_graph.io.files.atomic import check_writable
    from jeat_graph.io.files.config_io import save_config
    from jeat_graph.io.tables.detections_io import split_name
    from jeat_graph.rig.common_picture import in_common, with_ways_of, without_ways
    from jeat_graph.runs.beside import facts_beside, facts_of_frames
    from jeat_graph.runs.clock_pass import with_clocks
    from jeat_graph.runs.latency import at_measurement

    if args.gt and len(args.gt) != len(args.detections):
        raise DataError(
            f"{len(args.detections)} DETECTIONS and {len(args.gt)} --gt given; give one truth for each"
        )
    if Path(args.out).suffix not in (".yaml", ".yml"):
        raise ConfigError(f"--out {args.out}: the name of a configuration must end in .yaml")
    check_writable(args.out)
    given = base = load_config(args.config, rig=args.rig)
    if args.image is not None:
        given = as_config(base, args.image)
    shown = None if args.frames is None else facts_of_frames(args.frames)
    files = [str(split_name(item)[1]) for item in args.detections]
    if shown is not None and args.rate is None and not any(facts_beside([path]) for path in files):
        args.rate = shown.rate_hz
    how = {**reading(args), "image": args.image or (None if shown is None else shown.size_px)}
    loaded = _read(args, how)
    read = [in_common(one, given) for one, _ in loaded]
    for line in dict.fromkeys(line for _, _, notes in read for line in notes):
        say("calibrate", line)
    base, lines = with_clocks([one for one, _, _ in read], without_ways(base), args.detections)
    for line in lines:
        say("calibrate", line)
    recordings = [at_measurement(one, base) for one, _, _ in read]
    beside = None if args.image else _size_beside(files, shown)
    picture = _picture_from(args, base, beside)
    base = with_image(base, recordings, args.image or (None if beside is None else beside.size_px))
    if args.gt:
        truths = [one for _, one in loaded if one is not None]
        pairs = list(zip(recordings, truths, strict=True))
        for path, pair in zip(args.gt, pairs, strict=True):
            _check_pair(path, *pair)
        found = _with_truth(pairs, base, not args.no_tune)
    else:
        found = _without_truth(recordings, base)
    _say_lags(found, "the truth" if args.gt else "the sensor that sees most")
    config = with_ways_of(found.config, given)
    save_config(config, args.out, comment=describe(args, picture, found))
    sys.stdout.write("\n".join(table.render("text") for table in summary(config, found)))
    print(f"written: {args.out}", file=sys.stderr)
    return 0


def _read(args: argparse.Namespace, how: dict[str, Any]) -> list[tuple[Detections, GroundTruth | None]]:
    """Read each recording, and with it its truth, the first frames of both decided together."""
    from jeat_graph.io.tables.detections_io import read_many
    from jeat_graph.io.tables.with_truth import read_with_truth

    if not args.gt:
        return [(read_many([path], **how), None) for path in args.detections]
    like: ReadingOptions = {**tables_read(args), "time_unit": args.time_unit, "image": how["image"]}
    pairs = zip(args.detections, args.gt, strict=True)
    return [read_with_truth(path, truth, like, **how) for path, truth in pairs]


def _check_pair(path: str, recording: Detections, truth: GroundTruth) -> None:
    """Refuse truth of another clock or unit of time, as `eval` does."""
    import numpy as np

    from jeat_graph.eval.pairing import check_times

    frames, instants = truth.frame_times(), np.unique(recording.scan_t)
    if not len(frames) or not len(instants):
        return
    try:
        check_times(frames, instants, "detections")
    except DataError as error:
        raise DataError(error.message, path) from None


def _size_beside(paths: list[str], shown: Facts | None) -> Facts | None:
    from jeat_graph.runs.beside import facts_beside

    facts = facts_beside(paths) if shown is None else shown
    if facts is None or facts.size_px is None:
        return None
    say("calibrate", f"picture of {facts.size_px[0]} x {facts.size_px[1]} px, as {facts.origin} says")
    return facts


def _picture_from(args: argparse.Namespace, base: Config, beside: Facts | None) -> str:
    """Say where the size of the picture comes from."""
    if args.image:
        return "--image"
    if beside is not None:
        return Path(beside.origin).name
    if base.input.picture == "seen":
        return "the boxes, as far as they reach"
    return f"the base configuration {Path(args.config).name}"


def with_image(base: Config, recordings: list[Detections], size: tuple[int, int] | None) -> Config:
    """Set the size of the picture, or check that the base configuration's fits the boxes.

    Args:
        base: configuration.
        recordings: all boxes to be fitted.
        size: width and height (px), if given.

    Raises:
        ConfigError: no size is given and boxes lie beyond the base configuration's picture.
    """
    if size is not None:
        from jeat_graph.config.reading import as_config

        return as_config(base, size)
    if base.input.picture == "seen":
        from jeat_graph.runs.declaring import fit_picture

        return fit_picture(base, recordings)
    right = max((float((d.boxes[:, 0] + d.boxes[:, 2]).max()) for d in recordings if len(d)), default=0.0)
    bottom = max((float((d.boxes[:, 1] + d.boxes[:, 3]).max()) for d in recordings if len(d)), default=0.0)
    width, height = base.image.width, base.image.height
    # Detectors let boxes reach over the edge by a little.
    if right > 1.1 * width or bottom > 1.1 * height:
        raise ConfigError(
            f"boxes reach to {right:g}, {bottom:g} px, beyond the {width:g} x {height:g} px of the base "
            "configuration's picture; give its size as --image WxH"
        )
    say(
        "calibrate",
        f"picture of {width:g} x {height:g} px, from the base configuration (--image WxH changes it)",
    )
    return base


def _with_truth(recordings: list[tuple[Detections, GroundTruth]], base: Config, tuned: bool) -> Calibration:
    from jeat_graph.calibration.procedure import calibrate_with_truth

    say("calibrate", "estimating clocks and what scores mean from detections matched with the truth")
    with stages("calibrate", 1) as stage:
        stage("estimating")
        return calibrate_with_truth(recordings, base, tuned=tuned)


def _without_truth(recordings: list[Detections], base: Config) -> Calibration:
    from jeat_graph.calibration.procedure import calibrate_without_truth

    say("calibrate", "no --gt: sensors, their rates and clocks are found; what scores mean is not")
    with stages("calibrate", 1) as stage:
        stage("estimating")
        return calibrate_without_truth(recordings, base)


def _say_lags(found: Calibration, beside: str) -> None:
    """Tell of sensors whose clock is off, and what of it is in the configuration.

    Args:
        found: lags and configuration.
        beside: what the clocks were compared with.
    """
    lines = []
    for lag in found.lags:
        if lag.found:
            late = f"{abs(lag.lag_s) * 1e3:.0f} ms {'late' if lag.lag_s > 0 else 'early'}"
            lines.append(f"sensor {lag.sensor!r} is {late} (± {lag.std_s * 1e3:.1f} ms) beside {beside}")
    if lines:
        latency = {name: s.latency_s for name, s in sorted(found.config.sensors.items())}
        taken = [f"sensors.{name}.latency_s {late_s:g}" for name, late_s in latency.items()]
        lines.append(f"taken off the times from now on: {', '.join(taken)} (s)")
    for line in lines:
        say("calibrate", line)


def describe(args: argparse.Namespace, picture: str, found: Calibration) -> str:
    """Comment at the head of the file: where each part comes from."""
    from jeat_graph.io.tables.detections_io import split_name
    from jeat_graph.version import __version__

    files = [Path(split_name(item)[1]) for item in args.detections]
    names = ", ".join(f"{path.parent.name}/{path.name}" for path in files)
    lines = [f"Made by jeat-graph calibrate {__version__} from {len(args.detections)} recording(s):", names]
    if args.gt:
        lines.append(
            "rates, clocks, what scores mean (even_score) and, of several sensors, what boxes are off "
            "(lasting_error): from detections matched with the truth."
        )
    else:
        lines.append(
            "which sensors there are, their rates and their clocks: from the recordings, without truth."
        )
    lines += [f"image: from {picture}; all else from the base configuration {Path(args.config).name}."]
    return "\n".join(lines)


def summary(config: Config, found: Calibration) -> list[Table]:
    """Tables of what was estimated: one row a sensor."""
    from jeat_graph.eval.tables import Table

    scores = {one.sensor: one for one in found.even_scores}
    rows: list[dict[str, Cell]] = []
    for name, sensor in sorted(config.sensors.items()):
        row: dict[str, Cell] = {
            "sensor": name,
            "rate_hz": sensor.rate_hz,
            "late (ms)": 1e3 * sensor.latency_s,
        }
        one = scores.get(name)
        if one is not None:
            row |= _judged("even score", one)
        rows.append(row)
    tables = [Table.from_records(rows, title="Sensors", digits={"even score": 3})]
    if found.lasting_errors:
        rows = [{"sensor": one.sensor, **_judged("lasting error", one)} for one in found.lasting_errors]
        tables.append(Table.from_records(rows, title="Lasting errors", digits={"lasting error": 3}))
    return tables


def _judged(name: str, one: MeasuredSetting) -> dict[str, Cell]:
    """Return the cells of a measured setting."""
    kept = "yes" if one.kept else "no"
    return {name: one.value, "accuracy without (%)": one.before, "with (%)": one.after, "kept": kept}
