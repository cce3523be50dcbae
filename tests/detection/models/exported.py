"""Writes networks as exports are documented: of Ultralytics 5 to 26, with their notes and open sides.

Nothing here is of Ultralytics' code or weights: the shapes, and the names of the notes, are those of its
documentation of exports. Each network answers with the same two boxes, whatever it is shown.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

#: Corners (px) in an input of any size from 224 px on, scores, and the classes of those with several.
CORNERS = np.array([[16.0, 24.0, 80.0, 56.0], [120.0, 64.0, 200.0, 112.0]])
SCORES = np.array([0.9, 0.75])
LOW = 1e-4
MASKS, POINTS = 32, 51
FEW = 300


class Made(NamedTuple):
    """What a network is like.

    Attributes:
        family: `v5`, `v8` (dense rows, as 9, 11, 12 and 26 without its own suppression have them) or `e2e`.
        task: `detect`, `segment`, `pose` or `obb`.
        side: width and height of its input (px).
        classes: how many.
        dynamic: whether the sides of input and outputs are left open.
        half: whether it works in half precision.
        opset: version of ONNX's operators.
        notes: what it says of itself.
    """

    family: str
    task: str
    side: tuple[int, int]
    classes: int
    dynamic: bool
    half: bool
    opset: int
    notes: dict[str, str]

    @property
    def kinds(self) -> np.ndarray:
        """Classes of the two boxes."""
        return np.array([self.classes - 1, 0])


def notes_of(
    made: Made, *, nms: bool, end_to_end: bool | None, arguments: bool, imgsz: bool
) -> dict[str, str]:
    """Notes as versions have them: of YOLOv5 stride and names; `args` since 8.3, `end2end` of late."""
    names = {k: f"kind {k}" for k in range(made.classes)}
    if made.family == "v5":
        return {"stride": "32", "names": str(names)}
    width, height = made.side
    said = {
        "description": "Ultralytics YOLO",
        "task": made.task,
        "stride": "32",
        "batch": "1",
        "names": str(names),
    }
    if imgsz:
        said["imgsz"] = str([height, width])
    if made.task == "pose":
        said["kpt_shape"] = "[17, 3]"
    if arguments:
        said["args"] = str({"batch": 1, "half": made.half, "dynamic": made.dynamic, "nms": nms})
    if end_to_end is not None:
        said["end2end"] = str(end_to_end)
    return said


def outputs_of(made: Made) -> dict[str, np.ndarray]:
    """The outputs with the two boxes in them."""
    behind = {"detect": 0, "segment": MASKS, "pose": POINTS, "obb": 1}[made.task]
    rng = np.random.default_rng(1)
    sized = np.column_stack([(CORNERS[:, :2] + CORNERS[:, 2:]) / 2, CORNERS[:, 2:] - CORNERS[:, :2]])
    if made.family == "e2e":
        table = np.zeros((1, FEW, 6 + behind))
        box = sized if made.task == "obb" else CORNERS
        table[0, :2, :6] = np.column_stack([box, SCORES, made.kinds])
    else:
        width, height = made.side
        cells = sum((width // s) * (height // s) for s in (8, 16, 32))
        of_v5 = made.family == "v5"
        rows = np.zeros((cells * (3 if of_v5 else 1), 4 + of_v5 + made.classes + behind))
        rows[:, :4], rows[:, 4:] = [20.0, 20.0, 8.0, 8.0], LOW
        rows[:2, :4] = sized
        scores = rows[:, 4 + of_v5 : 4 + of_v5 + made.classes]
        scores[[0, 1], made.kinds] = SCORES
        if of_v5:
            rows[:2, 4] = 1.0
        if behind and made.task != "obb":
            rows[:, -behind:] = rng.normal(0.0, 30.0, (len(rows), behind))
        elif behind:
            rows[:, -1] = 0.0
        table = rows[None] if of_v5 else rows.T[None]
    found = {"output0": table}
    if made.task == "segment":
        found["output1"] = np.zeros((1, MASKS, made.side[1] // 4, made.side[0] // 4))
    return found


def write(path, made: Made, declared: dict[str, list] | None = None):
    """Write the file; `declared` are shapes that it declares in place of the true ones."""
    kind = TensorProto.FLOAT16 if made.half else TensorProto.FLOAT
    nodes = [
        helper.make_node("Cast", ["images"], ["shown"], to=TensorProto.FLOAT),
        helper.make_node("GlobalAveragePool", ["shown"], ["means"]),
        helper.make_node("Conv", ["means", "nothing"], ["zero4"]),
        helper.make_node("Reshape", ["zero4", "one_side"], ["zero"]),
    ]
    values = [
        numpy_helper.from_array(np.zeros((1, 3, 1, 1), np.float32), "nothing"),
        numpy_helper.from_array(np.array([1, 1, 1], np.int64), "one_side"),
    ]
    ports = []
    for name, array in outputs_of(made).items():
        values.append(numpy_helper.from_array(array.astype(np.float32), f"{name}_value"))
        nodes.append(helper.make_node("Add", [f"{name}_value", "zero"], [f"{name}_long"]))
        nodes.append(helper.make_node("Cast", [f"{name}_long"], [name], to=kind))
        shape = (declared or {}).get(name, _open(name, array.shape, made))
        ports.append(helper.make_tensor_value_info(name, kind, shape))
    width, height = made.side
    sides = ["batch", 3, "height", "width"] if made.dynamic else [1, 3, height, width]
    given = helper.make_tensor_value_info("images", kind, sides)
    graph = helper.make_graph(nodes, "export", [given], ports, values)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", made.opset)], ir_version=8)
    helper.set_model_props(model, made.notes)
    onnx.save(model, str(path))
    return path


def _open(name: str, shape: tuple[int, ...], made: Made) -> list:
    """Sides of an output as dynamic exports leave them open."""
    if not made.dynamic:
        return list(shape)
    if name == "output1":
        return ["batch", shape[1], "mask_height", "mask_width"]
    if made.family == "v5":
        return ["batch", "anchors", shape[2]]
    if made.family == "v8":
        return ["batch", shape[1], "anchors"]
    return ["batch", None, None]  # what suppression gives is known at run time
