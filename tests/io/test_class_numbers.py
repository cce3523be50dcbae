"""Classes by number stay numbers unless a list names them; truth of the MOTChallenge has its own names."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.exporting.cvat import write_cvat
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.trajectories_io import read_trajectories
from jeat_graph.io.tables.truth_io import read_truth

#: A car, a truck and a bus, numbered by a tracker whose classes are those of COCO, from 1.
TRACKER = "1,1,1,2,3,4,0.7,3,-1\n1,2,9,2,3,4,0.6,8,-1\n1,3,9,9,3,4,0.6,6,-1\n"
COCO = ("person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck")
SEQINFO = "[Sequence]\nframeRate=20\n"


@pytest.fixture
def tracks() -> Trajectories:
    """A car, a bus and a vehicle of no known class, in two frames at 20 Hz."""
    t, n = np.repeat([0.0, 0.05], 3), 6
    boxes = np.column_stack([np.tile([100.0, 300.0, 500.0], 2), np.full((n, 3), 40.0)])
    return Trajectories(
        *(t, np.tile([4, 5, 6], 2), boxes, np.full(n, 0.75), np.zeros((n, 6)), np.ones((n, 6))),
        np.zeros(n, dtype=np.int64),
        classes=np.tile(["car", "bus", ""], 2),
        class_probability=np.tile([1.0, 0.8, np.nan], 2),
    )


@pytest.mark.parametrize("read", [read_detections, read_trajectories])
def test_a_tracker_s_numbers_stay_numbers_even_beside_seqinfo(write, read):
    write("seqinfo.ini", SEQINFO)
    assert read(write("result.txt", TRACKER)).classes.tolist() == ["3", "8", "6"]


@pytest.mark.parametrize("read", [read_detections, read_trajectories, read_truth])
def test_a_list_names_them_from_1(write, read):
    path = write("result.txt", TRACKER)
    wanted = ["car", "truck", "bus"]
    assert read(path, rate_hz=20, class_names=COCO).classes.tolist() == wanted
    assert read(path, rate_hz=20, class_names=",".join(COCO)).classes.tolist() == wanted
    assert read(path, rate_hz=20, class_names={3: "car", 8: "truck"}).classes.tolist() == [
        "car",
        "truck",
        "6",
    ]
    names = write("names.txt", "\n".join(COCO) + "\n")
    assert read(path, rate_hz=20, class_names=names).classes.tolist() == wanted
    mapping = write("data.yaml", "names:\n  3: car\n  6: bus\n  8: truck\n")
    assert read(path, rate_hz=20, class_names=mapping).classes.tolist() == wanted
    write("labels.txt", "\n".join(COCO))
    assert read(path, rate_hz=20).classes.tolist() == wanted


def test_truth_of_the_challenge_has_its_own_names(write):
    path = write("gt.txt", TRACKER)
    assert read_truth(path, rate_hz=20).classes.tolist() == ["3", "8", "6"]
    write("seqinfo.ini", SEQINFO)
    assert read_truth(path).classes.tolist() == ["car", "distractor", "non_motorized_vehicle"]


def test_a_list_that_cannot_be_read_is_named(write):
    path = write("result.txt", TRACKER)
    with pytest.raises(DataError, match=r"nowhere\.txt: no such file"):
        read_detections(path, rate_hz=20, class_names="nowhere.txt")
    with pytest.raises(DataError, match=r"car: no such file; names of classes themselves have commas"):
        read_detections(path, rate_hz=20, class_names="car")
    with pytest.raises(DataError, match=r"data\.yaml: must hold `names`"):
        read_detections(path, rate_hz=20, class_names=write("data.yaml", "nc: 3\n"))
    with pytest.raises(DataError, match=r"data\.yaml: is not YAML"):
        read_detections(path, rate_hz=20, class_names=write("data.yaml", "names: [car\n"))


@pytest.mark.parametrize(
    ("columns", "classes"),
    [
        (("3,-1,-1", "8,-1,-1"), ["3", "8"]),  # a class, and nothing of the world
        (("4,0,1", "9,1,2"), ["4", "9"]),  # VisDrone: a class, cut off, hidden
        (("-1,-1,-1", "-1,-1,-1"), None),
        (("4.25,7.5,0", "4.5,7.5,0"), None),  # a place in the world
        (("4,7,0", "5,7,0"), None),
    ],
)
@pytest.mark.parametrize("read", [read_detections, read_trajectories])
def test_ten_columns_keep_a_class_before_two_marks(write, read, columns, classes):
    text = "".join(f"1,{k},{9 * k},2,3,4,0.5,{more}\n" for k, more in enumerate(columns, 1))
    found = read(write("result.txt", text), rate_hz=20).classes
    assert (None if found is None else found.tolist()) == classes


@pytest.mark.parametrize("read", [read_truth, read_trajectories, read_detections])
def test_what_is_written_for_cvat_is_read_back_with_its_classes(tmp_path, tracks, read):
    path = tmp_path / "tracks.zip"
    write_cvat(tracks, path, 20.0)
    found = read(path, rate_hz=20)
    assert found.classes.tolist() == ["car", "bus", "vehicle"] * 2
    np.testing.assert_allclose(found.boxes, tracks.boxes)
    # Unpacked, the list of names lies beside the text.
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    assert read(tmp_path / "gt" / "gt.txt", rate_hz=20).classes.tolist() == ["car", "bus", "vehicle"] * 2


def test_a_damaged_or_foreign_zip_is_refused_in_one_line(tmp_path, tracks):
    path = tmp_path / "tracks.zip"
    write_cvat(tracks, path, 20.0)
    content = path.read_bytes()
    for end in (10, len(content) // 2, len(content) - 1):
        path.write_bytes(content[:end])
        with pytest.raises(DataError, match=r"tracks\.zip: "):
            read_trajectories(path, rate_hz=20)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("gt/gt.txt", TRACKER)
    with pytest.raises(DataError, match="packed in an unusual way; unpack it"):
        read_trajectories(path, rate_hz=20)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
    with pytest.raises(DataError, match="is a zip archive or an Excel workbook"):
        read_trajectories(path, rate_hz=20)
