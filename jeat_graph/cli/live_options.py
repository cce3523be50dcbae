"""Options of the commands that look at cameras which are on now, and how they end."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from jeat_graph.cli.detect_options import DEFAULT, add_detector_options
from jeat_graph.config.argument_types import positive
from jeat_graph.io.event_cameras.registry import address_forms

if TYPE_CHECKING:
    from jeat_graph.detection.live_detecting import LiveDetecting
    from jeat_graph.detection.request import DetectRequest

#: What `--frames` and `--events` may name beside files, for help.
CAMERAS = "rtsp:// or http:// address, /dev/video0 or 0"
EVENT_CAMERAS = address_forms()


def add_duration(parser: argparse._ActionsContainer) -> None:
    """Declare `--duration`."""
    parser.add_argument(
        "--duration",
        type=positive,
        metavar="S",
        help="how long to record a live camera, in seconds from its first picture, for which it has as long "
        "and ten seconds at least (default: until Ctrl-C)",
    )


def add_cameras(parser: argparse.ArgumentParser) -> None:
    """Declare the cameras that `stream` looks at by itself, and how."""
    group = parser.add_argument_group(
        "live cameras",
        "Detect in live cameras, with --detector-frames (default: auto) and --detector-events "
        "(default: motion), instead of reading scans. Times are seconds since 1970.",
    )
    add = group.add_argument
    add("--frames", metavar="CAMERA", help=f"a frame camera: {CAMERAS}")
    add("--events", metavar="CAMERA", help=f"an event camera: {EVENT_CAMERAS}")
    add_duration(group)
    add_detector_options(group)


def opened_cameras(
    args: argparse.Namespace, stack: ExitStack, say: Callable[[str], object]
) -> LiveDetecting | None:
    """Open the cameras and wait until they have given something; None if scans come from elsewhere.

    Args:
        args: of `stream`.
        stack: closes them.
        say: called with each thing that was found out.
    """
    request = stream_request(args)
    if request is None:
        return None
    from jeat_graph.detection.live_detecting import LiveDetecting

    cameras = stack.enter_context(LiveDetecting(request, say))
    cameras.prepare()
    return cameras


def camera_settings(
    args: argparse.Namespace, cameras: LiveDetecting, say: Callable[[str], object]
) -> list[str]:
    """Return what is declared of the detectors, and of the picture unless `--image` says it."""
    from jeat_graph.cli.options import image_overrides
    from jeat_graph.detection.declared import declared_settings

    declared = declared_settings(cameras.request, say) if args.config == DEFAULT else []
    size_px = cameras.size_px if args.rig is None and args.image is None else None
    return [*declared, *image_overrides(size_px)]


def stream_request(args: argparse.Namespace) -> DetectRequest | None:
    """Return what `stream` is to look at by itself; None where scans come from elsewhere.

    Raises:
        ConfigError: files, both cameras and a source, or options of cameras without one.
    """
    from jeat_graph.data.errors import ConfigError
    from jeat_graph.detection.live_detecting import is_live_request

    if args.frames is None and args.events is None:
        for option in ("duration", "detection_config"):
            if getattr(args, option) is not None:
                name = option.replace("_", "-")
                raise ConfigError(f"--{name} is of a camera that is on: it needs --frames or --events")
        if args.masks or args.detection_set or args.embedder:
            raise ConfigError(
                "--mask, --detection-set and --embedder are of a camera that is on: they need --frames"
            )
        return None
    if args.source is not None:
        raise ConfigError("--source brings scans from elsewhere: leave it out, or --frames and --events")
    request = _detect_request(args)
    if not is_live_request(request):
        raise ConfigError("--frames and --events of `stream` are cameras that are on; `track` takes files")
    return request


def _detect_request(args: argparse.Namespace) -> DetectRequest:
    from jeat_graph.cli.detect_options import detect_request

    of_files = (
        "event_size",
        "event_columns",
        "event_time_unit",
        "event_stream",
        "event_clock",
        "frame_times",
    )
    without: dict[str, None] = dict.fromkeys(of_files)
    others = {"event_rate": None, "event_delay": 0.0, "rate": None}
    detectors = {
        "detector_frames": args.detector_frames or "auto",
        "detector_events": args.detector_events or "motion",
    }
    return detect_request(argparse.Namespace(**{**vars(args), **without, **others, **detectors}))


@contextmanager
def until_interrupted() -> Iterator[Callable[[], bool]]:
    """Let Ctrl-C be the ordinary end of what goes on within: what was found is kept.

    Yields:
        What tells whether to end.
    """
    from jeat_graph.live.interrupts import Interrupts

    with Interrupts() as interrupts:
        yield lambda: interrupts.seen is not None
