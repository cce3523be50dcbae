"""Types of command-line arguments: each turns a text into a number within bounds, or says what is wrong."""

from __future__ import annotations

import re
from argparse import ArgumentTypeError

#: Bounds of a picture's width and height (px): below, nothing is seen; above, no camera is known.
SMALLEST_PX, LARGEST_PX = 16, 65_536
#: Largest width or height (px) of a picture that is drawn: that of most video decoders.
LARGEST_DRAWN_PX = 8192
#: Highest rate of what is written (Hz), as of a sensor's setting: no film or table is meant to be finer.
HIGHEST_RATE_HZ = 1000.0


def natural(text: str) -> int:
    """Read a whole number that is not negative."""
    value = int(text)
    if value < 0:
        raise ArgumentTypeError("must not be negative")
    return value


def counting(text: str) -> int:
    """Read a whole number of at least 1."""
    value = int(text)
    if value < 1:
        raise ArgumentTypeError("must be at least 1")
    return value


def positive(text: str) -> float:
    """Read a positive, finite number."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise ArgumentTypeError("must be a positive number")
    return value


def output_rate(text: str) -> float:
    """Read frames per second of what is written."""
    value = positive(text)
    if value > HIGHEST_RATE_HZ:
        raise ArgumentTypeError(f"must be at most {HIGHEST_RATE_HZ:g} Hz")
    return value


def not_negative(text: str) -> float:
    """Read a finite number that is at least 0."""
    value = float(text)
    if not 0.0 <= value < float("inf"):
        raise ArgumentTypeError("must be a number, at least 0")
    return value


def finite(text: str) -> float:
    """Read a finite number."""
    value = float(text)
    if not abs(value) < float("inf"):
        raise ArgumentTypeError("must be a finite number")
    return value


def share(text: str) -> float:
    """Read a number above 0 and at most 1."""
    value = float(text)
    if not 0.0 < value <= 1.0:
        raise ArgumentTypeError("must be more than 0 and at most 1")
    return value


def picture_size(text: str) -> tuple[int, int]:
    """Read the size of a picture, such as 1280x720: width and height in px."""
    match = re.fullmatch(r"(\d{1,9})[xX×](\d{1,9})", text.strip())
    if match is None:
        raise ArgumentTypeError(f"must read WIDTHxHEIGHT in px, say 1280x720, not {text!r}")
    width, height = int(match[1]), int(match[2])
    if not (SMALLEST_PX <= width <= LARGEST_PX and SMALLEST_PX <= height <= LARGEST_PX):
        raise ArgumentTypeError(f"must be from {SMALLEST_PX} to {LARGEST_PX} px each, not {text!r}")
    return width, height


def drawn_size(text: str) -> tuple[int, int]:
    """Read the size of pictures that are to be drawn, such as 1280x720, within what video can hold."""
    width, height = picture_size(text)
    if max(width, height) > LARGEST_DRAWN_PX:
        raise ArgumentTypeError(f"width and height must be at most {LARGEST_DRAWN_PX} px, not {text!r}")
    return width, height
