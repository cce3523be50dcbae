"""Check that a wheel holds the one package jeat_graph, with its data, and nothing else."""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

NEEDED = (
    "jeat_graph/py.typed",
    "jeat_graph/configs/default.yaml",
    "jeat_graph/configs/paper.yaml",
    "jeat_graph/core/_core/__init__.pyi",
    *(f"jeat_graph/core/_core/{folder}.pyi" for folder in ("detection", "events", "io")),
)
#: Sources of what is compiled, and what the build of a checkout leaves in it.
UNWANTED = (".hpp", ".cpp", ".txt", ".pth", ".new")


def problems(wheel: Path) -> list[str]:
    """List what is wrong with a wheel, one line each."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    found = [
        f"{name} does not belong in the wheel"
        for name in names
        if not (name.startswith("jeat_graph/") or name.split("/")[0].endswith(".dist-info"))
        or (name.startswith("jeat_graph/") and name.endswith(UNWANTED))
    ]
    compiled = [name for name in names if name.startswith("jeat_graph/core/_core.")]
    if len(compiled) != 1:
        found.append(f"one compiled core belongs in the wheel, not {compiled}")
    wanted = set(NEEDED)
    wanted |= {f"jeat_graph/{path.as_posix()}" for path in Path("configs").rglob("*.yaml")}
    modules = [path for kind in ("py", "js", "css") for path in Path("jeat_graph").rglob(f"*.{kind}")]
    for folder in ("filters", "association", "smoothers", "eval", "configs"):
        modules += [Path("jeat_graph") / path for path in Path(folder).rglob("*.py")]
    wanted |= {path.as_posix() for path in modules}
    wanted |= {path.as_posix() for path in Path("jeat_graph").rglob("weights/*.onnx")}
    return found + [f"{name} is missing from the wheel" for name in sorted(wanted - set(names))]


if __name__ == "__main__":
    lines = problems(Path(sys.argv[1]))
    print("\n".join(lines) or f"{Path(sys.argv[1]).name}: one package, complete")
    sys.exit(1 if lines else 0)
