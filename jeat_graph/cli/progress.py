"""A progress bar over the stages of a command, and over the work within each, as far as that tells of itself.

Where a stage tells nothing the time goes on, so that one can tell work from a standstill.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from jeat_graph.data.progress import progress_to, refreshing


@contextmanager
def stages(command: str, total: int) -> Iterator[Callable[[str], None]]:
    """Show a bar on stderr, on a terminal only, that is gone when the block ends.

    Args:
        command: name of the command.
        total: number of stages; each is an equal part of the bar.

    Yields:
        A function to be called with the name of each stage when it begins.
    """
    from tqdm import tqdm

    begun = 0
    form = "{desc} {percentage:3.0f}%|{bar}| [{elapsed}]"
    hidden = not sys.stderr.isatty()
    with tqdm(total=total, desc=command, bar_format=form, disable=hidden, leave=False) as bar:

        def begin(name: str) -> None:
            nonlocal begun
            bar.n = min(begun, total)
            begun += 1
            bar.set_description_str(f"{command}: {name}")

        def advance(share: float) -> None:
            bar.n = min(max(begun - 1, 0) + share, total)

        with refreshing(bar):
            if hidden:
                yield begin
            else:
                with progress_to(advance):
                    yield begin
