"""Entry point of the command `jeat-graph`: finds the command's module and reports errors in one line."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Any, NoReturn

from jeat_graph.api.beside import COMMAND_GROUP, HOW_TO_GET, find
from jeat_graph.cli import leave_current_folder
from jeat_graph.cli.ending import end_with
from jeat_graph.cli.held_outputs import holding
from jeat_graph.cli.terminal import Terminated, describe, in_good_order, say, stand_for_closed, write_anything
from jeat_graph.data.errors import ConfigError, JeatGraphError
from jeat_graph.data.notes import listening
from jeat_graph.io.files.outputs import check_named
from jeat_graph.version import __version__

# Each module has HELP (one line), add_arguments(parser) and run(args); maybe WRITES and WRITES_INTO, the
# arguments that name files and folders which it holds (`held_outputs`). Modules are imported only when their
# command is asked for, so that one command does not pay for another's libraries.
COMMANDS = (
    "demo",
    "simulate",
    "track",
    "stream",
    "serve",
    "batch",
    "eval",
    "compare",
    "explain",
    "render",
    "report",
    "view",
    "export",
    "draw",
    "frame",
    "count",
    "recount",
    "camera",
    "road",
    "handover",
    "conflicts",
    "events",
    "detect",
    "detectors",
    "train",
    "teach",
    "calibrate",
    "register",
)
# Those that a distribution of its own brings.
_BESIDE = ("simulate", "train", "teach")


# For these, `--out -` is standard output.
_TO_STDOUT = ("detect",)


def build_parser(command: str | None = None) -> argparse.ArgumentParser:
    """Build the parser; only `command`, if given, gets its full set of arguments."""
    # What takes long to load is loaded where an interrupt is dealt with.
    from jeat_graph.cli.examples import EXAMPLES, GroupedFormatter
    from jeat_graph.cli.options import Parser

    parser = Parser(
        prog="jeat-graph",
        description="Track vehicles from asynchronous event and RGB detections, causally and smoothed.",
        formatter_class=GroupedFormatter,
    )
    parser.add_argument("--version", action="version", version=f"jeat-graph {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)
    for name in COMMANDS:
        if command is not None and name != command:
            commands.add_parser(name, add_help=False)
            continue
        try:
            module = _module_of(name)
        except ConfigError:
            if command is not None:
                raise
            commands.add_parser(name, help=HOW_TO_GET, add_help=False)
            continue
        example = f"example: {EXAMPLES[name]}"
        sub = commands.add_parser(name, help=module.HELP, description=module.HELP, epilog=example)
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return parser


def _module_of(command: str) -> Any:
    """Import the module of a command.

    Raises:
        ConfigError: the command comes with a distribution that is not installed.
    """
    if command in _BESIDE:
        return find(COMMAND_GROUP, command, "the command")
    return import_module(f"jeat_graph.cli.{command}_command")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns:
        0 on success, 1 where a check did not hold, 2 on bad input or usage, 130 when interrupted, 128 + N
        when ended by signal N.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments[:1] == ["benchmark"]:
        say(None, "benchmark is no command any more: run `python -m benchmarks` in a checkout of jeat-graph")
        return 2
    command = next((a for a in arguments if a in COMMANDS), None)
    return carry_out(command, lambda: build_parser(command).parse_args(arguments))


def carry_out(command: str | None, parse: Callable[[], argparse.Namespace]) -> int:
    """Run what was asked for, report errors in one line, and end in good order when asked to.

    Args:
        command: its name, in messages.
        parse: reads the arguments, which name the command and have its function as `run`.

    Returns:
        An exit code, as `main` does.
    """
    stand_for_closed()
    write_anything()
    try:
        with in_good_order(command):
            return _run(parse())
    except BrokenPipeError:
        # The reader of our output went away (`| head`): not an error. Python would complain once more
        # when it flushes at exit, so its stdout is pointed elsewhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (JeatGraphError, OSError, MemoryError) as error:
        say(command, describe(error))
        return 2
    except KeyboardInterrupt as end:
        number = end.number if isinstance(end, Terminated) else signal.SIGINT
        say(command, "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}")
        return 128 + number


def _run(args: argparse.Namespace) -> int:
    if getattr(args, "out", None) is not None:
        check_named(args.out, stdout=args.command in _TO_STDOUT)
    # A command may come with another distribution, so what it writes is asked of where its function lies.
    held = holding(args, sys.modules[args.run.__module__])
    with held, listening(partial(say, args.command)):
        code = int(args.run(args) or 0)
    sys.stdout.flush()  # what cannot be written is noticed here, not at exit
    return code


def script() -> NoReturn:
    """Run one command as the program `jeat-graph`, and end the process."""
    end_with(main)


if __name__ == "__main__":
    leave_current_folder()
    script()
