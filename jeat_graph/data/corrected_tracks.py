"""Identities that a person has corrected, and where the model disagrees with them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, TextArray
from jeat_graph.data.errors import DataError


class CorrectedTracks(NamedTuple):
    """Rows of tracks (R,) as a person left them, in any order; no track twice at one time.

    Attributes:
        t: time (s).
        track_id: identity.
        boxes: (R, 4) left, top, width, height (px), in the common picture.
        coasts: (R,) rows of which the file says that the model wrote them without a detection.
        error: makes an error that names a row's (from 0) place in the file.
    """

    t: FloatArray
    track_id: IntArray
    boxes: FloatArray
    coasts: BoolArray
    error: Callable[[int, str], DataError]


class Disagreements(NamedTuple):
    """Rows (K,) of corrected tracks that the model disagrees with, in order of time, then of identity.

    Attributes:
        t: time (s).
        track_id: identity.
        sigma: standard deviations between the row and the smoothed track, NaN where there is none.
        what: `identity`, `moved`, `added`, `absent` or `unseen`, see `tracking/identities/disagreeing.py`.
    """

    t: FloatArray
    track_id: IntArray
    sigma: FloatArray
    what: TextArray
