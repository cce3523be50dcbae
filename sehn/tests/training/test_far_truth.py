"""Far vehicles are learned where they can be seen, and judged as the truth has it."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph.data.errors import DataError  # noqa: E402
from jeat_graph.data.trajectories import GroundTruth  # noqa: E402
from jeat_graph_sehn.training.data_sets import read_pictures  # noqa: E402
from jeat_graph_sehn.training.far_truth import VEHICLES, asking_for_far  # noqa: E402
from jeat_graph_sehn.training.procedure import TrainRequest, train  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings, TrainSettings  # noqa: E402

from .small_sets import FRAMES, write_segment  # noqa: E402

SIZES = {1: (8.0, 8.0), 2: (8.0, 3.0), 3: (8.0, 8.0), 4: (8.0, 8.0), 5: (8.0, 8.0), 6: (8.0, 8.0)}
SEEN = {1: 1.0, 2: 1.0, 3: 0.1, 4: 1.0, 5: 1.0, 6: 1.0}
CONTRAST = {1: 20.0, 2: 20.0, 3: 20.0, 4: 20.0, 5: 4.0, 6: ""}
IGNORED = {1: True, 2: True, 3: True, 4: False, 5: True, 6: True}
COUNT = len(SIZES)
HEAD = "t,object_id,visible,contrast\n"


def truth():
    """Two times of a far, a far and low, a hidden, a near, a far one in fog, and one of unknown contrast."""
    ids = np.array(list(SIZES) * 2)
    return GroundTruth(
        t=np.repeat([0.1, 0.15], COUNT),
        object_id=ids,
        boxes=np.array([[10.0 * k, 5.0, *SIZES[k]] for k in ids.tolist()]),
        motion=None,
        ignore=np.array([IGNORED[k] for k in ids.tolist()]),
    )


def write_vehicles(folder, rows):
    lines = "".join(f"{t:.6f},{k},{SEEN[k]},{CONTRAST[k]}\n" for t, k in rows)
    (folder / VEHICLES).write_text(HEAD + lines, encoding="utf-8")


def test_what_is_large_and_seen_is_asked_for(tmp_path):
    """Whatever the order of the rows."""
    write_vehicles(tmp_path, [(t, k) for k in (3, 6, 1, 5, 4, 2) for t in (0.15, 0.1)])
    found = asking_for_far(truth(), tmp_path, 5.0)
    assert found.ignore.tolist() == [False, True, True, False, True, False] * 2
    np.testing.assert_array_equal(found.boxes, truth().boxes)
    assert (
        asking_for_far(truth(), tmp_path, 2.0).ignore.tolist() == [False, False, True, False, True, False] * 2
    )


def test_an_empty_truth_stays_empty(tmp_path):
    write_vehicles(tmp_path, [])
    none = GroundTruth(np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 4)), None, np.zeros(0, bool))
    assert len(asking_for_far(none, tmp_path, 5.0).ignore) == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "is missing"),
        ("t,object_id\n0.1,1\n", "has no columns"),
        (HEAD + "0.1,1,much,9\n", "has no columns"),
        (HEAD + "0.1,1,1,9\n", "the same vehicles"),
        (HEAD, "the same vehicles"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, text, words):
    if text is not None:
        (tmp_path / VEHICLES).write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=words):
        asking_for_far(truth(), tmp_path, 5.0)


@pytest.mark.usefixtures("no_plot")
def test_what_is_judged_stays_as_the_truth_has_it(tmp_path):
    from jeat_graph.io.tables.truth_io import read_truth, write_truth

    root = tmp_path / "set"
    for segment in range(2):
        folder = root / "segments" / f"{segment:06d}"
        write_segment(folder, segment)
        given = read_truth(folder / "gt.csv")
        far = np.asarray(given.object_id == 2)
        write_truth(
            GroundTruth(given.t, given.object_id, given.boxes, None, far, frames=given.frame_times()),
            folder / "gt.csv",
        )
        rows = "".join(f"{t:.6f},{k},1,9\n" for t, k in zip(given.t, given.object_id, strict=True))
        (folder / VEHICLES).write_text(HEAD + rows, encoding="utf-8")
    assert sum(one.truth.ignored.sum() for one in read_pictures(root)) == 2 * FRAMES
    assert sum(one.truth.ignored.sum() for one in read_pictures(root, 5.0)) == 0
    settings = TrainSettings(crop_px=(32, 32), batch=2, epochs=0.2, judged=2, far_px=5.0)
    done = train(TrainRequest((root,), tmp_path / "n.onnx", NetSettings(width=2), settings, force=True))
    assert done.card["judged"]["all"]["boxes"] == FRAMES  # of one of the two segments, one of its two boxes
