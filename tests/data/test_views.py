"""Ways to look at trajectory tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories


@pytest.fixture
def table():
    rng = np.random.default_rng(1)
    n = 12
    return Trajectories(
        t=np.repeat(np.arange(4) * 0.5, 3),
        track_id=np.tile([1, 2, 5], 4),
        boxes=rng.uniform(1.0, 50.0, (n, 4)),
        existence=rng.uniform(0.5, 1.0, n),
        mean=rng.normal(0.0, 10.0, (n, 6)),
        var=rng.uniform(0.1, 2.0, (n, 6)),
        used=np.array([0, 1, 2, 3] * 3),
        sensors=("evt", "rgb"),
        size_var=rng.uniform(0.1, 2.0, (n, 2)),
    )


def test_a_table_survives_the_way_to_pandas_and_back(table):
    frame = table.to_pandas()
    assert list(frame.columns[:6]) == ["t", "track_id", "left", "top", "width", "height"]
    assert frame.sensors.tolist()[:4] == ["", "evt", "rgb", "evt|rgb"]
    back = Trajectories.from_pandas(frame)
    for name in ("t", "track_id", "boxes", "existence", "mean", "var", "used", "size_var"):
        assert np.array_equal(getattr(back, name), getattr(table, name)), name
    assert back.sensors == table.sensors
    old = Trajectories.from_pandas(frame.drop(columns=["var_width", "var_height"]))
    assert np.isnan(old.size_var).all()


def test_a_missing_column_is_named(table):
    with pytest.raises(DataError, match="existence"):
        Trajectories.from_pandas(table.to_pandas().drop(columns="existence"))


def test_a_frame_of_the_written_table_is_read(tmp_path, table):
    from jeat_graph.io.tables.trajectories_io import write_trajectories

    write_trajectories(table, tmp_path / "causal.csv")
    back = Trajectories.from_pandas(pd.read_csv(tmp_path / "causal.csv"))
    assert np.allclose(back.mean, table.mean, atol=1e-3)
    assert np.array_equal(back.used, table.used)


def test_one_track_and_a_span_of_time(table):
    assert table.of(2).track_id.tolist() == [2] * 4
    assert len(table.of(99)) == 0
    assert table.between(0.5, 1.0).t.tolist() == [0.5] * 3 + [1.0] * 3


def test_corners_centres_velocities_and_covariances(table):
    assert np.allclose(table.xyxy[:, 2:] - table.xyxy[:, :2], table.boxes[:, 2:])
    assert np.array_equal(table.center, table.mean[:, :2])
    assert np.array_equal(table.velocity, table.mean[:, 2:4])
    assert np.array_equal(np.diagonal(table.covariance, axis1=1, axis2=2), table.var[:, :2])


def test_supervision_takes_the_tracks(table):
    sv = pytest.importorskip("supervision")
    now = table.between(0.5, 0.5).to_supervision()
    assert isinstance(now, sv.Detections)
    assert now.tracker_id.tolist() == [1, 2, 5]
    assert np.allclose(now.xyxy, table.between(0.5, 0.5).xyxy)


def test_the_summary_is_short_and_says_how_much_there_is(table):
    text = repr(table)
    assert text.startswith("Trajectories: 12 rows, 3 tracks, 0 to 1.5 s")
    assert text.count("\n") == 9
    assert repr(Trajectories.empty()) == "Trajectories: no tracks"
    assert "<script" not in Trajectories.empty(("<script>",))._repr_html_()
    assert table._repr_html_().count("<tr>") == 9


@pytest.mark.parametrize("kind", ["picture", "timeline", "speed"])
def test_plots_have_a_line_a_track(table, kind):
    import matplotlib as mpl

    mpl.use("Agg")
    assert len(table.plot(kind).lines) == 3


def test_another_kind_of_plot_is_refused(table):
    with pytest.raises(DataError, match="timeline"):
        table.plot("pie")


@pytest.fixture
def named(table):
    """Track 1 a van that is later taken for a car, track 2 a bus, track 5 not known."""
    kinds = ["van", "bus", ""] * 2 + ["car", "bus", ""] * 2
    share = np.where(np.array(kinds) == "", np.nan, 0.5)
    return replace(table, classes=np.array(kinds), class_probability=share)


def test_classes_are_seen_in_every_view(named):
    frame = named.to_pandas()
    assert list(frame.columns)[-4:-2] == ["class", "class_probability"]
    assert Trajectories.from_pandas(frame).classes.tolist() == named.classes.tolist()
    assert "van 1 at" in repr(named)
    assert "track 5 at" in repr(named)
    assert "<th>class</th>" in named._repr_html_()
    sv = pytest.importorskip("supervision")
    now = named.between(0.5, 0.5).to_supervision()
    assert isinstance(now, sv.Detections)
    assert now.data["class_name"].tolist() == ["van", "bus", ""]
    assert len(set(now.class_id.tolist())) == 3


def test_rows_are_chosen_by_the_class_of_now_or_of_the_end(named, table):
    assert named.of_class("van").track_id.tolist() == [1, 1]
    assert named.of_class("car", "bus", final=True).track_id.tolist() == [1, 2] * 4
    assert named.final_classes() == {1: "car", 2: "bus", 5: ""}
    with pytest.raises(DataError, match="bus, car, van"):
        named.of_class("truck")
    with pytest.raises(DataError, match="no detection has one"):
        table.of_class("car")


def test_tables_with_and_without_classes_join(named, table):
    whole = Trajectories.concatenate([table, named])
    assert whole.classes.tolist() == [""] * len(table) + named.classes.tolist()
    assert np.isnan(whole.class_probability[: len(table)]).all()
    with pytest.raises(DataError, match="both or neither"):
        replace(named, class_probability=None)


def test_the_last_moment_s_boxes_are_drawn_over_a_picture_with_their_numbers(table):
    axes = table.plot(picture=np.zeros((90, 160, 3), dtype=np.uint8))
    now = table.t == table.t.max()
    drawn = [(*patch.get_xy(), patch.get_width(), patch.get_height()) for patch in axes.patches]
    assert sorted(drawn) == sorted(map(tuple, table.boxes[now].tolist()))
    assert sorted(text.get_text() for text in axes.texts) == sorted(map(str, table.track_id[now].tolist()))
    assert (axes.get_xlim(), axes.get_ylim()) == (
        (-0.5, 159.5),
        (89.5, -0.5),
    )  # the picture, the right way up


def test_curves_go_over_no_picture(table):
    with pytest.raises(DataError, match="goes over no picture"):
        table.plot("speed", picture=np.zeros((9, 16)))
