"""What systemd gets by its own socket: that the service is ready, alive, and about to stop."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Callable
from contextlib import suppress

_US_PER_S = 1e6
#: So often within the watchdog's time a sign of life is given.
_SIGNS = 3.0


def notify(state: str) -> None:
    """Send a state such as `READY=1`; nothing where systemd did not start the process."""
    path = os.environ.get("NOTIFY_SOCKET", "")
    if not path:
        return
    # A name in the abstract space begins with @ in the variable and with a zero byte for the system.
    address = "\0" + path[1:] if path.startswith("@") else path
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        sender.sendto(state.encode(), address)


def watchdog_s() -> float | None:
    """Return after how long without a sign of life systemd restarts the service (s); None: never."""
    asked = os.environ.get("WATCHDOG_USEC", "")
    mine = os.environ.get("WATCHDOG_PID", str(os.getpid()))
    return int(asked) / _US_PER_S if asked.isdigit() and mine == str(os.getpid()) else None


class Watchdog:
    """Gives signs of life from a thread, as long as the service is alive; a context manager.

    Args:
        quiet_s: tells for how long (s) the part of the service that was quiet for longest has done nothing.
    """

    def __init__(self, quiet_s: Callable[[], float]) -> None:
        self._quiet_s, self._ended = quiet_s, threading.Event()

    def __enter__(self) -> None:
        patience_s = watchdog_s()
        if patience_s is not None:
            threading.Thread(target=self._run, args=(patience_s,), name="watchdog", daemon=True).start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def _run(self, patience_s: float) -> None:
        while not self._ended.wait(patience_s / _SIGNS):
            if self._quiet_s() < patience_s:
                notify("WATCHDOG=1")
