"""Names that columns go by in tables people have: `confidence` for `score`, `x1, y1, x2, y2` for a box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from jeat_graph.data.arrays import FloatArray

#: Usual names of each column, in lower case; not `x` and `y`, which may be a corner or the centre.
ALIASES: Mapping[str, tuple[str, ...]] = {
    "t": ("time", "timestamp", "time_s", "t_s", "timestamp_s", "seconds", "sec"),
    "t_ms": ("time_ms", "timestamp_ms"),
    "t_us": ("time_us", "timestamp_us"),
    "t_ns": ("time_ns", "timestamp_ns"),
    "frame": (
        *("frame_id", "frame_number", "frame_index", "frame_idx", "frame_no", "frame_num", "frameid"),
        "image_index",
    ),
    "image": ("image_id", "image_name", "image_path", "file_name", "filename", "img", "img_name"),
    "video": ("video_id", "video_name", "video_file", "sequence_name"),
    "sensor": ("camera", "sensor_name"),
    "left": ("x1", "xmin", "x_min", "bb_left", "bbox_left", "box_left"),
    "top": ("y1", "ymin", "y_min", "bb_top", "bbox_top", "box_top"),
    "cx": ("center_x", "centre_x", "x_center", "x_centre", "xc"),
    "cy": ("center_y", "centre_y", "y_center", "y_centre", "yc"),
    "right": ("x2", "xmax", "x_max", "bb_right", "bbox_right", "box_right"),
    "bottom": ("y2", "ymax", "y_max", "bb_bottom", "bbox_bottom", "box_bottom"),
    "width": ("w", "bb_width", "bbox_width", "box_width"),
    "height": ("h", "bb_height", "bbox_height", "box_height"),
    "score": ("conf", "confidence", "prob", "probability"),
    "class": ("class_name", "label", "category", "cls"),
    "class_id": ("classid", "class_number", "category_id", "cls_id"),
    "object_id": ("objectid", "obj_id", "id", "track_id", "tracker_id"),
}
#: Sides of a box, in the order of arrays (M, 4).
BOX = ("left", "top", "width", "height")
#: Columns of motion: the centre with velocity and acceleration (px, px/s, px/s²), and their variances.
MEAN = ("x", "y", "vx", "vy", "ax", "ay")
VAR = tuple(f"var_{name}" for name in MEAN)
SIZE_VAR = ("var_width", "var_height")
#: The sensor of tables that count frames and name none.
DEFAULT_SENSOR = "rgb"
#: Columns that may stand for `t`, with their units.
TIME_COLUMNS = {"t_ms": "ms", "t_us": "us", "t_ns": "ns"}
#: Columns of times and boxes that hold numbers, by any of their names.
NUMBER_COLUMNS = ("t", *TIME_COLUMNS, *BOX, "right", "bottom", "cx", "cy")
#: A whole box in one field (`data.box_text`).
BOX_TEXT = "box"
#: Columns that count frames, by number or by the name of a picture.
FRAME_COLUMNS = ("frame", "image")
_STAND_INS = {
    "t": (*TIME_COLUMNS, *FRAME_COLUMNS),
    "left": ("cx", BOX_TEXT),
    "top": ("cy", BOX_TEXT),
    "width": ("right", BOX_TEXT),
    "height": ("bottom", BOX_TEXT),
}
_CANONICAL = {alias: name for name, aliases in ALIASES.items() for alias in aliases}


def usual_names(names: Sequence[str], known: Sequence[str]) -> list[str]:
    """Give columns the names that the readers know, where no other column has that name already.

    Args:
        names: as the table has them.
        known: columns that the reader asks for; an alias of any other column stays what it is.

    Returns:
        A name for each column.
    """
    out = list(names)
    known = [*known, *(name for others in _STAND_INS.values() for name in others)]
    lower = {name.lower(): name for name in known}
    # A column's own name goes before an alias, and the first alias before the second.
    for find in (lower.get, lambda text: _CANONICAL.get(text)):
        for k, name in enumerate(names):
            found = find(name.lower())
            if out[k] == name and found is not None and found in known and found not in out:
                out[k] = found
    return out


def standing_in(names: Sequence[str], wanted: Sequence[str]) -> list[str]:
    """Replace the columns that are not there by those that can stand for them: `right` for `width`.

    Args:
        names: that the table has.
        wanted: that the reader asks for.
    """
    out = []
    for name in wanted:
        there = [other for other in _STAND_INS.get(name, ()) if other in names]
        out.append(there[0] if name not in names and there else name)
    return out


def sides_to_boxes(names: Sequence[str], sides: FloatArray) -> FloatArray:
    """Turn sides (M, 4) in place into left, top, width, height (px), and return them.

    Args:
        names: of the four columns, as `standing_in` gives them for `BOX`.
        sides: what stands in these.
    """
    for k in (0, 1):
        centre = names[k] in ("cx", "cy")
        if names[k + 2] in ("right", "bottom"):
            sides[:, k + 2] -= sides[:, k]
            sides[:, k + 2] *= 2.0 if centre else 1.0
        if centre:
            sides[:, k] -= 0.5 * sides[:, k + 2]
    return sides
