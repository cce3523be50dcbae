"""Processes that compile for this one: they end when all is compiled, or with this one."""

from __future__ import annotations

import atexit
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import Any

from jeat_graph.config.cache_names import save_under_own_names
from jeat_graph.data.processes import available_cores
from jeat_graph.tracking.notice import is_compiled, keeper

_HELP_OUT = "--help-out"


def start_helpers(module: str, kernel: Any, most: int) -> list[subprocess.Popen[bytes]]:
    """Run a module in a process for each further processor, told which one it is (see `part_of`).

    Args:
        module: its dotted name.
        kernel: decorated with `njit`; the last one that is compiled.
        most: of so many processors at most.

    Returns:
        The processes: none where the kernel is compiled, nothing can be kept on disk, or there is one
        processor; fewer where the system has no more. It takes longer without.
    """
    number = min(available_cores() - 1, most)
    if number < 1 or is_compiled(kernel) or keeper(kernel) is None:
        return []
    save_under_own_names()
    helpers: list[subprocess.Popen[bytes]] = []
    atexit.register(_send_home, helpers)
    for k in range(number):
        # Not by `multiprocessing`, which would run a caller's script again where that has no guard for it.
        # -P: not what lies beside the user's files, should it have the name of a package.
        command = [sys.executable, "-P", "-m", module, _HELP_OUT, f"{k}/{number}"]
        quiet = subprocess.DEVNULL
        try:
            # Nothing is written to the pipe: it closes when this process ends, however it does.
            helper = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet)
        except OSError:
            break
        helpers.append(helper)
    return helpers


def _send_home(helpers: Sequence[subprocess.Popen[bytes]]) -> None:
    for helper in helpers:
        helper.kill()
        helper.wait()


def part_of(arguments: Sequence[str]) -> tuple[int, int] | None:
    """Return which helper this process is, from 0 on, and of how many; None where it is none.

    A helper ends with who started it, lets who waits for it go first, and saves under names of its own.
    """
    if list(arguments[:1]) != [_HELP_OUT]:
        return None
    end_with_pipe()
    # Sent to all at once, they are for who started it, who may still need what is compiled.
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(10)
    save_under_own_names()
    k, _, number = arguments[1].partition("/")
    return int(k), int(number)


def end_with_pipe() -> None:
    """End this process when the one ends that holds the other end of its standard input."""

    def watch() -> None:
        # Not through `sys.stdin`, whose lock a thread must not hold when the interpreter shuts down.
        while os.read(0, 1):
            pass
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
