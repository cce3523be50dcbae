"""Write the software bill of materials of the wheel: packages it needs, libraries and networks it holds.

`python .ci/sbom.py PYTHON OUT.cdx.json` lists the environment of a Python in which the wheel is installed
(`cyclonedx-py`, CycloneDX 1.6), and adds what no metadata of Python's packages names: the libraries that are
compiled into the core, and the networks that the wheel holds. The same environment gives the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import runpy
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

#: Compiled into the core: name, where it is from, licence. robin-map comes with nanobind, without a version.
COMPILED = (("nanobind", "https://github.com/wjakob/nanobind", "BSD-3-Clause"),)
ROBIN_MAP = ("robin-map", "https://github.com/Tessil/robin-map", "MIT")


def compiled_components() -> list[dict[str, Any]]:
    """Components of the core, in CycloneDX's form."""
    found = [(*one, version(one[0])) for one in COMPILED] + [(*ROBIN_MAP, None)]
    return [
        {
            "type": "library",
            "name": name,
            "bom-ref": f"compiled-in:{name}",
            "licenses": [{"license": {"id": licence}}],
            "externalReferences": [{"type": "vcs", "url": url}],
            "description": "compiled into jeat_graph.core",
            **({} if number is None else {"version": number, "purl": f"pkg:pypi/{name}@{number}"}),
        }
        for name, url, licence, number in found
    ]


#: Where the networks lie, and their licence: they were trained by this project, on pictures that it rendered.
WEIGHTS = Path("jeat_graph") / "detection" / "weights"
WEIGHTS_LICENCE = "Apache-2.0"


def network_components(folder: Path = WEIGHTS) -> list[dict[str, Any]]:
    """Components of the networks that come along, each with its SHA-256, in CycloneDX's form."""
    return [
        {
            "type": "machine-learning-model",
            "name": path.stem,
            "bom-ref": f"network:{path.name}",
            "licenses": [{"license": {"id": WEIGHTS_LICENCE}}],
            "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(path.read_bytes()).hexdigest()}],
            "description": f"weights in jeat_graph/detection/weights/{path.name}, trained by this project on "
            "pictures and events that it rendered",
        }
        for path in sorted(folder.glob("*.onnx"))
    ]


def main() -> int:
    """Write the list; the exit code."""
    python, out = sys.argv[1:]
    command = [
        sys.executable,
        "-m",
        "cyclonedx_py",
        "environment",
        "--output-reproducible",
        "--spec-version",
        "1.6",
    ]
    command += ["--pyproject", "pyproject.toml", "--mc-type", "library", "--output-format", "JSON", python]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.stderr.write(done.stderr)
        return 1
    bill = json.loads(done.stdout)
    added = [*compiled_components(), *network_components()]
    bill["components"] = sorted([*bill.get("components", []), *added], key=lambda one: str(one["bom-ref"]))
    bill["metadata"]["component"]["version"] = runpy.run_path("jeat_graph/version.py")["__version__"]
    root = bill["metadata"]["component"]["bom-ref"]
    for entry in bill.get("dependencies", []):
        if entry["ref"] == root:
            entry["dependsOn"] = sorted({*entry.get("dependsOn", []), *(one["bom-ref"] for one in added)})
    bill.setdefault("dependencies", []).extend({"ref": one["bom-ref"]} for one in added)
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    Path(out).write_text(json.dumps(bill, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    print(f"sbom: {len(bill['components'])} components in {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
