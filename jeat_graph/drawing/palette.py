"""The colours of all drawings: pictures, movies, plots and the page take theirs from here.

The page's own colours stand in `page/page.css`; those that it shares are checked against these by a test.
"""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

Rgb = tuple[int, int, int]

_GOLDEN = 0.61803398875  # golden ratio: its multiples modulo 1 lie far apart


def track_hue(track_id: int) -> float:
    """Hue of a track, 0 to 1; neighbouring identities lie far apart (multiples of the golden ratio)."""
    return track_id * _GOLDEN % 1.0


def track_rgb(track_id: int, lightness: float = 0.62) -> Rgb:
    """Colour of a track in a movie, each channel 0 to 255."""
    red, green, blue = colorsys.hls_to_rgb(track_hue(track_id), lightness, 0.85)
    return round(255 * red), round(255 * green), round(255 * blue)


def track_shade(track_id: int, lightness: float) -> tuple[float, float, float]:
    """Colour of a track in the picture of a run, each channel 0 to 1; red is kept for errors."""
    return colorsys.hls_to_rgb(0.07 + 0.84 * track_hue(track_id), lightness, 0.82)


@dataclass(frozen=True)
class Theme:
    """Colours of the picture of a run.

    Attributes:
        paper: around everything.
        picture: of the empty image plane.
        ink: of texts.
        quiet: of smaller texts.
        road: of the road's markings.
        lightness: of the tracks' colours, 0 to 1.
        missed: of what is wrong: false tracks and missed objects.
        both: where several sensors saw a track.
        single: where only one did, by its number.
        coast: where none did.
    """

    paper: str
    picture: str
    ink: str
    quiet: str
    road: str
    lightness: float
    missed: str
    both: str
    single: tuple[str, ...]
    coast: str


NIGHT = Theme(
    paper="#0d1117",
    picture="#06080c",
    ink="#d7dde5",
    quiet="#7d8794",
    road="#2b3440",
    lightness=0.66,
    missed="#ff6b6b",
    both="#ffd166",
    single=("#4cc9f0", "#f78fb3", "#9ef01a", "#c77dff"),
    coast="#3a4453",
)
DAY = Theme(
    paper="#fbfaf7",
    picture="#f1efe9",
    ink="#2a2f36",
    quiet="#737b85",
    road="#cfcbc0",
    lightness=0.42,
    missed="#d62828",
    both="#e09f00",
    single=("#0077b6", "#c2185b", "#4c8c0a", "#7b2cbf"),
    coast="#cfd3d8",
)

# Curves of a comparison: colours that stay apart for colour-blind readers and in print.
FILTER, LAGGED, FULL, TRUTH = "#d1662b", "#7a6fb0", "#1f6f8b", "#222222"
GRID, AXES = "#e6e6e6", "#888888"

# Lines of the speed plot, one a tracker.
LINES = ("#0b6e99", "#58a4c4", "#7a5195", "#bc5090", "#d1495b", "#edae49", "#8d99ae")

# Movies: boxes of the truth, of what it ignores, texts and their rims, the empty picture, and events.
TRUE_BOX: Rgb = (235, 235, 235)
IGNORED_BOX: Rgb = (120, 120, 120)
TEXT: Rgb = (240, 240, 240)
RIM: Rgb = (0, 0, 0)
DARK: Rgb = (10, 13, 18)
BRIGHTER: Rgb = (255, 176, 84)
DARKER: Rgb = (86, 156, 255)
