"""Types of command-line arguments: each turns a text into a number within bounds, or says what is wrong."""

from __future__ import annotations

from argparse import ArgumentTypeError


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


def share(text: str) -> float:
    """Read a number above 0 and at most 1."""
    value = float(text)
    if not 0.0 < value <= 1.0:
        raise ArgumentTypeError("must be more than 0 and at most 1")
    return value
