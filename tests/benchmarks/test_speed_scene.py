"""The synthetic detections are what the speed benchmark says they are."""

import numpy as np

from benchmarks.speed_scene import HEIGHT_PX, WIDTH_PX, SpeedScene, make_frames


def test_one_seed_gives_one_scene():
    first, second = (make_frames(20, 5, 20.0, seed=3) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        assert a.boxes.tobytes() == b.boxes.tobytes()
        assert a.scores.tobytes() == b.scores.tobytes()


def test_all_objects_stay_in_the_picture():
    scene = SpeedScene(50, seed=0)
    for t in (0.0, 1.0, 30.0):
        boxes = scene.boxes(t)
        centre = boxes[:, :2] + 0.5 * boxes[:, 2:]
        assert (centre >= 0).all()
        assert (centre <= [WIDTH_PX, HEIGHT_PX]).all()


def test_objects_move_less_than_a_third_of_their_width_between_frames():
    scene = SpeedScene(200, seed=1)
    before, after = scene.boxes(0.0), scene.boxes(0.05)
    step = np.abs(after[:, :2] - before[:, :2])
    stayed = (step < 0.5 * HEIGHT_PX).all(axis=1)  # the others came back on the other side
    assert (step[stayed] < before[stayed, 2:3] / 3).all()
    assert stayed.mean() > 0.95


def test_detections_have_the_stated_misses_and_clutter():
    frames = make_frames(200, 50, 20.0, seed=0)
    real = np.array([(f.scores > 0.6).sum() for f in frames])
    false = np.array([(f.scores < 0.6).sum() for f in frames])
    # 10,000 looks at P_D = 0.95 and 50 Poisson draws of mean 6: five standard deviations each.
    assert abs(real.mean() - 190.0) < 5 * np.sqrt(200 * 0.95 * 0.05 / 50)
    assert abs(false.mean() - 6.0) < 5 * np.sqrt(6.0 / 50)
