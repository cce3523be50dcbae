"""Rules of what is ignored: those of the challenges, equal to TrackEval's to the digit."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import evaluate
from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError

FRAMES = 40
SIZE = (1242, 375)
#: Objects of the KITTI scenes by type, truncation and occlusion.
KITTI_OBJECTS = (
    *(("Car", 0, 0), ("Car", 1, 0), ("Car", 0, 3), ("Van", 0, 0), ("Truck", 0, 0)),
    *(("Pedestrian", 0, 1), ("Pedestrian", 0, 2), ("Person", 0, 0), ("Cyclist", 0, 0)),
)


def drawn(rng, count):
    """Boxes (FRAMES, count, 4) of objects that move, which overlap now and then."""
    place = rng.uniform(0, (600, 250), (count, 2)) + np.arange(FRAMES)[:, None, None] * rng.normal(
        0, 4, (count, 2)
    )
    size = np.broadcast_to(rng.uniform(18, 90, (count, 2)), place.shape)
    return np.round(np.concatenate((place, size), axis=2), 2)


def tracked(rng, boxes, there):
    """Boxes that follow the objects with noise, some missing, with identities that change hands at times."""
    frame, k = np.nonzero(there & (rng.random(there.shape) < 0.85))
    noisy = boxes[frame, k] + rng.normal(0, 3, (len(k), 4))
    noisy[:, 2:] = np.maximum(noisy[:, 2:], 5.0)
    owner = np.where(rng.random(len(k)) < 0.03, k + 50, k)
    return frame, owner, k, np.round(noisy, 2)


def kitti_line(frame, number, kind, cut, hidden, box, more=""):
    left, top, width, height = box
    edges = f"{left:.2f} {top:.2f} {left + width:.2f} {top + height:.2f}"
    return f"{frame} {number} {kind} {cut} {hidden} -10 {edges} -1 -1 -1 -1000 -1000 -1000 -10{more}\n"


def kitti_scene(folder, seed):
    rng = np.random.default_rng(seed)
    kinds = [KITTI_OBJECTS[i] for i in rng.integers(0, len(KITTI_OBJECTS), 14)] + [("Car", 0, 0)] * 2
    boxes, there = drawn(rng, len(kinds)), rng.random((FRAMES, len(kinds))) < 0.9
    truth, result = [], []
    for frame in range(FRAMES):
        # An object of which every frame tells something, so that the last frame is known.
        truth += [kitti_line(frame, 90, "Car", 0, 0, (900, 200, 60, 60))]
        truth += [kitti_line(frame, k, *kinds[k], boxes[frame, k]) for k in np.flatnonzero(there[frame])]
        truth += [kitti_line(frame, -1, "DontCare", -1, -1, (300, 100, 150, 80))]
    frame, owner, k, found = tracked(rng, boxes, there)
    said = {"Van": "Car", "Person": "Pedestrian", "Truck": "Car"}
    for f, number, of, box in zip(frame, owner, k, found, strict=True):
        kind = said.get(kinds[of][0], kinds[of][0])
        result.append(kitti_line(f, number, kind, -1, -1, box, " 0.9"))
    for f in range(0, FRAMES, 2):  # false ones: small, within the region, anywhere
        result.append(kitti_line(f, 200, "Car", -1, -1, (700, 300, 40, 20), " 0.9"))
        result.append(kitti_line(f, 201, "Car", -1, -1, (310, 110, 60, 50), " 0.9"))
        result.append(kitti_line(f, 202, "Pedestrian", -1, -1, (800, 20, 30, 70), " 0.9"))
    (folder / "gt" / "label_02").mkdir(parents=True)
    (folder / "res" / "it" / "data").mkdir(parents=True)
    (folder / "gt" / "label_02" / "0000.txt").write_text("".join(truth))
    (folder / "gt" / "evaluate_tracking.seqmap.training").write_text(f"0000 empty 000000 {FRAMES:06d}\n")
    (folder / "res" / "it" / "data" / "0000.txt").write_text("".join(result))
    return folder / "res" / "it" / "data" / "0000.txt", folder / "gt" / "label_02" / "0000.txt"


def mot_scene(folder, seed):
    rng = np.random.default_rng(seed)
    kinds = np.concatenate(([1, 1, 1], rng.integers(1, 14, 12)))
    boxes, there = drawn(rng, len(kinds)), rng.random((FRAMES, len(kinds))) < 0.9
    judged = rng.random(len(kinds)) < 0.8
    judged[0] = True
    sequence = folder / "gt" / "MOT17-train" / "S"
    (sequence / "gt").mkdir(parents=True)
    rows = [
        f"{frame + 1},{k + 1},{','.join(map(str, boxes[frame, k]))},{int(judged[k])},{kinds[k]},0.9\n"
        for frame, k in zip(*np.nonzero(there), strict=True)
    ]
    (sequence / "gt" / "gt.txt").write_text("".join(rows))
    (sequence / "seqinfo.ini").write_text(
        f"[Sequence]\nname=S\nframeRate=25\nseqLength={FRAMES}\nimWidth=1242\nimHeight=375\n"
    )
    frame, owner, _, found = tracked(rng, boxes, there)
    lines = [
        f"{f + 1},{number + 1},{','.join(map(str, box))},0.9,-1,-1,-1\n"
        for f, number, box in zip(frame, owner, found, strict=True)
    ]
    lines += [f"{f},300,900,10,40,90,0.9,-1,-1,-1\n" for f in range(1, FRAMES + 1, 3)]
    (folder / "gt" / "seqmaps").mkdir()
    (folder / "gt" / "seqmaps" / "MOT17-train.txt").write_text("name\nS\n")
    (folder / "res" / "MOT17-train" / "it" / "data").mkdir(parents=True)
    result = folder / "res" / "MOT17-train" / "it" / "data" / "S.txt"
    result.write_text("".join(lines))
    return result, sequence / "gt" / "gt.txt"


def oracle(dataset, sequence, kind):
    """Scores of TrackEval with its own readers and rules, in per cent where ours are."""
    from trackeval.metrics import CLEAR, HOTA, Identity

    data = dataset.get_preprocessed_seq_data(dataset.get_raw_seq_data("it", sequence), kind)
    found = {}
    for metric in (CLEAR({"PRINT_CONFIG": False}), Identity({"PRINT_CONFIG": False}), HOTA()):
        found |= metric.eval_sequence(data)
    shares = ("MOTA", "MOTP", "HOTA", "DetA", "AssA", "LocA", "IDF1", "IDP", "IDR")
    scores = {name: 100.0 * float(np.mean(found[name])) for name in shares}
    scores |= {name: int(found[f"CLR_{name}"]) for name in ("TP", "FP", "FN")}
    return scores | {name: int(found[name]) for name in ("IDSW", "MT", "PT", "ML", "Frag")}


def assert_equal(ours, theirs):
    assert {name: ours[name] for name in theirs} == pytest.approx(theirs, rel=0, abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("benchmark", ["MOT17", "MOT20"])
def test_the_rules_of_the_motchallenge_are_those_of_trackeval(tmp_path, benchmark, seed):
    trackeval = pytest.importorskip("trackeval", reason="needs the package trackeval as oracle")
    result, truth = mot_scene(tmp_path, seed)
    dataset = trackeval.datasets.MotChallenge2DBox(
        {
            "GT_FOLDER": str(tmp_path / "gt"),
            "TRACKERS_FOLDER": str(tmp_path / "res"),
            "BENCHMARK": "MOT17",
            "SPLIT_TO_EVAL": "train",
            "PRINT_CONFIG": False,
        }
    )
    dataset.benchmark = benchmark
    theirs = oracle(dataset, "S", "pedestrian")
    assert_equal(evaluate(result, truth, protocol=benchmark.lower())["causal"], theirs)
    assert evaluate(result, truth)["causal"]["FP"] != theirs["FP"]  # the plain rules are others


@pytest.mark.parametrize("seed", range(3))
def test_the_rules_of_kitti_are_those_of_trackeval_and_so_is_the_mean_of_its_classes(tmp_path, seed):
    trackeval = pytest.importorskip("trackeval", reason="needs the package trackeval as oracle")
    result, truth = kitti_scene(tmp_path, seed)
    dataset = trackeval.datasets.Kitti2DBox(
        {
            "GT_FOLDER": str(tmp_path / "gt"),
            "TRACKERS_FOLDER": str(tmp_path / "res"),
            "SPLIT_TO_EVAL": "training",
            "PRINT_CONFIG": False,
        }
    )
    theirs = {kind: oracle(dataset, "0000", kind) for kind in ("car", "pedestrian")}
    found = evaluate(result, truth, protocol="kitti")
    for kind, scores in theirs.items():
        assert_equal(found[f"causal/{kind}"], scores)
        assert_equal(evaluate(result, truth, protocol="kitti", classes=[kind.title()])["causal"], scores)
    for name in ("HOTA", "DetA", "AssA"):
        mean = np.mean([scores[name] for scores in theirs.values()])
        assert found["causal/mean"][name] == pytest.approx(mean, abs=1e-9)
    assert found["causal"]["FP"] == sum(scores["FP"] for scores in theirs.values())


def test_each_class_by_itself_counts_a_track_of_another_class_as_false(tmp_path):
    truth = "t,object_id,left,top,width,height,class\n"
    tracks = "t,track_id,left,top,width,height,class\n"
    for k in range(10):
        truth += f"{k / 10},1,10,10,50,40,car\n{k / 10},2,200,10,50,40,bus\n"
        tracks += f"{k / 10},1,10,10,50,40,car\n{k / 10},2,200,10,50,40,car\n"
    (tmp_path / "gt.csv").write_text(truth)
    (tmp_path / "res.csv").write_text(tracks)
    found = evaluate(tmp_path / "res.csv", tmp_path / "gt.csv", per_class=True)
    assert evaluate(tmp_path / "res.csv", tmp_path / "gt.csv")["causal"]["MOTA"] == 100.0
    assert (found["causal/car"]["FP"], found["causal/car"]["FN"]) == (10, 0)
    assert (found["causal/bus"]["FP"], found["causal/bus"]["FN"]) == (0, 10)
    # DetA 1/2 and AssA 1 of cars, nothing of buses: HOTA √½ and 0.
    assert found["causal/mean"]["HOTA"] == pytest.approx(100.0 * np.sqrt(0.5) / 2)


def test_a_line_says_by_which_rules_was_judged(tmp_path, capsys):
    result, truth = mot_scene(tmp_path, 0)
    assert main(["eval", str(result), "--gt", str(truth)]) == 0
    assert "(--protocol mot17 or mot20)" in capsys.readouterr().err
    assert main(["eval", str(result), "--gt", str(truth), "--protocol", "mot17"]) == 0
    assert "--protocol" not in capsys.readouterr().err
    assert main(["eval", str(result), "--gt", str(truth), "--protocol", "mot17", "--class", "car"]) == 2
    assert "the rules of mot17 judge pedestrian, not car" in capsys.readouterr().err


@pytest.mark.parametrize("protocol", ["mot17", "kitti"])
def test_rules_need_what_the_truth_lacks(tmp_path, protocol):
    (tmp_path / "gt.csv").write_text("t,object_id,left,top,width,height\n0,1,1,1,40,50\n1,1,1,1,40,50\n")
    (tmp_path / "r.csv").write_text("t,track_id,left,top,width,height\n0,1,1,1,40,50\n1,1,1,1,40,50\n")
    with pytest.raises(DataError, match=r"r\.csv: the rules of .* need"):
        evaluate(tmp_path / "r.csv", tmp_path / "gt.csv", protocol=protocol)
