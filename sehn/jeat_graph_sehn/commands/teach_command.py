"""`jeat-graph teach`: a detector learns from the tracks of its own road."""

from __future__ import annotations

import argparse
import shutil
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.cli.options import add_config, add_settings
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import counting, finite, natural, not_negative, picture_size, share
from jeat_graph.data.errors import ConfigError

if TYPE_CHECKING:
    from jeat_graph_sehn.teaching.lesson import Lesson
    from jeat_graph_sehn.teaching.recordings import EventRecording

WRITES = ("out",)
HELP = (
    "fine-tune a network on the tracks of its own road, without labels by hand; or write them as a data set"
)
#: Names that `detect` gives to its sensors.
_FRAMES_SENSOR, _EVENTS_SENSOR = "rgb", "evt"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add(
        "data",
        nargs="+",
        metavar="DATA",
        help="detections of a minute or more of traffic, by all sensors of the scene: files as for `track`, "
        "or the run directory that `track --frames … --events …` wrote",
    )
    learner = parser.add_mutually_exclusive_group(required=True)
    learner.add_argument(
        "--events", metavar="FILE", help="the events of the same time: a network of events learns"
    )
    learner.add_argument(
        "--frames", metavar="VIDEO|DIR", help="the pictures of the same time: a network of pictures learns"
    )
    add("--detector", metavar="NAME|FILE", help="the network that learns, one of `train` (such as sehn)")
    add("--out", metavar="FILE.onnx", help="the taught network; written only if it gained")
    add(
        "--dataset",
        nargs=2,
        metavar=("coco|yolo|dsec", "DIR"),
        help="instead of teaching, write pictures (coco, yolo) or events (dsec) with the labels, for "
        "networks that other programs train; needs no PyTorch",
    )
    add("--rig", metavar="RIG.yaml", help="pictures and clocks of the sensors, as `register` wrote them")
    add(
        "--sensor",
        metavar="NAME",
        help=f"name of the sensor that learns, in DATA and rig (default {_EVENTS_SENSOR} with --events, "
        f"{_FRAMES_SENSOR} with --frames)",
    )
    add(
        "--from",
        dest="teachers",
        nargs="+",
        default=[],
        metavar="NAME",
        help="sensors whose detections are tracked to learn from (default: all in DATA)",
    )
    add(
        "--held-back",
        type=share,
        default=0.25,
        metavar="SHARE",
        help="the last part of the recording, which is not learned from but judged by (default 0.25)",
    )
    add(
        "--event-size",
        type=picture_size,
        metavar="WxH",
        help="picture of the events, if the file does not say",
    )
    add(
        "--event-delay",
        type=finite,
        metavar="S",
        help="seconds that the times of DATA are later than those in --events (default: found out)",
    )
    add("--steps", type=counting, default=300, metavar="N", help="steps of the training (default 300)")
    add(
        "--old",
        nargs="+",
        default=[],
        metavar="DIR",
        help="data sets of what the network has learned before, against forgetting, as of `simulate "
        "--sensors pictures` (default: a few worlds are rendered first, which takes minutes)",
    )
    add(
        "--old-share",
        type=not_negative,
        default=0.3,
        metavar="SHARE",
        help="share of what is shown that is of them (default 0.3); 0: neither show nor judge any",
    )
    add(
        "--least-gain",
        type=finite,
        default=1.0,
        metavar="POINTS",
        help="AP50 that must be gained on the held-back part, or nothing is written (default 1)",
    )
    add(
        "--most-lost",
        type=finite,
        default=1.0,
        metavar="POINTS",
        help="AP50 that may be lost on old worlds, or nothing is written (default 1)",
    )
    add("--seed", type=natural, default=0, metavar="N", help="seed (default 0)")
    add("--threads", type=counting, metavar="N", help="threads of PyTorch (default: its own choice)")
    add_config(parser, settings=False)
    add_settings(parser, "learning_rate=0.0002, or tracker.sensors.evt.latency_s=0.01 for the tracker")


def run(args: argparse.Namespace) -> int:
    """Teach, or write a data set; 1 where nothing was gained."""
    _check(args)
    cache = Path(args.out or args.dataset[1]).with_suffix(".teaching")
    try:
        code = _run(args, cache)
    except Exception:  # who interrupts it may go on later, with what is there
        shutil.rmtree(cache, ignore_errors=True)
        raise
    shutil.rmtree(cache, ignore_errors=True)
    return code


def _check(args: argparse.Namespace) -> None:
    """Refuse what does not go together, before anything takes time."""
    if not 0.0 < args.held_back < 1.0:
        raise ConfigError("--held-back: must be more than 0 and less than 1")
    if args.old_share >= 1.0:
        raise ConfigError("--old-share: must be less than 1")
    if args.dataset is not None:
        from jeat_graph_sehn.teaching.exported_sets import check_layout

        check_layout(args.dataset[0], args.frames is not None)
        if args.out or args.detector:
            raise ConfigError("--dataset writes labels and teaches nobody: leave --out and --detector out")
        return
    if args.detector is None or args.out is None:
        raise ConfigError("--detector NAME|FILE and --out FILE.onnx are needed (or --dataset LAYOUT DIR)")
    if Path(args.out).suffix.lower() != ".onnx":
        raise ConfigError(f"--out: {args.out} must end in .onnx")
    try:
        import onnx  # noqa: F401
        import torch
    except ImportError:
        raise ConfigError(
            "teaching needs PyTorch: pip install './sehn[train]' in a checkout (--dataset needs none)"
        ) from None
    if args.threads:
        torch.set_num_threads(args.threads)
    from jeat_graph.io.files.atomic import check_writable

    check_writable(Path(args.out))


def _run(args: argparse.Namespace, cache: Path) -> int:
    start = None if args.dataset else _start(args)
    tracker, training = _changes(args.overrides)
    events, size_px = _recording(args, cache)
    lesson = _lesson(args, events, size_px, tracker)
    for line in lesson.described():
        say("teach", line)
    if args.dataset:
        return _write_set(args, lesson, events)
    from jeat_graph_sehn.teaching.learning_from import TeachRequest, teach, write_taught

    assert start is not None
    request = TeachRequest(
        lesson=lesson,
        start=start,
        out=Path(args.out),
        cache=cache,
        events=events,
        video=Path(args.frames) if args.frames else None,
        old=_old(args, cache),
        about=_about(args, lesson),
        overrides=training,
        steps=args.steps,
        old_share=args.old_share,
        seed=args.seed,
    )
    from tqdm import tqdm

    form = "{desc} {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}]"
    hidden = not sys.stderr.isatty()
    with tqdm(total=1.0, desc="teach", bar_format=form, disable=hidden, leave=False) as bar:
        done = teach(request, partial(say, "teach"), lambda part, _: bar.update(part - bar.n))
    for line in done.outcome.described():
        print(line)
    request.out.with_suffix(".checkpoint").unlink(missing_ok=True)
    why = done.outcome.refusal(args.least_gain, args.most_lost)
    if why is not None:
        say("teach", f"nothing is written: {why}")
        return 1
    write_taught(done, request)
    print(f"wrote {request.out}")
    return 0


def _start(args: argparse.Namespace) -> Path:
    """Return the file of the network that learns.

    Raises:
        ConfigError: there is none of that name, or it cannot learn.
        DataError: `train` did not make it.
    """
    from jeat_graph.data.errors import DataError
    from jeat_graph.detection.named import AUTO, MOTION, network_file
    from jeat_graph_sehn.teaching.learning_from import check_teachable

    kind = "events" if args.events else "frames"
    if args.detector in (AUTO, MOTION):
        raise ConfigError(f"--detector: {args.detector} has no weights that could learn: name a network")
    path = network_file(args.detector, kind)
    try:
        check_teachable(path, kind)
    except DataError as error:
        layout = "dsec" if args.events else "coco"
        raise DataError(
            f"{error.message}, so it cannot be taught here: `--dataset {layout} DIR` writes the labels for "
            "the program that trains it",
            path,
        ) from None
    return path


def _changes(overrides: list[str]) -> tuple[list[str], dict[str, Any]]:
    """Part `--set tracker.KEY=VALUE`, for the tracker, from changes to the training."""
    from jeat_graph.config.section_tree import tree_of_changes

    mark = "tracker."
    tracker = [text.removeprefix(mark) for text in overrides if text.startswith(mark)]
    return tracker, tree_of_changes([text for text in overrides if not text.startswith(mark)])


def _recording(args: argparse.Namespace, cache: Path) -> tuple[EventRecording | None, tuple[int, int]]:
    """Return the events, or None for pictures, and width and height (px)."""
    if args.events:
        from jeat_graph_sehn.teaching.recordings import open_recording

        found = open_recording(Path(args.events), cache, args.event_size, partial(say, "teach"))
        return found, found.size_px
    from jeat_graph.io.media.video import open_frames

    with open_frames(Path(args.frames)) as frames:
        return None, frames.size_px


def _lesson(
    args: argparse.Namespace, events: EventRecording | None, size_px: tuple[int, int], tracker: list[str]
) -> Lesson:
    from jeat_graph_sehn.teaching.lesson import LessonRequest, make_lesson

    request = LessonRequest(
        data=tuple(Path(path) for path in args.data),
        sensor=args.sensor or (_EVENTS_SENSOR if args.events else _FRAMES_SENSOR),
        size_px=size_px,
        config=args.config,
        overrides=tuple(tracker),
        rig=Path(args.rig) if args.rig else None,
        teachers=tuple(args.teachers),
        held_share=args.held_back,
        later_s=args.event_delay,
        events=events,
    )
    return make_lesson(request, partial(say, "teach"))


def _write_set(args: argparse.Namespace, lesson: Lesson, events: EventRecording | None) -> int:
    from jeat_graph_sehn.teaching.exported_sets import SetRequest, write_set

    layout, out = args.dataset[0], Path(args.dataset[1])
    video = Path(args.frames) if args.frames else None
    written = write_set(lesson, SetRequest(layout, out, video, events))
    print(f"wrote {out}: {written.learned} boxes to train on, {written.judged} held back")
    return 0


def _old(args: argparse.Namespace, cache: Path) -> tuple[Path, ...]:
    """Return data sets of old worlds, rendered if none are given."""
    if args.old_share <= 0.0:
        return ()
    if args.old:
        return tuple(Path(path) for path in args.old)
    from tqdm import tqdm

    from jeat_graph_sehn.teaching.old_worlds import old_frames, render_old_worlds

    say("teach", "renders a few old worlds, so that they are not forgotten (--old DIR takes what is there)")
    hidden = not sys.stderr.isatty()
    with tqdm(total=old_frames(), desc="render", unit=" frames", disable=hidden, leave=False) as bar:
        return tuple(render_old_worlds(cache, args.events is not None, args.seed, bar.update))


def _about(args: argparse.Namespace, lesson: Lesson) -> dict[str, Any]:
    """Return what the network's card says of the recording."""
    from jeat_graph.io.files.hashing import sha256_of

    files = [Path(path) for path in args.data]
    files = [path / "detections.csv" if path.is_dir() else path for path in files]
    return {
        "detections": [{"name": path.name, "sha256": sha256_of(path)} for path in files],
        "recording": Path(args.events or args.frames).name,
        "teachers": list(lesson.teachers),
        "judges": list(lesson.judges),
        "own_judge": lesson.own_judge,
        "learned_s": [round(t, 3) for t in lesson.division.learned],
        "held_back_s": [round(t, 3) for t in lesson.division.judged],
        "vehicles": [len(labels.asked_objects()) for labels in lesson.parts],
    }
