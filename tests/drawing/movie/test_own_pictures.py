"""`render --rig` draws tracks where a sensor's own picture shows them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from jeat_graph.cli.main import main
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.drawing.movie.moments import Marks, back_in

RIG = """
image: [640, 480]
sensors:
  rgb:
    image: [320, 240]
    to_picture: [[2, 0, 40], [0, 2, -20], [0, 0, 1]]
    offset_s: 5.0
"""


def test_boxes_trails_and_their_uncertainty_go_back() -> None:
    way = PictureMap.of_numbers(np.array([2.0, 0, 40, 0, 2, -20, 0, 0, 1]))
    marks = Marks(
        track_id=np.array([7]),
        boxes=np.array([[140.0, 80.0, 60.0, 40.0]]),
        centre=np.array([[170.0, 100.0]]),
        sigma=np.array([[4.0, 6.0]]),
        trails=[np.array([[150.0, 100.0], [170.0, 100.0]])],
    )
    own = back_in(marks, way)
    assert own.boxes.tolist() == [[50.0, 50.0, 30.0, 20.0]]
    assert own.centre.tolist() == [[65.0, 60.0]]
    assert own.sigma.tolist() == [[2.0, 3.0]]
    np.testing.assert_allclose(own.trails[0], [[55.0, 60.0], [65.0, 60.0]])
    assert back_in(marks, None) is marks


def test_a_film_in_the_sensors_own_picture_and_time(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(RIG)
    folder = tmp_path / "pictures"
    folder.mkdir()
    for k in range(3):
        cv2.imwrite(str(folder / f"{k}.png"), np.zeros((240, 320, 3), np.uint8))
    motion = ["x", "y", "vx", "vy", "ax", "ay"]
    table = [
        "t,track_id,left,top,width,height,existence,"
        + ",".join([*motion, *(f"var_{one}" for one in motion), "sensors"])
    ]
    table += [f"{k / 10:.1f},1,140,80,60,40,1,170,100,0,0,0,0,1,1,1,1,1,1,rgb" for k in range(-52, -47)]
    (tmp_path / "causal.csv").write_text("\n".join(table) + "\n")
    out = tmp_path / "one.png"
    # The pictures' times, 0 to .2 s of the camera's clock, are -5 to -4.8 s of the common one.
    command = ["render", str(tmp_path / "causal.csv"), "--frames", str(folder), "--rate", "10"]
    command += ["--rig", str(tmp_path / "rig.yaml"), "--at", "-4.9", "--labels", "none", "--out", str(out)]
    assert main(command) == 0
    picture = cv2.imread(str(out))
    height, width = picture.shape[:2]
    assert (width, height) == (320, 240)
    rows = slice(40, 200)  # above and below there is text
    lit = np.argwhere(picture[rows].max(axis=2) > 90) + np.array([40, 0])
    np.testing.assert_allclose(lit.min(axis=0), [50, 50], atol=3)
    np.testing.assert_allclose(lit.max(axis=0), [70, 80], atol=3)
