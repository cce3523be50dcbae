"""A progress bar over the stages of a command, for work that has no loop of its own to count.

Within a stage the time goes on, so that one can tell work from a standstill.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_TICK_S = 0.5


@contextmanager
def stages(command: str, total: int) -> Iterator[Callable[[str], None]]:
    """Show a bar on stderr, on a terminal only, that is gone when the block ends.

    Args:
        command: name of the command.
        total: number of stages.

    Yields:
        A function to be called with the name of each stage when it begins.
    """
    from tqdm import tqdm

    begun = 0
    form = "{desc} {percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt} [{elapsed}]"
    hidden = not sys.stderr.isatty()
    with tqdm(total=total, desc=command, bar_format=form, disable=hidden, leave=False) as bar:

        def begin(name: str) -> None:
            nonlocal begun
            bar.n = min(begun, total)
            begun += 1
            bar.set_description_str(f"{command}: {name}")

        over = threading.Event()

        def tick() -> None:
            while not over.wait(_TICK_S):
                bar.refresh()

        ticking = threading.Thread(target=tick, daemon=True)
        if not hidden:
            ticking.start()
        try:
            yield begin
        finally:
            over.set()
            if not hidden:
                ticking.join()
