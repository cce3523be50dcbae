"""Pictures with COCO's annotations: a JSON file, and the pictures beside it or in a folder of their own."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.class_names import wanted_classes
from jeat_graph.io.files.limits import check_file
from jeat_graph.io.media.decoders import RgbImage
from jeat_graph.io.media.picture_file import read_picture
from jeat_graph_sehn.training.data_sets import Picture
from jeat_graph_sehn.training.truth_at import TrueBoxes

_SEPARATE = "/"


def read_coco_pictures(
    path: Path, pictures: Path | None = None, on_read: Callable[[str], object] = lambda _: None
) -> list[Picture]:
    """Read a list of pictures with their boxes.

    Boxes of classes that sound like vehicles are kept, all where none does. `iscrowd` and `ignore` mark
    what is neither asked for nor wrong. Pictures of one `video_id`, or of one folder, are one segment.

    Args:
        path: the annotations.
        pictures: where the names of the pictures begin; by default beside the file, above it, or `images`.
        on_read: called with what is being read, again and again.

    Raises:
        DataError: names the entry that is not as it should be, or the first picture that is not there.
    """
    tree = _tree(path)
    names = {int(c["id"]): str(c.get("name", c["id"])) for c in _list(tree, "categories", path) if "id" in c}
    wanted, _ = wanted_classes((), len(names) or None, names)
    rows: dict[int, list[tuple[list[float], bool, int]]] = {}
    marks = _list(tree, "annotations", path)
    for k, entry in enumerate(marks):
        on_read(f"{path.name}: {k} of {len(marks)} annotations")
        try:
            box = [float(value) for value in entry["bbox"]]
            image, category = int(entry["image_id"]), int(entry.get("category_id", 0))
            left_out = bool(entry.get("iscrowd", 0)) or bool(entry.get("ignore", 0))
            if len(box) != 4 or not np.isfinite(box).all() or min(box[2:]) < 0.0:
                raise ValueError
        except (KeyError, TypeError, ValueError):
            raise DataError(
                f"annotation {k + 1} needs image_id and a bbox of left, top, width, height", path
            ) from None
        if wanted is None or category in wanted:
            corners = [box[0], box[1], box[0] + box[2], box[1] + box[3]]
            rows.setdefault(image, []).append((corners, left_out, int(entry.get("track_id", k))))
    found = []
    root: Path | None = None
    entries = _list(tree, "images", path)
    for k, entry in enumerate(entries):
        on_read(f"{path.name}: {k} of {len(entries)} pictures")
        if "file_name" not in entry or "id" not in entry:
            raise DataError(f"image {k + 1} needs id and file_name", path)
        name = str(entry["file_name"])
        root = root or _root(path, pictures, name)
        if not (root / name).is_file():
            raise DataError(f"no such picture; {path} names it", root / name)
        folder = name.rpartition(_SEPARATE)[0]
        group = f"{path}:{entry.get('video_id', folder)}"
        own = rows.get(int(entry["id"]), [])
        truth = TrueBoxes(
            np.array([row[0] for row in own], dtype=np.float64).reshape(-1, 4),
            np.array([row[1] for row in own], dtype=bool),
            np.array([row[2] for row in own], dtype=np.int64),
        )
        found.append(Picture(group, path.stem, _File(root / name), truth))
    if not found:
        raise DataError("lists no images", path)
    if len({picture.group for picture in found}) == 1:
        # Nothing says what belongs together: neighbours in the list do, most likely.
        parts = np.array_split(np.arange(len(found)), min(_PARTS, len(found)))
        found = [
            Picture(f"{found[i].group}#{n}", found[i].source, found[i].load, found[i].truth)
            for n, part in enumerate(parts)
            for i in part.tolist()
        ]
    return found


_PARTS = 8


class _File:
    """Reads one picture."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __call__(self) -> RgbImage:
        return np.ascontiguousarray(read_picture(self._path)[..., ::-1])


def _tree(path: Path) -> dict[str, Any]:
    check_file(path)
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", path) from None
    except (ValueError, RecursionError) as error:
        raise DataError(f"is not JSON: {str(error)[:200]}", path) from None
    if not isinstance(tree, dict):
        raise DataError("must be an object with `images` and `annotations`", path)
    return tree


def _list(tree: dict[str, Any], key: str, path: Path) -> list[dict[str, Any]]:
    value = tree.get(key, [] if key == "categories" else None)
    if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
        raise DataError(f"must have a list of `{key}`", path)
    return value


def _root(path: Path, pictures: Path | None, name: str) -> Path:
    """Return the folder that names of pictures begin in.

    Raises:
        DataError: the first picture lies in none of those tried.
    """
    tried = [pictures] if pictures is not None else [path.parent, path.parent.parent, path.parent / "images"]
    for folder in tried:
        if (folder / name).is_file():
            return folder
    raise DataError(
        f"names the picture {name}, which is not in {', '.join(str(p) for p in tried)}; say where with "
        "--pictures DIR",
        path,
    )
