"""Check that a wheel holds its one package, with its data, and nothing else."""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

#: Folders that are parts of jeat_graph once it is built.
PARTS = ("filters", "association", "smoothers", "eval", "configs")
DATA = ("py", "js", "css", "yaml", "onnx", "gz", "json", "typed")
#: Type stubs of what is compiled, which its build writes.
STUBS = (
    "jeat_graph/core/_core/__init__.pyi",
    *(f"jeat_graph/core/_core/{folder}.pyi" for folder in ("detection", "events", "io", "road", "tracking")),
)
#: Sources of what is compiled, and what the build of a checkout leaves in it.
UNWANTED = (".hpp", ".cpp", ".txt", ".pth", ".new")


def wanted(package: str) -> set[str]:
    """Names of the files that the wheel of a package must hold."""
    root = Path("sehn") if package == "jeat_graph_sehn" else Path()
    found = [path.relative_to(root) for kind in DATA for path in (root / package).rglob(f"*.{kind}")]
    if package == "jeat_graph":
        found += [
            Path(package) / path for part in PARTS for kind in DATA for path in Path(part).rglob(f"*.{kind}")
        ]
        found += [Path(stub) for stub in STUBS]
    return {path.as_posix() for path in found if "__pycache__" not in path.parts}


def licences(names: list[str]) -> list[str]:
    """Say which licences the wheel lacks: ours, and those of what is compiled into its core."""
    texts = [Path("LICENSE"), *sorted(Path("licenses").glob("*.txt"))]
    return [
        f"the licence {text} is missing from the wheel"
        for text in texts
        if not any(name.endswith(f".dist-info/licenses/{text.as_posix()}") for name in names)
    ]


def problems(wheel: Path) -> list[str]:
    """List what is wrong with a wheel, one line each."""
    package = wheel.name.split("-")[0]
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    found = [
        f"{name} does not belong in the wheel"
        for name in names
        if not (name.startswith(f"{package}/") or name.split("/")[0].endswith(".dist-info"))
        or (name.startswith(f"{package}/") and name.endswith(UNWANTED))
    ]
    if package == "jeat_graph":
        compiled = [name for name in names if name.startswith("jeat_graph/core/_core.")]
        found += licences(names)
        if len(compiled) != 1:
            found.append(f"one compiled core belongs in the wheel, not {compiled}")
    return found + [f"{name} is missing from the wheel" for name in sorted(wanted(package) - set(names))]


if __name__ == "__main__":
    lines = problems(Path(sys.argv[1]))
    print("\n".join(lines) or f"{Path(sys.argv[1]).name}: one package, complete")
    sys.exit(1 if lines else 0)
