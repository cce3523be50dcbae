"""Options that the benchmarks from raw recordings share: data sets, and detectors of each sensor."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import common
from benchmarks.raw_segments import SENSORS, Finding, RawSegment, detector_named
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.detecting import FUSED_SENSOR
from jeat_graph.detection.named import EVENTS, FRAMES, FUSED, MOTION

KINDS = (FRAMES, EVENTS)
#: In place of detectors: nobody looks at these.
NONE = "none"


def add_raw(parser: argparse.ArgumentParser, name: str, one_is_enough: bool = False) -> None:
    """Declare data sets and detectors.

    Args:
        parser: of the benchmark.
        name: of the files that it writes.
        one_is_enough: whether one of pictures and events may be left out.
    """
    add = parser.add_argument
    add(
        "folders",
        nargs="*",
        metavar="DATA",
        help="folders that `simulate --sensors pictures` wrote, one a light; no detector may have seen them",
    )
    texts = "detectors of {}: motion, the name of a network that comes with the package, or FILE.onnx"
    texts += f"; {NONE}: nobody looks at them" if one_is_enough else ""
    for kind, seen in zip(KINDS, ("pictures", "events"), strict=True):
        help_text = texts.format(f"{seen} (default: {MOTION})")
        add(f"--{kind}", nargs="+", default=[MOTION], metavar="NAME|FILE", help=help_text)
    add(
        "--fused",
        nargs="+",
        default=[],
        metavar="NAME|FILE",
        help="networks that look at both at once (default: none)",
    )
    add(
        "--detection-set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a setting of the detectors, say model_frames.threads=1; may be given many times",
    )
    common.declare(parser, name, {})


def detectors_of(args: argparse.Namespace) -> dict[str, list[dict[str, Any]]]:
    """Return the detectors of each sensor, with checksums of files.

    Raises:
        ConfigError: a name that is not known.
        DataError: no such file.
    """
    return {sensor: [detector_named(one, kind) for one in names] for sensor, kind, names in _asked(args)}


def _asked(args: argparse.Namespace) -> list[tuple[str, str, list[str]]]:
    """Return sensors with what they look at and the detectors asked for."""
    asked: list[tuple[str, str, list[str]]]
    asked = list(zip(SENSORS, KINDS, (args.frames, args.events), strict=True))
    return [*asked, (FUSED_SENSOR, FUSED, args.fused)] if args.fused else asked


def findings(
    args: argparse.Namespace, segments: Sequence[RawSegment], changes: Sequence[str] = ()
) -> list[Finding]:
    """Return what is to be looked for: each detector in each segment.

    Args:
        args: of the command.
        segments: to look at.
        changes: `section.key=value` texts over the detectors' settings; those of the command are over them.

    Raises:
        ConfigError: no data, settings that are not valid, or two detectors of one name.
    """
    from jeat_graph.detection.settings import load_settings

    detectors_of(args)
    settings = load_settings(None, (*changes, *args.detection_set))
    for _, _, names in _asked(args):
        short = [Path(one).name for one in dict.fromkeys(names)]
        if len(set(short)) < len(short):
            raise ConfigError(
                f"{max(short, key=short.count)} is the name of two files, whose rows would be mixed"
            )
    return [
        Finding(segment, sensor, detector, settings)
        for sensor, _, names in _asked(args)
        for detector in dict.fromkeys(names)
        for segment in segments
    ]
