"""The part of `jeat-graph demo` that begins with raw pictures and events: commands anybody can repeat."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from jeat_graph.cli.terminal import say
from jeat_graph.config.cache_names import save_under_own_names
from jeat_graph.tracking.compiling import do_without
from jeat_graph.tracking.helpers import end_with_pipe

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


@contextmanager
def raw_meanwhile(out: Path) -> Iterator[subprocess.Popen[str]]:
    """Go from the clip's pictures and events to a film, in a process that ends with the block at the latest.

    Yields:
        The process, for `tell`.
    """
    save_under_own_names()
    command = [sys.executable, "-P", "-m", __name__, str(out)]
    pipe = subprocess.PIPE
    # What closes with this process ends that one, should this one be killed.
    with subprocess.Popen(
        command, stdin=pipe, stdout=pipe, stderr=subprocess.STDOUT, text=True, errors="backslashreplace"
    ) as process:
        try:
            yield process
        finally:
            process.terminate()


def tell(process: subprocess.Popen[str], out: Path) -> int:
    """Wait for the process, and print what it said.

    Returns:
        Its exit code: of the first command that failed, which has said why; 0 if none did.
    """
    assert process.stdout is not None
    print(process.stdout.read(), end="")
    process.wait()
    if process.returncode == 0:
        print(f"film      {out / 'raw.mp4'} (moments of it: {out / 'raw.png'}), pictures left, events right")
        print()
    return process.returncode


def render_clip(out: Path) -> int:
    """Simulate the clip; what is there already is not rendered again.

    Returns:
        The exit code.
    """
    return _run(clip_command(out))


def go_the_whole_way(out: Path) -> int:
    """Run the commands that follow the clip, and say each before it runs.

    Returns:
        The exit code of the first that failed; 0 if none did.
    """
    for one in commands(out)[1:]:
        if code := _run(one):
            return code
    return 0


def _run(arguments: Sequence[str]) -> int:
    from jeat_graph.cli.main import main

    say("demo", f"jeat-graph {' '.join(arguments)}")
    return main(arguments)


if __name__ == "__main__":
    end_with_pipe()
    save_under_own_names()
    do_without()
    sys.exit(go_the_whole_way(Path(sys.argv[1])))
