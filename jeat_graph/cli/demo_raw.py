"""The part of `jeat-graph demo` that begins with raw pictures and events: commands anybody can repeat."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jeat_graph.cli.terminal import say

SCENARIO, SEED, FRAMES, SIZE = "night-nolight", 7, 40, "640x384"
NETWORK = "sehn"
#: Moments of the strip of pictures.
MOMENTS = 4


def clip_command(out: Path) -> list[str]:
    """Return the arguments of the command that renders the clip."""
    what = [SCENARIO, "--density", "sparse", "--sensors", "pictures", "--frames", str(FRAMES), "--size", SIZE]
    return ["simulate", *what, "--seed", str(SEED), "--out", str(out / "clip")]


def commands(out: Path) -> list[list[str]]:
    """Return the arguments of the commands, in their order: render, track, judge, film, strip."""
    segment = out / "clip" / "segments" / "000000"
    tracked = str(out / "raw")
    raw = ["--frames", str(segment), "--events", str(segment / "events.h5")]
    network = ["--detector-frames", NETWORK, "--detector-events", NETWORK]
    return [
        clip_command(out),
        ["track", *raw, *network, "--out", tracked],
        ["eval", tracked, "--gt", str(segment / "gt.csv")],
        # Each second picture, for writing films takes long.
        ["render", tracked, *raw, "--output-rate", "10", "--window", "0.05", "--out", str(out / "raw.mp4")],
        ["render", tracked, *raw, "--strip", str(MOMENTS), "--out", str(out / "raw.png")],
    ]


def go_the_whole_way(out: Path) -> int:
    """Run the commands, and say each before it runs and where the film is.

    Returns:
        The exit code of the first that failed; 0 if none did.
    """
    if code := in_order(commands(out)):
        return code
    print(f"film      {out / 'raw.mp4'} (moments of it: {out / 'raw.png'}), pictures left, events right")
    print()
    return 0


def in_order(commands: Sequence[Sequence[str]]) -> int:
    """Run commands of `jeat-graph` until one fails, and say each before; returns the last exit code."""
    from jeat_graph.cli.main import main

    for arguments in commands:
        say("demo", f"jeat-graph {' '.join(arguments)}")
        if code := main(arguments):
            return code
    return 0
