"""Networks that come with the package, by the names that `--detector-frames` and `--detector-events` take.

A network NAME for pictures is `weights/NAME-frames.onnx`, one for events `weights/NAME-events.onnx`. What it
was trained on, by which command, and how good it is stands in the file (`card`).
"""

from __future__ import annotations

from pathlib import Path

from jeat_graph.data.errors import ConfigError

#: The detectors without weights.
MOTION = "motion"
#: What a network looks at.
FRAMES, EVENTS = "frames", "events"
_FOLDER = Path(__file__).parent / "weights"
_ONNX = ".onnx"


def networks(kind: str) -> dict[str, Path]:
    """Return the networks of a kind that come with the package, by name.

    Args:
        kind: `frames` or `events`.
    """
    found = sorted(_FOLDER.glob(f"*-{kind}{_ONNX}"))
    return {path.name.removesuffix(f"-{kind}{_ONNX}"): path for path in found}


def network_file(detector: str, kind: str) -> Path:
    """Return the file of a network.

    Args:
        detector: a name, or a path; what ends in `.onnx` or has a folder is a path.
        kind: `frames` or `events`.

    Raises:
        ConfigError: a name that is not known.
    """
    path = Path(detector)
    if path.suffix.lower() == _ONNX or len(path.parts) > 1 or path.is_file():
        return path
    known = networks(kind)
    if detector not in known:
        names = ", ".join((MOTION, *known))
        raise ConfigError(
            f"{detector!r} is no detector of {kind}: it is one of {names}, or a network's file (FILE.onnx)"
        )
    return known[detector]
