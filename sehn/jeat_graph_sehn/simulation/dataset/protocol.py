"""The protocol of a data set: how many segments, how they are divided, how they are stored."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import Any

from jeat_graph.data.errors import ConfigError
from jeat_graph.io.events.dsec_writer import compression_filter
from jeat_graph.io.media.video import VIDEO_FILES

SPLITS = ("train", "val", "test")
FRAMES_PER_SEGMENT = 100  # as in the full set of 500 segments (paper, "Dataset setup")
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True)
class Protocol:
    """How a data set is divided and stored.

    Attributes:
        segments: how many.
        seed: of the division into splits.
        shares: of train, val and test; need not sum to one.
        video: `mp4`, `lossless` or `png`.
        compression: of the events: `gzip`, `none` or `blosc`.
        min_visible: vehicles of which less can be seen are marked `ignore` in the truth.

    Raises:
        ConfigError: a value that is not valid, or a compression that is not installed.
    """

    segments: int
    seed: int = 0
    shares: tuple[float, float, float] = (0.7, 0.15, 0.15)
    video: str = "mp4"
    compression: str = "gzip"
    min_visible: float = 0.1

    def __post_init__(self) -> None:
        if self.segments < 1:
            raise ConfigError(f"segments: must be at least 1, got {self.segments}")
        if self.seed < 0:
            raise ConfigError(f"seed: must not be negative, got {self.seed}")
        if min(self.shares) < 0.0 or not 0.0 < sum(self.shares) < math.inf:
            raise ConfigError(
                f"split: three shares that are not negative and not all zero, got {self.shares}"
            )
        if self.video not in VIDEO_FILES:
            raise ConfigError(f"video: must be one of {', '.join(VIDEO_FILES)}, not {self.video!r}")
        compression_filter(self.compression)

    def split_of(self, index: int) -> str:
        """Return the split of segment `index`: train, val or test.

        The golden-ratio sequence frac(u + index φ), with u from the seed, is cut at the shares: any first n
        segments have the shares within about one segment, and a larger set divides its first n likewise.
        """
        start = zlib.crc32(f"split.{self.seed}".encode()) / 2**32
        place = (start + index * _GOLDEN) % 1.0 * sum(self.shares)
        if place < self.shares[0]:
            return SPLITS[0]
        return SPLITS[1] if place < self.shares[0] + self.shares[1] else SPLITS[2]

    def settings(self) -> dict[str, Any]:
        """Return what, beside the source's own settings, defines the bytes of a segment, as plain values.

        The number of segments is not among them: a set can be made larger later.
        """
        return {
            "split_seed": self.seed,
            "shares": dict(zip(SPLITS, self.shares, strict=True)),
            "video": self.video,
            "compression": self.compression,
            "min_visible": self.min_visible,
        }
