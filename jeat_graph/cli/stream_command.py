"""`jeat-graph stream`: scans in as they come, from stdin or a broker, tracks out at once."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.cli.detect_options import add_made_by, made_by
from jeat_graph.cli.live_options import add_cameras, camera_settings, opened_cameras
from jeat_graph.cli.options import (
    add_columns,
    add_config,
    add_counting,
    add_image,
    add_rig,
    columns_read,
    overrides,
)
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import positive

if TYPE_CHECKING:
    from jeat_graph.config.schema import Config
    from jeat_graph.data.errors import DataError
    from jeat_graph.data.trajectories import Trajectories
    from jeat_graph.detection.live_detecting import LiveDetecting
    from jeat_graph.io.streams.stream_reading import StreamReading
    from jeat_graph.live.interrupts import Interrupts
    from jeat_graph.live.late import LiveTracker
    from jeat_graph.live.messages import ScanMessage
    from jeat_graph.live.session import Session
    from jeat_graph.live.transport.brokers.record import Sink, Source

#: Written for hours: none of them is shared with another command.
WRITES = ("checkpoint", "smoothed", "road", "record")
HELP = "track scans as they arrive on stdin, from a broker or from live cameras, and answer each one at once"
STDIN = "<stdin>"
_EVERY_S = 10.0
_say = partial(say, "stream")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.description = HELP + (
        '. A scan is {"t": 0.05, "sensor": "rgb", "boxes": [[left, top, width, height], …], "scores": [s, …]}'
        ' on a line of its own. Without "scores" each score is 1. "classes": [name, …] or "class_id": '
        "[number, …] may follow. t is a number, a date or a time code. A list of scans of one time on one "
        "line is taken jointly. CSV input has a header and the columns of `track`; a scan is complete when "
        "another time, or an empty line, arrives."
    )
    add = parser.add_argument
    add_config(parser)
    add_image(parser)
    add_rig(parser)
    add_made_by(parser)
    add_cameras(parser)
    add(
        "--format",
        choices=("json", "csv"),
        default="json",
        help="output: one line of JSON per step, or the rows of causal.csv (default: json)",
    )
    add(
        "--source",
        metavar="URL",
        help="take scans from mqtt://, nats:// or kafka://host/topic, not stdin; with a login as in "
        "mqtt://user:${VARIABLE}@host/topic or mqtt://user@host/topic?password_file=FILE",
    )
    add("--sink", metavar="URL", help="send tracks to mqtt://, nats:// or kafka://host/topic, not stdout")
    add(
        "--encoding",
        choices=("json", "msgpack"),
        default="json",
        help="encoding of messages to --sink (default: json)",
    )
    add_counting(parser)
    add_columns(parser)
    add(
        "--joint",
        action="store_true",
        help="hold each scan back until a later time arrives, so that scans of one time on separate "
        "lines give one answer (with the engine `paper` also those within paper.pair_within_s)",
    )
    add(
        "--late",
        choices=("rewind", "skip", "refuse"),
        default="rewind",
        help="what to do with a scan that is older than the newest one: rewind puts it where it "
        "belongs (up to live.late_s), skip drops it, refuse ends with an error (default: rewind)",
    )
    add(
        "--on-error",
        choices=("stop", "skip"),
        default="stop",
        help="what to do with a line that cannot be read: stop ends the run and keeps the smoothed "
        "rows, skip drops and counts the line (default: stop)",
    )
    add(
        "--smoothed",
        metavar="FILE",
        help="write the smoothed trajectories into this file, each row when it is final",
    )
    add("--camera", metavar="CAMERA.yaml", help="a calibrated camera over the road, for --road")
    add(
        "--road",
        metavar="FILE",
        help="write the vehicles' motion and size on the road (m, km/h) into this file, each row when "
        "it is final, smoother.lag_s later; needs --late skip or refuse",
    )
    add(
        "--checkpoint",
        metavar="FILE",
        help="save the state in this file and continue from it, if it exists; input that was already "
        "taken may be repeated",
    )
    add("--every", type=positive, metavar="S", help=f"time between checkpoints (default: {_EVERY_S:g})")
    add(
        "--record", metavar="FILE", help="write counts, and how late scans came, as JSON when the stream ends"
    )


def run(args: argparse.Namespace) -> int:
    """Track until the input ends, the reader of the output goes away, or a signal comes."""
    _check_ends(args)
    with contextlib.ExitStack() as cameras:
        return _run(args, opened_cameras(args, cameras, _say))


def _run(args: argparse.Namespace, cameras: LiveDetecting | None) -> int:
    from jeat_graph.cli.stream_output import StreamOutput
    from jeat_graph.live.interrupts import Interrupts
    from jeat_graph.live.session import Ends, Session
    from jeat_graph.live.smoothed_file import SmoothedFile
    from jeat_graph.live.transport.patience import UnconfirmedError

    config = _config(args, cameras)
    config, within_s = _pairing(args, config, cameras)
    live, more = _tracker(args, config)
    with contextlib.ExitStack() as stack:
        interrupts = stack.enter_context(Interrupts())
        source, sink = _ends(args, stack, interrupts)
        smoothed = None
        if args.smoothed is not None:
            smoothed = stack.enter_context(
                SmoothedFile(
                    args.smoothed,
                    more.get("smoothed"),
                    interrupts.overdue,
                    identities=config.smoother.identities == "lag",
                )
            )
        output = StreamOutput(args.format, args.encoding, sink, interrupts.overdue)
        ends = Ends(
            tracks=_with_road(output.tracks, live, args, stack, interrupts),
            event=output.event,
            warn=_say,
            smoothed=smoothed,
            kept=lambda: {"seq": output.seq},
            flush=output.flush,
            commit=(lambda: None) if source is None else source.commit,
            too_large=(lambda: 0) if sink is None else lambda: sink.too_large,
        )
        session = Session(live, ends, args.checkpoint, args.every or _EVERY_S, more)
        output.seq = more.get("kept", {}).get("seq", 0)
        with contextlib.suppress(UnconfirmedError):  # after a signal; the session tells of it
            try:
                if cameras is not None:
                    _take_from_cameras(cameras, session, interrupts, args.on_error)
                else:
                    _take_all(session, args, interrupts, source, within_s)
                output.begin()  # an input without scans gives a table without rows
            finally:
                # An error in a line, a signal or a reader that has gone: what is known is kept all the same.
                _finish(session, args, cameras)
    if interrupts.seen is not None:
        _say("interrupted")
        return 128 + interrupts.seen
    return 0


def _check_ends(args: argparse.Namespace) -> None:
    """Refuse arguments that do not go together, before anything is opened."""
    from jeat_graph.data.errors import ConfigError
    from jeat_graph.live.transport.ends import check_addresses

    if args.every is not None and args.checkpoint is None:
        raise ConfigError("--every is the time between checkpoints: it needs --checkpoint FILE")
    if args.sink is not None and args.format == "csv":
        raise ConfigError("--format csv is for stdout; messages to --sink are JSON or MessagePack")
    check_addresses(args.source, args.sink)
    if (args.road is None) != (args.camera is None):
        raise ConfigError("--road and --camera go together: give both")
    if args.road is not None and args.late == "rewind":
        raise ConfigError("--road gives rows that stay: it needs --late skip or --late refuse")
    if args.road is not None and args.checkpoint is not None:
        raise ConfigError("--road does not go with --checkpoint, which does not hold its windows")


def _pairing(args: argparse.Namespace, config: Config, cameras: LiveDetecting | None) -> tuple[Config, float]:
    """Return the settings without pairing, and how far apart (s) scans may be that are given out together."""
    from dataclasses import replace

    from jeat_graph.data.errors import ConfigError

    if config.pair_within_s == 0.0:
        return config, 0.0
    if not args.joint or args.source is not None or cameras is not None:
        raise ConfigError("paper.pair_within_s holds scans of stdin back: it needs --joint")
    if any(sensor.latency_s for sensor in config.sensors.values()):
        raise ConfigError("paper.pair_within_s does not go with sensors.NAME.latency_s in a stream")
    return replace(config, paper=replace(config.paper, pair_within_s=0.0)), config.pair_within_s


def _config(args: argparse.Namespace, cameras: LiveDetecting | None) -> Config:
    from dataclasses import replace

    from jeat_graph.config.reading import load_config
    from jeat_graph.data.errors import ConfigError

    declared = made_by(args, _say) if cameras is None else camera_settings(args, cameras, _say)
    config = load_config(args.config, [*declared, *overrides(args)], args.rig)
    if args.smoothed is None:
        return replace(config, smoother=replace(config.smoother, engine="none"))
    if config.smoother.engine == "none":
        raise ConfigError("--smoothed needs a smoother, but smoother.engine is none")
    if config.smoother.identities == "whole":
        raise ConfigError("smoother.identities: 'whole' needs the whole recording, which a stream never has")
    return config


def _tracker(args: argparse.Namespace, config: Config) -> tuple[LiveTracker, dict[str, Any]]:
    """The tracker, new or from the checkpoint, and what was kept with it."""
    from jeat_graph.data.errors import ConfigError
    from jeat_graph.live.late import LiveTracker, check_saved
    from jeat_graph.tracking.tracker import Tracker

    tracker = Tracker(config, diagnostics=args.road is not None)
    if args.checkpoint is not None:
        check_saved(tracker, "--checkpoint")
    if args.checkpoint is not None and Path(args.checkpoint).is_file():
        live, more = LiveTracker.load(args.checkpoint, config)
        if live.policy != args.late:
            raise ConfigError(
                f"{args.checkpoint}: was saved with --late {live.policy}, not {args.late}; give the same, or "
                "start over without the file"
            )
        if live.time is not None:
            _say(f"goes on from {args.checkpoint}, t = {live.time:.6g}")
        return live, more
    return LiveTracker(tracker, args.late), {}


def _with_road(
    tracks: Callable[[float, Trajectories, ScanMessage, float], object],
    live: LiveTracker,
    args: argparse.Namespace,
    stack: contextlib.ExitStack,
    interrupts: Interrupts,
) -> Callable[[float, Trajectories, ScanMessage, float], object]:
    """Have each answer taken in by the vehicles' motion on the road too, if that is wanted."""
    if args.road is None:
        return tracks
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.lag_table import RoadFile, RoadLagTable

    table = RoadLagTable(read_camera(args.camera), live.tracker.config.smoother.lag_s)
    road = stack.enter_context(RoadFile(args.road, table, interrupts.overdue))

    def both(t: float, table: Trajectories, message: ScanMessage, late_s: float) -> None:
        tracks(t, table, message, late_s)
        for when, measured in live.measured:  # sensors of other delays are steps of their own
            if when <= t:
                road.take(when, measured, table.track_id)
        live.measured = [one for one in live.measured if one[0] > t]

    return both


def _ends(
    args: argparse.Namespace, stack: contextlib.ExitStack, interrupts: Interrupts
) -> tuple[Source | None, Sink | None]:
    from jeat_graph.live.transport.ends import open_sink, open_source

    source = None if args.source is None else open_source(args.source, interrupts.overdue, _say)
    if source is not None:
        stack.callback(source.close)
    sink = None if args.sink is None else open_sink(args.sink, interrupts.overdue, _say)
    if sink is not None:
        stack.callback(sink.close)
    return source, sink


def _take_all(
    session: Session,
    args: argparse.Namespace,
    interrupts: Interrupts,
    source: Source | None,
    within_s: float,
) -> None:
    from jeat_graph.data.tables.reading import Reading
    from jeat_graph.io.streams.stream_reading import StreamReading
    from jeat_graph.live.inputs import from_lines

    bad = _skip(session) if args.on_error == "skip" else None
    # What a broker keeps, or comes after a checkpoint, may be from the middle of a recording.
    goes_on = source is not None or args.checkpoint is not None
    how = StreamReading(Reading(**columns_read(args)), args.classes, goes_on=goes_on)
    try:
        if source is None:
            lines = interrupts.lines(sys.stdin.buffer)
            for message, place in from_lines(lines, STDIN, args.joint, bad, how, within_s):
                _take(session, message, place, bad)
        else:
            _take_from(source, session, interrupts, bad, how)
    finally:
        unseen = how.never_came()
        if unseen is not None:
            _say(f"warning: {unseen}")


def _take_from(
    source: Source,
    session: Session,
    interrupts: Interrupts,
    bad: Callable[[DataError], None] | None,
    how: StreamReading,
) -> None:
    """Take what a broker brings, until a signal comes."""
    from jeat_graph.live.inputs import from_source

    since = 0
    for item in from_source(source, str(source.address), interrupts, bad, how):
        if item is not None:
            since += 1
            message, place = item
            if message is not None:
                _take(session, message, place, bad)
        if session.save_in_turn(since, source.most_open, item is None):
            since = 0


def _take_from_cameras(
    cameras: LiveDetecting, session: Session, interrupts: Interrupts, on_error: str
) -> None:
    """Take what is found in cameras until a signal comes, or the time is over."""
    from jeat_graph.live.inputs import from_cameras

    bad = _skip(session) if on_error == "skip" else None
    for message, place in from_cameras(cameras, lambda: interrupts.seen is not None):
        _take(session, message, place, bad)


def _take(
    session: Session, message: ScanMessage, place: str, bad: Callable[[DataError], None] | None
) -> None:
    """Take a message; errors get the place where it came from."""
    from jeat_graph.live.session import MESSAGE_ERRORS, of_message

    try:
        session.accept(message, place)
    except MESSAGE_ERRORS as error:
        trouble = of_message(error, place)
        if bad is None:
            raise trouble from None
        bad(trouble)


def _skip(session: Session) -> Callable[[DataError], None]:
    from jeat_graph.live.session_warnings import BadLines

    lines = BadLines(_say)

    def bad(error: DataError) -> None:
        session.bad += 1
        lines.add(error, session.count)

    return bad


def _finish(session: Session, args: argparse.Namespace, cameras: LiveDetecting | None) -> None:
    from dataclasses import asdict

    from jeat_graph.io.files.atomic import open_atomic

    try:
        session.save()
    finally:  # a broker that takes no more is no reason to lose what is smoothed
        with contextlib.suppress(BrokenPipeError):
            session.finish()
    record = session.summary()
    if cameras is not None:
        for line in cameras.dropped_lines():
            _say(line)
        record["cameras"] = [asdict(status) for status in cameras.statuses]
    if args.record is not None:
        with open_atomic(args.record) as file:
            json.dump(record, file, indent=1)
            file.write("\n")
