"""Networks by the names that `--detector-frames` and its like take: of the package, and of other people.

A network NAME for pictures is `weights/NAME-frames.onnx`, one for events `weights/NAME-events.onnx`, one for
both at once `weights/NAME-fused.onnx`. What it was trained on, by which command, and how good it is stands in
the file (`card`). Of other people's networks for pictures (`known_networks`) the files are fetched once.
"""

from __future__ import annotations

from pathlib import Path

from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.known_networks import KNOWN
from jeat_graph.detection.network_cache import fetched

#: The detectors without weights.
MOTION = "motion"
#: Whichever fits the pictures (`automatic`).
AUTO = "auto"
#: What a network looks at.
FRAMES, EVENTS, FUSED = "frames", "events", "fused"
_FOLDER = Path(__file__).parent / "weights"
_ONNX = ".onnx"


def networks(kind: str) -> dict[str, Path]:
    """Return the networks of a kind that come with the package, by name.

    Args:
        kind: `frames`, `events` or `fused`.
    """
    found = sorted(_FOLDER.glob(f"*-{kind}{_ONNX}"))
    return {path.name.removesuffix(f"-{kind}{_ONNX}"): path for path in found}


def network_file(detector: str, kind: str) -> Path:
    """Return the file of a network.

    Args:
        detector: a name, or a path; what ends in `.onnx` or has a folder is a path.
        kind: `frames`, `events` or `fused`.

    Raises:
        ConfigError: a name that is not known.
        DataError: the file of a known network is neither here nor to be had.
    """
    path = Path(detector)
    if path.suffix.lower() == _ONNX or len(path.parts) > 1 or path.is_file():
        return path
    known = networks(kind)
    if kind == FRAMES and detector in KNOWN:
        return fetched(KNOWN[detector])
    if detector not in known:
        names = list(known) if kind == FUSED else [MOTION, *known]
        names = [AUTO, *names, *KNOWN] if kind == FRAMES else names
        choice = f"one of {', '.join(names)}, or " if names else ""
        seen = "both sensors" if kind == FUSED else kind
        raise ConfigError(
            f"{detector!r} is no detector of {seen}: it is {choice}a network's file (FILE.onnx)"
        )
    return known[detector]
