"""`jeat-graph track`: detections in, a run directory out."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.cli.detect_options import DEFAULT, add_detecting, detect_request, made_by
from jeat_graph.cli.live_options import CAMERAS, EVENT_CAMERAS, add_duration, until_interrupted
from jeat_graph.cli.options import (
    add_config,
    add_formats,
    add_image,
    add_output_rate,
    add_reading,
    add_rig,
    add_smoother,
    extra_formats,
    overrides,
)
from jeat_graph.cli.terminal import say, warn
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.config.schema import Config
    from jeat_graph.detection.before_tracking import DetectedFile
    from jeat_graph.detection.request import DetectRequest
    from jeat_graph.road.camera import RoadCamera

HELP = (
    "track vehicles in files of detections, or in raw frames and events, and write a run "
    "directory with causal.csv and smoothed.csv"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add(
        "detections",
        nargs="*",
        metavar="DETECTIONS",
        help="files of one scene, for example one per sensor: CSV or Parquet with t, sensor, left, "
        "top, width, height, score; MOTChallenge det.txt; KITTI; Prophesee or DSEC .npy; COCO; a "
        "folder of YOLO's labels. NAME=path names a sensor",
    )
    add(
        "--out",
        required=True,
        metavar="DIR",
        help="run directory; replaces the files of an earlier run there, keeps all other files",
    )
    add_config(parser)
    add_image(parser)
    add_rig(parser)
    add_smoother(parser)
    add_formats(parser)
    add_output_rate(parser, "frames per second of output formats that count frames", "--frame-rate")
    add_reading(parser)
    add(
        "--resume",
        action="store_true",
        help="continue an interrupted run of the same command into the same folder",
    )
    add(
        "--frames",
        metavar="VIDEO|DIR|AEDAT4|CAMERA",
        help="with DETECTIONS: the pictures that they were made from, for their size and frame rate; "
        f"without: the pictures to detect in, or a live camera ({CAMERAS})",
    )
    add(
        "--camera",
        metavar="CAMERA.yaml",
        help="a calibrated camera over the road, which also says the picture's size: write road_causal.csv "
        "and road_smoothed.csv (m, km/h) too, and the tables of --diagnostics",
    )
    add(
        "--identities",
        metavar="FILE",
        help="tracks that you have corrected, in place of identities that are decided "
        "(smoother.identities): a table with t (s), track_id, left, top, width, height, such as an edited "
        "smoothed.csv, or what CVAT exports as MOT 1.1; smoothed.csv follows them, and disagreements.csv "
        "says where the model disagrees",
    )
    raw = parser.add_argument_group(
        "raw recordings",
        "Without DETECTIONS, vehicles are detected in --frames, --events or both, and tracked; "
        "detections.csv in the run directory holds the detections. With DETECTIONS, "
        "--detector-frames, --detector-events and --detector-fused name the networks that made "
        "the boxes of the sensors rgb, evt and fused.",
    )
    raw.add_argument(
        "--events",
        metavar="FILE|CAMERA",
        help=f"events to detect in: a file that `events info` reads, or a live camera ({EVENT_CAMERAS})",
    )
    add_duration(raw)
    add_detecting(raw)


def run(args: argparse.Namespace) -> int:
    """Read, check, track, and write the run directory."""
    if args.detections and args.duration is not None:
        raise DataError("--duration is of cameras that are on; DETECTIONS are read to their end")
    if args.detections and args.events is not None:
        raise DataError("--events is detected in where no DETECTIONS are given; give one or the other")
    if args.detections and args.frame_times is not None:
        raise DataError("--frame-times is of frames to detect in; DETECTIONS have their own times")
    if args.detections and args.embedder is not None:
        raise DataError(
            "--embedder is of frames to detect in; DETECTIONS have embeddings of their own or none"
        )
    from jeat_graph.io.files.addresses import is_live
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.runs.run_options import RunOptions
    from jeat_graph.runs.track_files import TrackRequest, track_files

    camera = None if args.camera is None else read_camera(args.camera)
    detections = tuple(str(item) for item in args.detections)
    detectors: tuple[str, ...] = ()
    if detections:
        declared = tuple(made_by(args, _say))
    else:
        found = _detected(args)
        detections, declared, detectors = (found.path,), (), found.detectors
        if args.frames is not None and is_live(args.frames):
            args.frames = None  # there is nothing more to be learnt of it
        args.classes = None  # the networks have looked for no others
    if camera is not None:
        _take_picture_of(camera, args)
    request = TrackRequest(
        detections=detections,
        out=args.out,
        config=args.config,
        overrides=(*declared, *overrides(args)),
        rate_hz=args.rate,
        input_format=args.input_format,
        score_scale=args.score_scale,
        images=args.images,
        time_unit=args.time_unit,
        classes=None if args.classes is None else tuple(args.classes),
        first_frame=args.first_frame,
        video=args.only_video,
        class_names=args.class_names,
        frames=args.frames,
        rig=args.rig,
        identities=args.identities,
        detectors=detectors,
        options=RunOptions(
            formats=extra_formats(args),
            frame_rate_hz=args.output_rate if args.output_rate is not None else args.rate,
            progress=sys.stderr.isatty(),
            diagnostics=args.diagnostics or args.camera is not None,
            after=None if camera is None else _road_tables(camera),
            resume=args.resume,
        ),
    )
    counts = track_files(request, _warn, _say).counts
    print(f"{counts['scans']} scans, {counts['detections']} detections: {counts['tracks_reported']} tracks")
    if args.identities is not None:
        print(f"{counts['disagreements']} rows of {args.identities} lie off the model by more than 3 sigma")
    print(f"wrote {Path(args.out)}")
    return 0


def _detected(args: argparse.Namespace) -> DetectedFile:
    """Detect in raw recordings; the file of detections lies in the run directory."""
    from jeat_graph.cli.detect_command import detect_with_bar
    from jeat_graph.detection.before_tracking import DETECTIONS, detect_before
    from jeat_graph.detection.live_detecting import is_live_request
    from jeat_graph.io.files.atomic import check_writable
    from jeat_graph.io.files.outputs import check_folder

    if args.frames is None and args.events is None:
        raise DataError("nothing to track: give files of detections, or --frames, --events or both")
    for name in ("input_format", "images"):
        if getattr(args, name) is not None:
            raise DataError(f"--{name.replace('_', '-')} is for files of detections; there is none")
    out = Path(args.out)
    check_folder(out)
    check_writable(out / DETECTIONS)
    request = replace(detect_request(args), one_picture=not _have_own_pictures(args))
    if is_live_request(request):
        return _detected_live(args, request, out)
    if args.image is not None and args.frames is not None:
        _check_image(args.image, args.frames)
    # Another configuration, a preset or the user's own, says itself what its sensors are.
    found = detect_before(
        request,
        out,
        declare=args.config == DEFAULT,
        say=_say,
        detect=lambda asked: detect_with_bar(asked, "track"),
    )
    args.image = args.image or (None if args.rig is not None else found.image)
    return found


def _detected_live(args: argparse.Namespace, request: DetectRequest, out: Path) -> DetectedFile:
    """Detect in cameras that are on until Ctrl-C, or as long as is asked for."""
    from jeat_graph.detection.before_tracking import detect_live_before

    with until_interrupted() as until:
        found = detect_live_before(request, out, declare=args.config == DEFAULT, say=_say, until=until)
    if args.image is not None and args.image != found.image:
        raise DataError(f"--image says {args.image}, but the pictures have {found.image}")
    args.image = None if args.rig is not None else found.image
    return found


def _have_own_pictures(args: argparse.Namespace) -> bool:
    """Whether the configuration says how the pictures of both cameras lie to each other."""
    from jeat_graph.config.reading import load_config
    from jeat_graph.detection.detecting import EVENTS_SENSOR, FRAMES_SENSOR

    sensors = load_config(args.config, overrides(args), args.rig).sensors
    return any(name in sensors and sensors[name].image is not None for name in (FRAMES_SENSOR, EVENTS_SENSOR))


def _check_image(image: tuple[int, int], frames: str) -> None:
    """Refuse a size that is not that of the pictures to detect in: what is found there is in their pixels."""
    from jeat_graph.io.media.video import peek

    (width, height), _ = peek(frames)
    if image != (width, height):
        raise DataError(f"has {width} x {height} px, not the {image[0]} x {image[1]} of --image", frames)


def _take_picture_of(camera: RoadCamera, args: argparse.Namespace) -> None:
    """Take the picture's size from the camera's file where nothing else says it.

    Raises:
        DataError: the picture is declared with another size, so that the camera is not that of its boxes.
    """
    from jeat_graph.config.reading import load_config

    config = load_config(args.config, overrides(args), args.rig)
    size = camera.width, camera.height
    if config.input.picture != "given":
        _say(f"picture of {size[0]} x {size[1]} px, as {args.camera} says")
        args.image = size
    elif size != (config.image.width, config.image.height):
        picture = f"{config.image.width:g} x {config.image.height:g}"
        raise DataError(f"is of a picture of {size[0]} x {size[1]} px, not of {picture}", args.camera)


def _road_tables(camera: RoadCamera) -> Callable[[Path, Config], None]:
    def write(folder: Path, config: Config) -> None:
        from jeat_graph.road.run_tables import write_run_tables

        write_run_tables(folder, config, camera)

    return write


_say, _warn = partial(say, "track"), partial(warn, "track")
