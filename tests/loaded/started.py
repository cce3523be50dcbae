"""Commands in processes that begin with all loaded, handled as `subprocess.Popen` handles others."""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
from multiprocessing.context import BaseContext
from multiprocessing.reduction import DupFd
from pathlib import Path

import loaded_process


class _Handed:
    """A file's number on its way to the process that is being started."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __reduce__(self):
        return _as_it_is, (DupFd(self._number),)


def _as_it_is(given):
    return given


class Started:
    """A command at work: `stdin`, `stdout` and `stderr` are binary files, `pid` and the rest as of `Popen`.

    Args:
        context: of the fork server.
        arguments: of the command.
        environment: all of it; None for that of this process.
        stdin: a file for it to read; None for a pipe.
    """

    def __init__(
        self,
        context: BaseContext,
        arguments: list[str],
        environment: dict[str, str] | None = None,
        stdin: Path | None = None,
    ) -> None:
        self.args, self.returncode = arguments, None
        (given, feed), (said, out), (complained, err) = (os.pipe() for _ in range(3))
        self.stdin, self.stdout, self.stderr = (
            os.fdopen(feed, "wb"),
            os.fdopen(said, "rb"),
            os.fdopen(complained, "rb"),
        )
        if stdin is not None:
            self.stdin.close()
            os.close(given)
            given = os.open(stdin, os.O_RDONLY)
        handed = [_Handed(number) for number in (given, out, err)]
        task = (list(arguments), dict(environment or os.environ), handed)
        self._process = context.Process(target=loaded_process.run_command, args=task)
        self._process.start()
        for number in (given, out, err):
            os.close(number)
        self.pid = self._process.pid

    def poll(self) -> int | None:
        """The exit status, if it has ended."""
        self.returncode = self._process.exitcode
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """The exit status when it ends."""
        self._process.join(timeout)
        if self.poll() is None:
            raise subprocess.TimeoutExpired(self.args, timeout)
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Signal it, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it."""
        self._process.kill()

    def communicate(self, given: bytes = b"", timeout: float | None = None) -> tuple[bytes, bytes]:
        """Give it its input, and return its output and complaints when it has ended."""
        said: list[bytes] = [b"", b""]

        def read(place: int, file) -> None:
            said[place] = file.read()

        readers = [
            threading.Thread(target=read, args=one, daemon=True)
            for one in enumerate((self.stdout, self.stderr))
        ]
        for reader in readers:
            reader.start()
        with contextlib.suppress(BrokenPipeError):  # it may end before it has read all
            if not self.stdin.closed:
                self.stdin.write(given)
                self.stdin.close()
        self.wait(timeout)
        for reader in readers:
            reader.join()
        self.stdout.close()
        self.stderr.close()
        return said[0], said[1]


def completed(process: Started, given: bytes = b"", timeout: float | None = None):
    """Like `subprocess.run` with text."""
    said = process.communicate(given, timeout)
    return subprocess.CompletedProcess(process.args, process.returncode, *(text.decode() for text in said))
