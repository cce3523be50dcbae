"""Options that several commands share, declared once: the same name means the same everywhere.

========================  ================================================================================
`--rate HZ`               frame rate of input files that count frames
`--first-frame`           number of their first frame
`--only-video`            which of several videos in a file is read
`--classes`               names of the classes that a file numbers (`--class` chooses some)
`--output-rate HZ`        frames or pictures per second of what is written
`--image WxH`             size of the camera's picture, which boxes are given in
`--size WxH`              size of pictures that are drawn
`--config`, `--set`       the configuration and changes to it
========================  ================================================================================
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from jeat_graph.config.argument_types import output_rate, picture_size, positive
from jeat_graph.config.smoothing import ENGINES, FORMER
from jeat_graph.data.frame_numbers import FIRST_FRAMES
from jeat_graph.data.secrets import without_logins
from jeat_graph.data.tables.frame_filling import SCORE_SCALES
from jeat_graph.data.tables.reading import ReadingOptions
from jeat_graph.data.time_units import TIME_UNITS
from jeat_graph.io.formats.csv_table import FORMAT as CSV
from jeat_graph.io.formats.registry import format_names, written_formats


class Parser(argparse.ArgumentParser):
    """A parser that takes options by their whole names only: `--image` is never taken for `--images`.

    What it says of wrong arguments shows no password of a URL among them.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        options.setdefault("allow_abbrev", False)
        super().__init__(*args, **options)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and end with code 2."""
        super().error(without_logins(message))


def add_config(parser: argparse.ArgumentParser, default: str = "default", *, settings: bool = True) -> None:
    """Declare `--config` and, if `settings`, `--set` (`overrides`)."""
    add = parser.add_argument
    add("--config", default=default, metavar="NAME|FILE", help=f"preset or YAML file (default: {default})")
    if settings:
        add_settings(parser, "smoother.lag_s=0.5")


def add_settings(parser: argparse.ArgumentParser, example: str) -> None:
    """Declare `--set` (`overrides`)."""
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help=f"change one setting, for example {example}; may be repeated",
    )


def add_image(parser: argparse.ArgumentParser) -> None:
    """Declare `--image`."""
    parser.add_argument(
        "--image",
        type=picture_size,
        metavar="WxH",
        help="size of the camera's picture in px, for example 1920x1080 (default: from seqinfo.ini "
        "beside the input, else from the configuration)",
    )


def add_rig(parser: argparse.ArgumentParser) -> None:
    """Declare `--rig`."""
    parser.add_argument(
        "--rig",
        metavar="RIG.yaml",
        help="how the pictures and clocks of several sensors map to common ones, as written by "
        "`jeat-graph register`",
    )


def image_overrides(size: tuple[int, int] | None) -> list[str]:
    """Return the settings that `--image` stands for."""
    return [] if size is None else [f"image.width={size[0]}", f"image.height={size[1]}"]


def add_rate(parser: argparse.ArgumentParser) -> None:
    """Declare `--rate`, the frame rate of what is read."""
    parser.add_argument(
        "--rate", type=positive, metavar="HZ", help="frames per second of input files that count frames"
    )


def add_counting(parser: argparse.ArgumentParser) -> None:
    """Declare how files are read that count frames, number classes, or hold several videos."""
    add_frames(parser)
    parser.add_argument(
        "--classes",
        dest="class_names",
        metavar="FILE|NAMES",
        help="class names for files with class numbers: a file with one name per line, YOLO's "
        "data.yaml, or names with commas between them; MOTChallenge text counts from 1, all else "
        "from 0 (default: labels.txt or classes.txt beside the input)",
    )


def add_frames(parser: argparse.ArgumentParser) -> None:
    """Declare how files are read that count frames, or hold several videos (`frames_read`)."""
    add_rate(parser)
    add = parser.add_argument
    add(
        "--first-frame",
        type=int,
        choices=FIRST_FRAMES,
        help="number of the first frame in files that count frames (default: 0 if there is a frame 0, "
        "else 1; KITTI 0)",
    )
    add("--only-video", metavar="NAME", help="which video to read, if a file holds several")


def add_tables(parser: argparse.ArgumentParser) -> None:
    """Declare how results and truth are read (`tables_read`)."""
    add_counting(parser)
    parser.add_argument(
        "--image",
        type=picture_size,
        metavar="WxH",
        help="size of the picture, for boxes given as fractions of it (YOLO)",
    )


def tables_read(args: argparse.Namespace) -> ReadingOptions:
    """Return what `add_tables` declared, as readers take it."""
    return {**frames_read(args), "class_names": args.class_names, "image": args.image}


def frames_read(args: argparse.Namespace) -> ReadingOptions:
    """Return what `add_frames` declared, as readers take it."""
    return {"rate_hz": args.rate, "first_frame": args.first_frame, "video": args.only_video}


def add_output_rate(parser: argparse.ArgumentParser, text: str, *old_names: str) -> None:
    """Declare `--output-rate`, the frame rate of what is written.

    Args:
        parser: of the command.
        text: help.
        old_names: further names, understood but not shown.
    """
    parser.add_argument("--output-rate", type=output_rate, metavar="HZ", help=text)
    for name in old_names:
        add_old_name(parser, name, "--output-rate", output_rate)


class _OldName(argparse.Action):
    """Takes an option under the name it had before, and says how it is called now."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        value: Any,
        name: str | None = None,
    ) -> None:
        print(f"{parser.prog}: warning: {name} is called {self.const} now", file=sys.stderr)
        setattr(namespace, self.dest, value)


def add_old_name(
    parser: argparse.ArgumentParser, old: str, new: str, kind: Callable[[str], float] = positive
) -> None:
    """Declare the name that an option with a number had before: understood, not shown, and warned of."""
    dest = new.removeprefix("--").replace("-", "_")
    parser.add_argument(old, dest=dest, const=new, type=kind, action=_OldName, help=argparse.SUPPRESS)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Declare how files of detections are read: `reading` takes them from the parsed arguments."""
    add = parser.add_argument
    add_counting(parser)
    add("--input-format", choices=format_names(), help="format of the input, if it is not recognised")
    add("--images", metavar="FILE", help="COCO data set with the images and times of COCO results")
    add_columns(parser)


def add_columns(parser: argparse.ArgumentParser) -> None:
    """Declare what the columns of detections mean, and which of them are taken."""
    parser.add_argument(
        "--score-scale",
        choices=SCORE_SCALES,
        default="unit",
        help="scores are in [0, 1] (unit), percent, or raw scores of any size (logistic)",
    )
    add_time_unit(parser)
    add_classes(parser, "use only detections of these classes, and detections without a class")


def add_time_unit(parser: argparse.ArgumentParser, where: str = "") -> None:
    """Declare `--time-unit` of the column t `where` it is not that of every file."""
    text = f"unit of the column t{where} (default: s)"
    parser.add_argument("--time-unit", choices=tuple(TIME_UNITS), default="s", help=text)


def add_classes(parser: argparse.ArgumentParser, text: str) -> None:
    """Declare `--class` (`classes`)."""
    parser.add_argument("--class", dest="classes", nargs="+", action="extend", metavar="NAME", help=text)


def columns_read(args: argparse.Namespace) -> ReadingOptions:
    """Return what `add_counting` and `add_columns` declared, as readers take it, but for `--class`."""
    return {
        "rate_hz": args.rate,
        "first_frame": args.first_frame,
        "video": args.only_video,
        "class_names": args.class_names,
        "score_scale": args.score_scale,
        "time_unit": args.time_unit,
    }


def reading(args: argparse.Namespace) -> dict[str, Any]:
    """Return what `add_reading` declared, as `read_many` takes it."""
    return {
        **columns_read(args),
        "fmt": args.input_format,
        "images": args.images,
        "classes": args.classes,
    }


def add_smoother(parser: argparse.ArgumentParser) -> None:
    """Declare `--smoother`."""
    parser.add_argument(
        "--smoother",
        choices=(*ENGINES, *FORMER),
        metavar="NAME",
        help="smoother of smoothed.csv: full (whole tracks), fixed-lag (with a delay, for live use), "
        "gtsam-full and gtsam (the same by factor graphs in GTSAM), none; default: as the configuration says",
    )


def add_formats(parser: argparse.ArgumentParser) -> None:
    """Declare `--format` of a run's tables and `--diagnostics`."""
    add = parser.add_argument
    written = written_formats()
    others = ", ".join(one.name for one in written if one is not CSV)
    add(
        "--format",
        dest="formats",
        nargs="+",
        action="extend",
        default=[],
        choices=[one.name for one in written],
        metavar="NAME",
        help=f"also write the tables as {others} (csv is always written)",
    )
    add(
        "--diagnostics",
        action="store_true",
        help="also write diagnostics.csv (NIS and noise scale of every update) and measurements.parquet (the "
        "detections that tracks took), for `report` and `road`",
    )


def extra_formats(args: argparse.Namespace) -> tuple[str, ...]:
    """Return the formats asked for beside CSV, each once."""
    return tuple(dict.fromkeys(name for name in args.formats if name != CSV.name))


def overrides(args: argparse.Namespace) -> list[str]:
    """Return all changed settings: of `--set`, `--image` and `--smoother`, where the command has them."""
    found = [*args.overrides, *image_overrides(getattr(args, "image", None))]
    engine = getattr(args, "smoother", None)
    return found if engine is None else [*found, f"smoother.engine={engine}"]
