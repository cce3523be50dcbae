"""Layouts of published data sets, each in a small folder made here."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.layouts import LayoutOptions, read_sets
from jeat_graph.data.errors import DataError

BOX = (100.0, 50.0, 40.0, 80.0)
CONTRACT_TRUTH = "t,object_id,left,top,width,height\n0.0,1,100,50,40,80\n0.05,1,100,50,40,80\n"
PROPHESEE = np.dtype(
    {
        "names": ["t", "x", "y", "w", "h", "class_id", "class_confidence", "track_id"],
        "formats": ["<u8", "<f4", "<f4", "<f4", "<f4", "u1", "<f4", "<u4"],
    }
)


def seqinfo(folder, rate=25, frames=3):
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["[Sequence]", f"name={folder.name}", "imDir=img1", f"frameRate={rate}", f"seqLength={frames}"]
    (folder / "seqinfo.ini").write_text("\n".join([*lines, "imWidth=640", "imHeight=480", "imExt=.jpg", ""]))


def mot_text(path, identity, frames=(1, 2, 3), tail="1,1,1.0"):
    path.parent.mkdir(parents=True, exist_ok=True)
    box = ",".join(f"{v:g}" for v in BOX)
    path.write_text("".join(f"{frame},{identity},{box},{tail}\n" for frame in frames))


def mot_sequence(folder, **info):
    seqinfo(folder, **info)
    mot_text(folder / "gt" / "gt.txt", 1)
    mot_text(folder / "det" / "det.txt", -1, tail="0.9,-1,-1,-1")


def boxes_of(path, count=3, period_us=50_000):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [(k * period_us, *BOX, 0, 0.9, 7) for k in range(count)]
    np.save(path, np.array(rows, dtype=PROPHESEE))


def contract_text(path, count=3, period_s=0.05):
    path.parent.mkdir(parents=True, exist_ok=True)
    box = ",".join(f"{v:g}" for v in BOX)
    rows = "".join(f"{k * period_s:.3f},evt,{box},0.9\n" for k in range(count))
    path.write_text("t,sensor,left,top,width,height,score\n" + rows)


def test_motchallenge_sets_are_splits_and_a_detector_of_mot17_each(tmp_path):
    for name in ("MOT17-02-FRCNN", "MOT17-02-SDP", "MOT17-04-FRCNN"):
        mot_sequence(tmp_path / "MOT17" / "train" / name)
    seqinfo(tmp_path / "MOT17" / "test" / "MOT17-01-FRCNN")  # without truth
    sets = {one.name: one for one in read_sets("mot", tmp_path, LayoutOptions())}
    assert {name: len(one.recordings) for name, one in sets.items()} == {
        "MOT17 train FRCNN": 2,
        "MOT17 train SDP": 1,
    }
    first = sets["MOT17 train FRCNN"].recordings[0]
    assert first.name == "MOT17-02-FRCNN"
    assert first.image == (640.0, 480.0)
    np.testing.assert_allclose(np.diff(first.truth.frame_times()), 1 / 25)
    assert first.detections.boxes.tolist() == [list(BOX)] * 3


def test_a_sequence_itself_and_its_split_may_be_the_root(tmp_path):
    folder = tmp_path / "DanceTrack" / "val"
    mot_sequence(folder / "dancetrack0004")
    (whole,) = read_sets("mot", folder, LayoutOptions())
    assert (whole.name, whole.recordings[0].name) == ("DanceTrack val", "dancetrack0004")
    (alone,) = read_sets("mot", folder / "dancetrack0004", LayoutOptions())
    assert alone.recordings[0].name == "dancetrack0004"


def test_detections_that_a_set_does_not_hold_come_from_a_folder_with_a_file_a_recording(tmp_path):
    folder = tmp_path / "DanceTrack" / "val" / "dancetrack0004"
    seqinfo(folder)
    mot_text(folder / "gt" / "gt.txt", 1)
    mot_text(tmp_path / "yolox" / "dancetrack0004.txt", -1, tail="0.9,-1,-1,-1")
    (found,) = read_sets("mot", tmp_path / "DanceTrack", LayoutOptions((("yolox", tmp_path / "yolox"),)))
    assert found.sensors == ("yolox",)
    with pytest.raises(DataError, match="has no detections: give --detections"):
        read_sets("mot", tmp_path / "DanceTrack", LayoutOptions())
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="holds no detections of dancetrack0004"):
        read_sets("mot", tmp_path / "DanceTrack", LayoutOptions((("yolox", tmp_path / "empty"),)))


def test_our_own_layout_keeps_the_names_of_sensors_and_takes_the_size_from_meta(tmp_path):
    folder = tmp_path / "street" / "monday"
    contract_text(folder / "detections.csv")
    (folder / "gt.csv").write_text(CONTRACT_TRUTH)
    (folder / "meta.json").write_text(json.dumps({"width": 800, "height": 600, "rate_hz": 20}))
    (found,) = read_sets("mot", tmp_path, LayoutOptions())
    assert (found.name, found.sensors, found.recordings[0].image) == ("street", ("evt",), (800.0, 600.0))
    # The scan at 0.10 s lies on the truth's clock and saw no object there: it is a frame, too.
    np.testing.assert_allclose(found.recordings[0].truth.frame_times(), [0.0, 0.05, 0.1])


def test_scans_on_another_clock_are_no_frames_of_the_truth(tmp_path):
    folder = tmp_path / "street" / "monday"
    contract_text(folder / "detections.csv", count=6, period_s=0.013)
    (folder / "gt.csv").write_text(CONTRACT_TRUTH)
    (found,) = read_sets("mot", tmp_path, LayoutOptions())
    np.testing.assert_allclose(found.recordings[0].truth.frame_times(), [0.0, 0.05])


def test_text_files_side_by_side_need_a_rate(tmp_path):
    mot_text(tmp_path / "tud" / "campus" / "gt.txt", 1, tail="1,-1,-1,-1")
    mot_text(tmp_path / "tud" / "campus" / "det.txt", -1, tail="0.9,-1,-1,-1")
    with pytest.raises(DataError, match="give --rate HZ"):
        read_sets("mot", tmp_path, LayoutOptions())
    (found,) = read_sets("mot", tmp_path, LayoutOptions(rate_hz=25.0))
    np.testing.assert_allclose(np.diff(found.recordings[0].truth.frame_times()), 1 / 25)


def kitti_lines(path, kinds, score=""):
    path.parent.mkdir(parents=True, exist_ok=True)
    box = f"{BOX[0]} {BOX[1]} {BOX[0] + BOX[2]} {BOX[1] + BOX[3]}"
    lines = [
        f"{frame} {k} {kind} 0 0 0 {box} 1.5 1.6 3.9 1 1.6 20 0{score}"
        for frame in range(3)
        for k, kind in enumerate(kinds)
    ]
    path.write_text("\n".join(lines) + "\n")


def test_kitti_takes_labels_public_detections_and_the_classes_asked_for(tmp_path):
    training = tmp_path / "training"
    kitti_lines(training / "label_02" / "0000.txt", ["Car", "Pedestrian"])
    kitti_lines(training / "det_02" / "0000.txt", ["Car"], score=" 0.8")
    (found,) = read_sets("kitti", tmp_path, LayoutOptions(classes=("Car",)))
    recording = found.recordings[0]
    assert (found.name, recording.name, recording.image) == ("KITTI", "0000", (1242.0, 375.0))
    ignored = dict(zip(recording.truth.classes, recording.truth.ignore, strict=True))
    assert ignored == {"Car": False, "Pedestrian": True}
    np.testing.assert_allclose(recording.detections.boxes, [list(BOX)] * 3)


def test_mevdt_has_a_set_a_scene_and_a_rate_of_its_labels(tmp_path):
    labels = tmp_path / "labels" / "tracking_labels" / "test" / "Scene_A" / "1581956422"
    for rate in (24, 48):
        mot_text(labels / f"1581956422-{rate}Hz-mot.txt", 1)
    contract_text(tmp_path / "boxes" / "1581956422.csv")
    how = LayoutOptions((("evt", tmp_path / "boxes"),))
    sets = read_sets("mevdt", tmp_path, how)
    assert [one.name for one in sets] == ["MEVDT Scene_A 24 Hz", "MEVDT Scene_A 48 Hz"]
    np.testing.assert_allclose(np.diff(sets[1].recordings[0].truth.frame_times()), 1 / 48)
    mot_text(labels / "no-rate-mot.txt", 1)
    with pytest.raises(DataError, match="does not say the rate"):
        read_sets("mevdt", tmp_path, how)


@pytest.mark.parametrize(
    ("layout", "place", "name", "image"),
    [
        ("etram", "test/train_day_0001_bbox.npy", "train_day_0001", (1280.0, 720.0)),
        (
            "dsec-det",
            "test/zurich_city_01_e/object_detections/left/tracks.npy",
            "zurich_city_01_e",
            (640.0, 480.0),
        ),
    ],
)
def test_boxes_of_event_cameras_come_from_arrays_with_times_in_microseconds(
    tmp_path, layout, place, name, image
):
    boxes_of(tmp_path / "data" / place)
    contract_text(tmp_path / "boxes" / f"{name}.csv")
    (found,) = read_sets(layout, tmp_path / "data", LayoutOptions((("evt", tmp_path / "boxes"),)))
    (recording,) = found.recordings
    assert (recording.name, recording.image) == (name, image)
    np.testing.assert_allclose(recording.truth.t, [0.0, 0.05, 0.1])
    assert set(recording.truth.object_id) == {7}


def test_what_is_wrong_with_a_folder_is_said(tmp_path):
    with pytest.raises(DataError, match="is no folder"):
        read_sets("mot", tmp_path / "nowhere", LayoutOptions())
    with pytest.raises(DataError, match="holds no recording with truth in the layout 'kitti'"):
        read_sets("kitti", tmp_path, LayoutOptions())
    mot_sequence(tmp_path / "MOT20" / "train" / "MOT20-01")
    with pytest.raises(DataError, match="holds no set 'MOT21'; there are: MOT20 train"):
        read_sets("mot", tmp_path, LayoutOptions(sets=("MOT21",)))
    (tmp_path / "MOT20" / "train" / "MOT20-01" / "seqinfo.ini").write_text("[Sequence]\nframeRate=fast\n")
    with pytest.raises(DataError, match=r"seqinfo.ini: cannot be read"):
        read_sets("mot", tmp_path, LayoutOptions())


DSEC_MOT = "54828357559,10,178,222,100,70,0\n54828357559,11,10,20,30,40,6\n54828407559,10,180,222,100,70,0\n"


def test_dsec_mot_has_a_text_file_a_sequence_with_times_in_microseconds(tmp_path):
    folder = tmp_path / "train"
    folder.mkdir()
    (folder / "zurich_city_00_b.txt").write_text(DSEC_MOT)
    (folder / "readme.txt").write_text("seven fields a line\n")
    contract_text(tmp_path / "boxes" / "zurich_city_00_b.csv")
    how = LayoutOptions((("evt", tmp_path / "boxes"),))
    (found,) = read_sets("dsec-mot", tmp_path, how)
    (recording,) = found.recordings
    assert (recording.name, recording.image) == ("zurich_city_00_b", (640.0, 480.0))
    truth = recording.truth
    np.testing.assert_allclose(truth.t, [54828.357559, 54828.357559, 54828.407559], rtol=0, atol=1e-9)
    assert truth.object_id.tolist() == [10, 11, 10]
    assert truth.boxes[0].tolist() == [178.0, 222.0, 100.0, 70.0]
    assert truth.classes.tolist() == ["car", "train", "car"]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("54828357559,10,0,0,5,5,0", "track 10 is there twice at 54828357559"),
        ("54828457559,10,0,0,5,5,7", "class 7: DSEC-MOT has 0 to 6"),
        ("54828457559,10,0,0,-5,5,1", "a negative width or height"),
        ("54828457559,10,0,0,5,5", "4"),
    ],
)
def test_a_wrong_line_of_dsec_mot_is_named(tmp_path, line, message):
    (tmp_path / "a.txt").write_text(DSEC_MOT + line + "\n")
    contract_text(tmp_path / "boxes" / "a.csv")
    with pytest.raises(DataError, match=message) as raised:
        read_sets("dsec-mot", tmp_path, LayoutOptions((("evt", tmp_path / "boxes"),)))
    assert "a.txt:4" in str(raised.value)


def openlabel(path, objects, **properties):
    path.parent.mkdir(parents=True, exist_ok=True)
    held = {
        key: {
            "object_data": {"name": f"CAR_{key}", "type": kind, "bbox": [{"name": "full_bbox", "val": box}]}
        }
        for key, (kind, box) in objects.items()
    }
    frame = {"objects": held, "frame_properties": properties}
    path.write_text(
        json.dumps({"openlabel": {"metadata": {"schema_version": "1.0.0"}, "frames": {"0": frame}}})
    )


def test_tumtraf_is_a_folder_of_openlabel_files_with_centres_and_keys_that_stay(tmp_path):
    folder = tmp_path / "test" / "labels_rgb"
    openlabel(folder / "20231114-085428.179411.json", {"a4": ("CAR", [120, 90, 40, 80])})
    openlabel(folder / "20231114-085428.379411.json", {})
    openlabel(
        folder / "20231114-085428.579411.json",
        {"b7": ("TRUCK", [300, 100, 100, 60]), "a4": ("CAR", [124, 90, 40, 80])},
    )
    contract_text(tmp_path / "boxes" / "labels_rgb.csv")
    (found,) = read_sets("tumtraf", tmp_path, LayoutOptions((("rgb", tmp_path / "boxes"),)))
    truth = found.recordings[0].truth
    np.testing.assert_allclose(truth.t, [0.0, 0.4, 0.4], atol=1e-6)
    np.testing.assert_allclose(truth.frame_times(), [0.0, 0.2, 0.4], atol=1e-6)
    assert truth.boxes.tolist() == [[100, 50, 40, 80], [250, 70, 100, 60], [104, 50, 40, 80]]
    assert truth.classes.tolist() == ["car", "truck", "car"]
    assert truth.object_id[0] == truth.object_id[2] != truth.object_id[1]


def test_openlabel_says_its_time_by_its_frame_or_by_its_name(tmp_path):
    for name, properties in (("1651673050_250000000_s110_camera", {}), ("b", {"timestamp": 1651673050.75})):
        openlabel(tmp_path / "labels" / f"{name}.json", {"a4": ("CAR", [5, 5, 2, 2])}, **properties)
    contract_text(tmp_path / "boxes" / "labels.csv")
    how = LayoutOptions((("rgb", tmp_path / "boxes"),))
    (found,) = read_sets("tumtraf", tmp_path, how)
    np.testing.assert_allclose(found.recordings[0].truth.t, [0.0, 0.5], atol=1e-6)
    openlabel(tmp_path / "labels" / "c.json", {})
    with pytest.raises(DataError, match=r"c.json: neither frame_properties.timestamp nor its name"):
        read_sets("tumtraf", tmp_path, how)


def test_openlabel_whose_objects_are_numbered_anew_in_each_file_is_refused(tmp_path):
    for k in range(2):
        two = {"0": ("CAR", [5, 5, 2, 2]), "1": ("CAR", [9, 9, 2, 2])}
        openlabel(tmp_path / "labels" / f"{k}.json", two, timestamp=0.1 * k)
    contract_text(tmp_path / "boxes" / "labels.csv")
    how = LayoutOptions((("rgb", tmp_path / "boxes"),))
    with pytest.raises(DataError, match="numbered from 0 in each file"):
        read_sets("tumtraf", tmp_path, how)
    openlabel(tmp_path / "labels" / "0.json", {"a4": ("CAR", [5, 5, 2])}, timestamp=0.0)
    with pytest.raises(DataError, match=r"0.json: bbox \[5, 5, 2\] is not"):
        read_sets("tumtraf", tmp_path, how)
