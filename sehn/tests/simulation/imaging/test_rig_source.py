"""Events through the second camera of a rig: where its own truth has vehicles, and by its own clock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError
from jeat_graph.rig.common_picture import CommonPicture, common_time
from jeat_graph_sehn.simulation.imaging.rig_source import RigEventSource
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.segment import SegmentSource, SegmentStep
from jeat_graph_sehn.simulation.world.rig import DRAWN, RigConfig

from .scenes import small

RIG = RigConfig(
    width=200, height=150, focal_px=170.0, right_m=0.8, yaw_deg=4.0, offset_s=2.5, drift_ppm=400.0
)
FRAMES = 3


@pytest.fixture(scope="module")
def second() -> RigEventSource:
    return RigEventSource(load_scenario("day"), small({}), 5, FRAMES, "fixed", RIG)


@pytest.fixture(scope="module")
def steps(second: RigEventSource) -> list[SegmentStep]:
    return list(second.segment(0))


@pytest.fixture(scope="module")
def first() -> RenderedSource:
    return RenderedSource(load_scenario("day"), small({}), 5, FRAMES, sensors="rgb")


def test_the_picture_is_its_own(second: RigEventSource, steps: list[SegmentStep]) -> None:
    made: SegmentSource = second
    assert made.size_px == (200, 150)
    for step in steps:
        assert step.rgb.shape == (150, 200, 3)
        assert step.events.x.max() < 200
        assert step.events.y.max() < 150
    assert max(step.events.x.max() for step in steps) > 165


def test_the_clock_is_its_own(
    second: RigEventSource, steps: list[SegmentStep], first: RenderedSource
) -> None:
    common = first.frame_times_us(0) * 1e-6
    expected = (common + 2.5) / (1.0 - 400e-6)
    np.testing.assert_allclose([step.t_us for step in steps], 1e6 * expected, atol=0.6)
    before = 1e6 * 2.5
    for step in steps:
        assert before <= step.events.t_us.min()
        assert step.events.t_us.max() <= step.t_us
        before = step.events.t_us.max()


def test_events_by_motion_lie_in_the_boxes_of_the_own_truth(steps: list[SegmentStep]) -> None:
    """A large share does, and far less in the same boxes where the other camera would have them."""
    inside = shifted = count = 0
    for step in steps[1:]:
        events = step.events
        late = (events.t_us > step.t_us - 10_000) & (events.by_motion == 1)
        xy = np.stack([events.x[late], events.y[late]], axis=1) + 0.5
        low, high = step.truth.boxes[:, :2] - 3.0, step.truth.boxes[:, :2] + step.truth.boxes[:, 2:] + 3.0

        def hits(points: np.ndarray, low: np.ndarray = low, high: np.ndarray = high) -> int:
            return int(((points[:, None] > low) & (points[:, None] < high)).all(axis=2).any(axis=1).sum())

        inside, count = inside + hits(xy), count + len(xy)
        shifted += hits(xy + np.array([0.0, 30.0]))
    assert count > 200
    assert inside > 0.8 * count
    assert shifted < 0.6 * inside


def test_both_cameras_truths_are_of_the_same_vehicles(
    second: RigEventSource, steps: list[SegmentStep], first: RenderedSource, tmp_path: Path
) -> None:
    (tmp_path / "rig.yaml").write_text(second.rig_text(0))
    config = load_config(rig=tmp_path / "rig.yaml")
    way, clock = CommonPicture.of(config).ways["evt"].picture, config.sensors["evt"].clock
    assert way is not None
    assert clock is not None
    errors = []
    for ours, own in zip(first.segment(0), steps, strict=True):
        assert common_time(np.array([1e-6 * own.t_us]), clock)[0] == pytest.approx(1e-6 * ours.t_us, abs=2e-6)
        both, a, b = np.intersect1d(ours.truth.object_id, own.truth.object_id, return_indices=True)
        moved, _ = way.boxes(own.truth.boxes[b])
        for k in range(len(both)):
            one = (own.truth.boxes[b[k]], ours.truth.boxes[a[k]])
            sizes = ((200, 150), (160, 96))
            if all(
                (box[:2] > 0).all() and (box[:2] + box[2:] < size).all()
                for box, size in zip(one, sizes, strict=True)
            ):
                errors.append(moved[k, :2] + moved[k, 2:] / 2 - one[1][:2] - one[1][2:] / 2)
    assert len(errors) > 20
    assert np.sqrt(np.mean(np.square(errors))) < 0.5


def test_segments_of_drawn_rigs_are_seen_from_places_of_their_own() -> None:
    source = RigEventSource(load_scenario("day"), small({}), 5, 1, "fixed", DRAWN)
    rigs = [source.rig_of(index) for index in (0, 1, 0)]
    assert rigs[0].config == rigs[2].config != rigs[1].config
    assert all(rig.reading(np.zeros(1))[0] >= 0.0 for rig in rigs)
    assert source.calibration_of(1)["position_m"] != source.calibration_of(0)["position_m"]
    assert source.settings()["rig"] == "drawn"


@pytest.mark.parametrize(
    ("change", "said"), [({"offset_s": -1.0}, "clock begins below 0"), ({"late_s": 1.0}, "begin together")]
)
def test_rigs_that_cannot_be_rendered_are_refused(change: dict[str, float], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        RigEventSource(load_scenario("day"), small({}), 5, 1, "fixed", replace(RIG, **change))


def test_the_command_writes_a_set_of_each_camera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.yaml").write_text("{width: 96, height: 64, focal_px: 80, offset_s: 1.5}")
    command = [
        "simulate",
        "day",
        "--sensors",
        "pictures",
        "--size",
        "96x64",
        "--frames",
        "2",
        "--workers",
        "1",
    ]
    out = tmp_path / "sim"
    assert main([*command, "--rig", str(tmp_path / "mine.yaml"), "--video", "png", "--out", str(out)]) == 0
    for name in ("rgb", "evt"):
        assert main(["simulate", "--verify", str(out / name)]) == 0
    assert load_config(rig=out / "rigs" / "000000.yaml").sensors["evt"].clock.offset_s == 1.5
    rows = (out / "evt" / "segments" / "000000" / "gt.csv").read_text().splitlines()
    assert float(rows[1].split(",")[0]) > 1.5
    assert main([*command[:2], "--sensors", "rgb", "--rig", "drawn", "--out", str(tmp_path / "no")]) == 2
    assert "--rig does not go with --sensors rgb" in capsys.readouterr().err
