"""Ends the process at a chosen change to files: what a kill at the worst moment does, without any luck.

Python imports this by itself where the folder is on `PYTHONPATH`. Changes are openings for writing,
renamings, new folders and removals. From the environment: `DYING_BELOW` is the folder whose changes count,
`DYING_AT` the number of the change before which the process gets the signal `DYING_BY` (0: never),
`DYING_ONCE` a file that is made then, and of which there is only one however many processes there are,
`DYING_LOG` a file that gets a line for each change, `DYING_NAME` a part of the name that a change must have.
"""

from __future__ import annotations

import os
import signal
import sys

_CHANGES = {"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.truncate", "os.link", "os.symlink"}
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class _Fate:
    def __init__(self, below: str) -> None:
        self.below, self.count = os.path.join(os.path.realpath(below), ""), 0
        get = os.environ.get
        self.at, self.number = int(get("DYING_AT", "0")), int(get("DYING_BY", str(int(signal.SIGKILL))))
        self.once, self.log, self.name = get("DYING_ONCE"), get("DYING_LOG"), get("DYING_NAME", "")

    def hook(self, event: str, args: tuple[object, ...]) -> None:
        if event == "open":
            if not isinstance(args[2], int) or not args[2] & _WRITING:
                return
        elif event not in _CHANGES:
            return
        if not isinstance(args[0], (str, bytes, os.PathLike)):
            return
        path = os.path.abspath(os.fsdecode(args[0]))
        if not path.startswith(self.below) or self.name not in path:
            return
        self.count += 1
        if self.log:
            _append(self.log, f"{event} {path}\n")
        if self.count == self.at and self._is_first():
            os.kill(os.getpid(), self.number)

    def _is_first(self) -> bool:
        if self.once is None:
            return True
        try:
            os.close(os.open(self.once, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
        except FileExistsError:
            return False
        return True


def _append(path: str, line: str) -> None:
    handle = os.open(path, os.O_CREAT | os.O_APPEND | os.O_WRONLY)
    os.write(handle, os.fsencode(line))
    os.close(handle)


if "DYING_BELOW" in os.environ:
    sys.addaudithook(_Fate(os.environ["DYING_BELOW"]).hook)
