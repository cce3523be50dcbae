"""The manifest of a data set: counts, splits, and the checksum of every file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import DataError
from jeat_graph.io.exports.coco_writer import coco_categories, merge_coco
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.version import __version__
from jeat_graph_sehn.simulation.dataset.layout import (
    ANNOTATIONS,
    CAMERA,
    COCO,
    FORMAT,
    MANIFEST,
    SCENARIO,
    SEGMENT_JSON,
    SEGMENTS,
    SETTINGS,
    segment_folder,
    segment_name,
)
from jeat_graph_sehn.simulation.dataset.protocol import SPLITS
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

_COUNTS = ("frames", "events", "boxes", "ignored", "vehicles", "faint", "bytes")


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        DataError: the file cannot be read, or holds no object.
    """
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", path) from None
    except (ValueError, RecursionError) as error:
        raise DataError(f"is not JSON: {error}", path) from None
    if not isinstance(tree, dict):
        raise DataError("must hold an object", path)
    return tree


def read_entry(root: Path, index: int) -> dict[str, Any]:
    """Read the `segment.json` of segment `index`.

    Raises:
        DataError: it cannot be read or lacks something.
    """
    path = segment_folder(root, index) / SEGMENT_JSON
    entry = read_json(path)
    lacking = [key for key in (*_COUNTS, "index", "split", "sha256") if key not in entry]
    if lacking:
        raise DataError(f"lacks {lacking[0]!r}; remove the segment's folder to make it again", path)
    return entry


def write_manifest(root: Path, entries: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Write the files of the whole set: annotations and lists of the splits, and at last the manifest.

    Args:
        root: the data set's folder.
        entries: those of all segments, by ascending index.

    Returns:
        The manifest.
    """
    splits = {name: [e for e in entries if e["split"] == name] for name in SPLITS}
    for name, members in splits.items():
        parts = [segment_folder(root, e["index"]) / COCO for e in members]
        merge_coco(root / ANNOTATIONS / f"{name}.json", parts, coco_categories(KIND_NAMES))
        with open_atomic(root / f"{name}.txt") as file:
            file.writelines(f"{SEGMENTS}/{segment_name(e['index'])}\n" for e in members)
    sums: dict[str, str] = {}
    for name in (SETTINGS, CAMERA, SCENARIO, *(f"{split}.txt" for split in SPLITS)):
        if (root / name).is_file():
            sums[name] = sha256_of(root / name)
    for name in SPLITS:
        sums[f"{ANNOTATIONS}/{name}.json"] = sha256_of(root / ANNOTATIONS / f"{name}.json")
    for entry in entries:
        folder = f"{SEGMENTS}/{segment_name(entry['index'])}"
        sums |= {f"{folder}/{name}": digest for name, digest in entry["sha256"].items()}
        sums[f"{folder}/{SEGMENT_JSON}"] = sha256_of(root / folder / SEGMENT_JSON)
    manifest = {
        "format": FORMAT,
        "version": __version__,
        "segments": len(entries),
        "splits": {name: [segment_name(e["index"]) for e in members] for name, members in splits.items()},
        "totals": {name: sum(e[name] for e in entries) for name in _COUNTS},
        "sha256": sums,
    }
    with open_atomic(root / MANIFEST) as file:
        file.write(json.dumps(manifest, indent=2) + "\n")
    return manifest
