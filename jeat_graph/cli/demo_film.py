"""`jeat-graph demo --film`: a film from raw recordings, by commands that anybody can repeat.

Without recordings a highway without street lamps is simulated, on which one vehicle stops and the next one
waits behind it; with `--frames`, and `--events`, they are the user's own.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from jeat_graph.cli.demo_raw import NETWORK, in_order

SCENARIO, SEED, FRAMES, SIZE = "night-nolight-stop", 31, 400, "640x384"
#: Where vehicles of each direction are counted (px).
LINES = ("towards=5,232,285,232", "away=340,232,635,232")
#: So long are events shown (s): at this light, in the time of a picture, noise would hide the vehicles.
WINDOW_S = 0.01
#: The lorry stands then, and the next vehicle comes to a stop behind it (s).
STILL_AT_S = 15.6
#: Of the film of a user's own recordings: moments of the picture beside it.
_MOMENTS = 2


def simulated_commands(out: Path, config: str) -> list[list[str]]:
    """Return the arguments of the commands: render, track (by a preset), film, still picture."""
    segment = out / "film-clip" / "segments" / "000000"
    raw = ["--frames", str(segment), "--events", str(segment / "events.h5")]
    clip = ["--sensors", "pictures", "--frames", str(FRAMES), "--size", SIZE, "--seed", str(SEED)]
    network = ["--detector-frames", NETWORK, "--detector-events", NETWORK]
    network += ["--detection-set", "events.rate_hz=20"]  # a scan a picture, in two fifths of the time
    run = str(out / "film-run")
    drawn = ["render", run, *raw, *_marked(LINES, ()), "--window", f"{WINDOW_S:g}"]
    return [
        ["simulate", SCENARIO, *clip, "--out", str(out / "film-clip")],
        ["track", *raw, *network, "--config", config, "--out", run],
        [*drawn, "--out", str(out / "film.mp4")],
        [*drawn, "--at", f"{STILL_AT_S:g}", "--out", str(out / "film.png")],
    ]


def recorded_commands(out: Path, args: argparse.Namespace) -> list[list[str]]:
    """Return the arguments of the commands for recordings of the user's: track, film, picture.

    Args:
        out: folder to write into.
        args: `frames`, `events`, `line`, `lines` and `config` of the command.
    """
    raw = ["--frames", args.frames, *(["--events", args.events] if args.events else [])]
    run = str(out / "film-run")
    drawn = ["render", run, *raw, *_marked(args.line, args.lines)]
    return [
        ["track", *raw, "--config", args.config, "--out", run],
        [*drawn, "--out", str(out / "film.mp4")],
        [*drawn, "--strip", str(_MOMENTS), "--out", str(out / "film.png")],
    ]


def make_film(out: Path, commands: Sequence[Sequence[str]]) -> int:
    """Run the commands and say where the film is.

    Returns:
        The exit code of the first that failed; 0 if none did.
    """
    if code := in_order(commands):
        return code
    print(f"film      {out / 'film.mp4'} (a picture of it: {out / 'film.png'})")
    return 0


def _marked(lines: Sequence[str], marks: Sequence[str]) -> list[str]:
    return [word for line in lines for word in ("--line", line)] + [
        word for file in marks for word in ("--lines", file)
    ]
