"""How many threads OpenCV takes for a while."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread() -> Iterator[None]:
    """Let OpenCV work in the thread that calls it.

    Its work on a picture is short, and threads of its own wait busily for the next: twice the processor's
    time, of which the other camera has a use.
    """
    import cv2

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)
