"""What boxes in pictures look like: a vector of each, by colour and shape or by a network."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Protocol

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.embeddings import EmbeddingArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.embedder_settings import EmbedderSettings
from jeat_graph.io.media.decoders import RgbImage

#: What needs no network.
COLOUR = "colour"


class Embedder(Protocol):
    """Makes a vector of each box.

    Attributes:
        description: one line that says what it is.
    """

    description: str

    def __call__(self, frame: RgbImage, boxes: FloatArray) -> EmbeddingArray:
        """Return vectors (M, E) of boxes (M, 4) in a picture (H, W, 3), NaN where a box shows nothing."""
        ...

    def note(self) -> str:
        """Say what was wrong so far; empty if nothing was."""
        ...


def open_embedder(name: str, settings: EmbedderSettings) -> Embedder:
    """Return an embedder.

    Args:
        name: `colour`, or an ONNX file.
        settings: how a network is fed.

    Raises:
        ConfigError: neither, or a backend that is not installed.
        DataError: a file that is no such network.
    """
    if name == COLOUR:
        from jeat_graph.detection.colour_embedding import ColourEmbedder

        return ColourEmbedder()
    if Path(name).suffix.lower() != ".onnx":
        raise ConfigError(f"--embedder {name}: must be {COLOUR} or FILE.onnx")
    from jeat_graph.detection.models.crop_network import NetworkEmbedder

    return NetworkEmbedder(name, settings)


def described(scan: Scan, frame: RgbImage, embedder: Embedder | None) -> Scan:
    """Return a scan with the embeddings of its boxes; the scan itself without an embedder or boxes."""
    if embedder is None or not len(scan.boxes):
        return scan
    return replace(scan, embeddings=embedder(frame, scan.boxes))
