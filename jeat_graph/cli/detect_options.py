"""Options of the commands that detect in raw pictures and events, or that declare what did."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from jeat_graph.config.argument_types import finite, picture_size, positive

if TYPE_CHECKING:
    from jeat_graph.detection.request import DetectRequest
    from jeat_graph.detection.settings import DetectionSettings
    from jeat_graph.io.events.layout import EventLayout
    from jeat_graph.io.events.trigger_times import TriggerChoice

#: Units of time of tables of events.
UNITS = ("s", "ms", "us", "ns")
#: Clocks of a bag's events (`io.events.layout.CLOCKS`).
CLOCKS = ("sensor", "header")
#: The preset of who names none.
DEFAULT = "default"
#: What is no network, or not one that is known before the pictures are.
_NO_NETWORK = ("motion", "auto")
#: `--mask none`.
_NO_MASK = "none"


def add_detecting(parser: argparse._ActionsContainer) -> None:
    """Declare what a detector is, and how it looks; `--frames` and `--events` are the command's own."""
    add = parser.add_argument
    add(
        "--detector-frames",
        default="auto",
        metavar="NAME|FILE.onnx",
        help="detector for frames: auto (default; the detector on this machine that fits the first "
        "seconds best), motion (whatever moves in front of a fixed camera), or a network's name "
        "(`jeat-graph detectors`) or file",
    )
    add(
        "--detector-events",
        default="motion",
        metavar="NAME|FILE.onnx",
        help="detector for events: motion (default), or a network's name or file",
    )
    add(
        "--detector-fused",
        metavar="NAME|FILE.onnx",
        help="one network for frames and events of the same pixels (`train fused`), instead of the "
        "other two; either input may be missing",
    )
    add_detector_options(parser)
    add_frame_times(parser)
    add(
        "--event-rate",
        type=positive,
        metavar="HZ",
        help="event scans per second (default: 50; 20 for networks of events beside frames and "
        "networks of both)",
    )
    add_event_layout(parser)
    add(
        "--event-delay",
        type=finite,
        default=0.0,
        metavar="S",
        help="seconds to add to the events' times, to match the clock of the frames (default: 0)",
    )


def add_frame_times(parser: argparse._ActionsContainer) -> None:
    """Declare that the events' triggers may say when the frames were taken."""
    parser.add_argument(
        "--frame-times",
        metavar="triggers[:CHANNEL][:fall]",
        help="take the frames' times from the rising (or falling) edges of a trigger in --events, one "
        "per frame: triggers (the only channel with as many edges as frames), triggers:0, "
        "triggers:0:fall; `events info` counts the edges (default: the times that the frames "
        "have)",
    )


def frame_times(args: argparse.Namespace) -> TriggerChoice | None:
    """Return which triggers say when frames were taken, or None.

    Raises:
        ConfigError: nothing that can say it.
    """
    from jeat_graph.io.events.trigger_times import trigger_choice

    return None if args.frame_times is None else trigger_choice(args.frame_times)


def add_detector_options(parser: argparse._ActionsContainer) -> None:
    """Declare how detectors look."""
    add = parser.add_argument
    add(
        "--embedder",
        metavar="colour|FILE.onnx",
        help="describe each box in the frames by a vector, which tells vehicles apart: colour (colours and "
        "shape, no network), or a network that makes a vector of a crop",
    )
    add(
        "--detection-config",
        metavar="FILE",
        help="YAML with settings of the detectors (sections frames, events, model_frames, model_events, "
        "model_fused, camera, embedder)",
    )
    add(
        "--detection-set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change one of these settings, for example model_frames.layout=yolov8, or "
        "camera.follow=false to ignore the camera's own motion; may be repeated",
    )
    add(
        "--mask",
        dest="masks",
        action="append",
        default=[],
        metavar="FILE.yaml|X1,Y1,X2,Y2,…",
        help="leave out boxes that lie mostly in a polygon (px), given by its corners or by a file "
        "with `masks: {name: [[x, y], …]}`; may be repeated; none: do not even mask a burnt-in "
        "clock",
    )


def add_event_layout(parser: argparse._ActionsContainer, *names_of_size: str) -> None:
    """Declare what a file of events may leave open: size, columns, unit of time, which of several recordings.

    Args:
        parser: of a command.
        names_of_size: what the command calls `--event-size` besides.
    """
    add = parser.add_argument
    add(
        "--event-size",
        *names_of_size,
        type=picture_size,
        metavar="WxH",
        help="size of the events' picture in px, if the file does not give it; never smaller than in "
        "the file",
    )
    add(
        "--event-columns",
        metavar="t,x,y,p",
        help="meaning of the columns in a table of events, if neither names nor data show it (- skips "
        "a column)",
    )
    add(
        "--event-time-unit",
        choices=UNITS,
        help="unit of the times in a table of events, if neither names nor data show it",
    )
    add(
        "--event-stream",
        metavar="NAME",
        help="which recording to read, if a file holds several: topic of a bag, group of HDF5, file "
        "of an archive",
    )
    add(
        "--event-clock",
        choices=CLOCKS,
        help="times of a bag's events: sensor (default) follows the camera's own clock from the first "
        "message's stamp on, header follows the stamps in the headers of all messages; `events "
        "info` shows both",
    )


def event_layout(args: argparse.Namespace) -> EventLayout:
    """Return what the arguments say of a file of events.

    Raises:
        ConfigError: columns that are none.
    """
    from jeat_graph.io.events.layout import EventLayout

    columns = args.event_columns
    return EventLayout(
        columns=None if columns is None else tuple(name.strip() for name in columns.split(",")),
        time_unit=args.event_time_unit,
        stream=args.event_stream,
        clock=args.event_clock,
    )


def add_made_by(parser: argparse.ArgumentParser) -> None:
    """Declare which networks made the boxes that come in (`made_by`)."""
    for name, sensor in (("frames", "rgb"), ("events", "evt"), ("fused", "fused")):
        parser.add_argument(
            f"--detector-{name}",
            metavar="NAME|FILE.onnx",
            help=f"the network that makes the boxes of {sensor}; the tracker reads the file beside it",
        )


def made_by(args: argparse.Namespace, say: Callable[[str], object]) -> list[str]:
    """Return what is declared to the configuration `default` of networks whose boxes come from elsewhere.

    Raises:
        ConfigError: a network that is not known, one of which nothing is known, or another configuration.
    """
    options = {"rgb": "frames", "evt": "events", "fused": "fused"}
    given = {sensor: getattr(args, f"detector_{option}") for sensor, option in options.items()}
    networks = {sensor: one for sensor, one in given.items() if one is not None and one not in _NO_NETWORK}
    if not networks:
        return []
    from jeat_graph.data.errors import ConfigError
    from jeat_graph.detection.declared import known_of_networks
    from jeat_graph.io.tables.sensor_columns import as_settings

    named = ", ".join(f"--detector-{options[sensor]}" for sensor in networks)
    if args.config != DEFAULT:
        raise ConfigError(f"{named} tells the configuration `default` of boxes; {args.config} says it itself")
    known = known_of_networks(networks, say)
    if all(keys.keys() <= {"kind"} for keys in known.values()):
        raise ConfigError(f"{named}: nothing beside the network tells what its boxes are like")
    return as_settings(known)


def _without_input(args: argparse.Namespace) -> list[tuple[str, str]]:
    """Options that were given for an input that was not, each with that input's option.

    None where there is no input at all, which is the greater mistake, nor for a fused network, which takes
    either input for both.
    """
    if args.detector_fused is not None or (args.frames is None and args.events is None):
        return []
    given = {
        "--embedder": ("--frames", args.frames, args.embedder is not None),
        "--detector-frames": ("--frames", args.frames, args.detector_frames not in _NO_NETWORK),
        "--detector-events": ("--events", args.events, args.detector_events != "motion"),
        "--event-rate": ("--events", args.events, args.event_rate is not None),
        "--event-size": ("--events", args.events, args.event_size is not None),
        "--event-columns": ("--events", args.events, args.event_columns is not None),
        "--event-time-unit": ("--events", args.events, args.event_time_unit is not None),
        "--event-stream": ("--events", args.events, args.event_stream is not None),
        "--event-clock": ("--events", args.events, args.event_clock is not None),
        "--frame-times": ("--events", args.events, args.frame_times is not None),
        "--event-delay": ("--events", args.events, args.event_delay != 0.0),
    }
    return [(name, source) for name, (source, file, is_given) in given.items() if is_given and file is None]


def _given(args: argparse.Namespace) -> list[str]:
    return [source for source in (args.frames, args.events) if source is not None]


def _with_detector_options(
    settings: DetectionSettings, classes: tuple[str, ...], args: argparse.Namespace
) -> DetectionSettings:
    """Return the settings with `--class` for each network that looks.

    Raises:
        ConfigError: no network looks, or a list of settings names classes, too.
    """
    from dataclasses import replace

    from jeat_graph.data.errors import ConfigError

    choices = {
        "model_frames": args.frames is not None and args.detector_frames != "motion",
        "model_events": args.events is not None and args.detector_events != "motion",
        "model_fused": args.detector_fused is not None,
    }
    if not any(choices.values()):
        raise ConfigError("--class: what moves has no class; a network knows some (--detector-frames)")
    named = [name for name, does in choices.items() if does]
    if any(getattr(settings, name).classes for name in named):
        raise ConfigError(f"--class and {named[0]}.classes say the same twice: leave one out")
    chosen = {name: replace(getattr(settings, name), classes=classes) for name in named}
    return replace(settings, **chosen)


def detect_request(args: argparse.Namespace) -> DetectRequest:
    """Return what the arguments ask for.

    Raises:
        ConfigError: settings that are not valid, nothing to detect in, or an option of an input that is not
            there.
    """
    from dataclasses import replace

    from jeat_graph.data.errors import ConfigError
    from jeat_graph.detection.masks import read_masks
    from jeat_graph.detection.request import DetectRequest
    from jeat_graph.detection.settings import load_settings
    from jeat_graph.io.files.addresses import is_live

    if args.duration is not None and not any(map(is_live, _given(args))):
        raise ConfigError("--duration is of cameras that are on; a recording is read to its end")
    for option, source in _without_input(args):
        raise ConfigError(f"{option} says nothing without {source}: give both, or leave it out")
    if _NO_MASK in args.masks and len(args.masks) > 1:
        raise ConfigError("--mask none goes with no other --mask")
    settings = load_settings(args.detection_config, args.detection_set)
    if args.classes is not None:
        settings = _with_detector_options(settings, tuple(args.classes), args)
    if args.event_rate is not None:
        try:
            settings = replace(settings, events=replace(settings.events, rate_hz=args.event_rate))
        except ConfigError as error:
            raise ConfigError(f"--event-rate: {error}") from None
    return DetectRequest(
        frames=args.frames,
        events=args.events,
        detector_frames=args.detector_frames,
        detector_events=args.detector_events,
        detector_fused=args.detector_fused,
        embedder=args.embedder,
        rate_hz=args.rate,
        frame_times=frame_times(args),
        event_size_px=args.event_size,
        event_layout=event_layout(args),
        events_later_s=args.event_delay,
        settings=settings,
        masks=read_masks([text for text in args.masks if text != _NO_MASK]),
        find_clock=_NO_MASK not in args.masks,
        duration_s=args.duration,
    )
