"""Errors that a user can cause and can mend; each message is one line that says what to do."""

from __future__ import annotations

from pathlib import Path


class JeatGraphError(Exception):
    """Base of all errors that are the input's or the caller's, not a defect of this package."""


class ConfigError(JeatGraphError):
    """A configuration that is not valid: unknown key, wrong type, value out of range."""


class UnknownSensorError(JeatGraphError):
    """A scan of a sensor that the configuration does not declare."""


class TimeOrderError(JeatGraphError):
    """A scan older than one that has been processed already."""


class LostError(JeatGraphError):
    """A camera that cannot be reached, or whose connection has broken off."""


class OtherRunError(JeatGraphError):
    """A run that was broken off and cannot be continued: its state is another's, or damaged."""


class CoreMissingError(JeatGraphError, ImportError):
    """A checkout whose compiled core was not built, or not for this version of Python."""


class InputWarning(UserWarning):
    """Input that is valid but most likely not what was meant, such as times in ms."""


class DataError(JeatGraphError):
    """A file, or an array, whose content is not valid.

    Args:
        message: what is wrong, and what would be right.
        path: the file, if it came from one.
        line: the line in the file, counted from 1, if it can be named.
    """

    def __init__(self, message: str, path: str | Path | None = None, line: int | None = None) -> None:
        self.message = message
        self.path = path
        self.line = line
        place = "" if path is None else f"{path}:{line}: " if line is not None else f"{path}: "
        super().__init__(place + message)
