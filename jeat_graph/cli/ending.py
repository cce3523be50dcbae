"""The end of the process of a command, at which no native thread is waited for.

Libraries keep threads of their own: Arrow's for reading tables, OpenCV's for live cameras. They outlive
`main`, and where the C++ runtime destroys what they belong to while one of them is just starting, it calls
`std::terminate`: on a busy machine a command that had done its work, or had said what was wrong, then ended
with SIGABRT (code 134). So Python's part of the end is done in order, and the process leaves without more.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
from collections.abc import Callable
from typing import NoReturn


def end_with(main: Callable[[], int]) -> NoReturn:
    """Run a command and end the process with its exit code.

    Args:
        main: the command; it may raise `SystemExit`, as argparse does. Other exceptions end the process as
            they always do.
    """
    try:
        code: object = main()
    except SystemExit as end:
        code = end.code
    if code is None:
        code = 0
    elif not isinstance(code, int):
        print(code, file=sys.stderr)
        code = 1
    # What `Py_Finalize` does first, in its order: other threads of Python end, then what was put off is done.
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    os._exit(code & 0xFF if _flushed() else 120)


def _flushed() -> bool:
    """Write out what is still held back; whether that could be done."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None and not stream.closed:
                stream.flush()
        except (OSError, ValueError):
            return False
    return True
