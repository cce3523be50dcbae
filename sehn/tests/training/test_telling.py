"""What a training says of itself: soon, then ever more rarely, and how long it goes on."""

from __future__ import annotations

import itertools

import pytest

from jeat_graph_sehn.training.telling import StepsToGo, Telling, spoken_time


class Clock:
    """A clock that stands until it is set."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def test_the_first_line_comes_soon_and_each_next_one_after_twice_as_long():
    clock, said = Clock(), []
    telling = Telling(lambda _: said.append(clock.now), clock)
    for _ in range(5000):
        clock.now += 1.0
        telling.tell("works")
    assert [t - 100.0 for t in said[:5]] == [10.0, 30.0, 70.0, 150.0, 310.0]
    assert max(b - a for a, b in itertools.pairwise(said)) == 600.0


@pytest.mark.parametrize("begun", [0.0, 0.5])
def test_the_time_to_go_is_that_of_the_rest_at_the_same_pace(begun):
    """Of a training that went on from half of it only what was done since counts: a quarter in 60 s."""
    clock, said = Clock(), []
    to_go = StepsToGo(Telling(said.append, clock), begun, clock)
    clock.now += 60.0
    to_go.tell(begun + 0.25, "step 5 of 20")
    assert said == [f"step 5 of 20; about {spoken_time(60.0 * (0.75 - begun) / 0.25)} to go"]


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(40.4, "40 s"), (119.0, "119 s"), (150.0, "2 min"), (7100.0, "118 min"), (9000.0, "2.5 h")],
)
def test_times_are_said_as_one_says_them(seconds, said):
    assert spoken_time(seconds) == said


@pytest.mark.usefixtures("no_plot")
@pytest.mark.parametrize("minutes", [None, 0.03])
def test_a_training_says_sizes_steps_and_the_time_to_go(small_set, tmp_path, monkeypatch, minutes):
    pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")
    from jeat_graph_sehn.training.procedure import TrainRequest, train
    from jeat_graph_sehn.training.settings import NetSettings, TrainSettings

    monkeypatch.setattr("jeat_graph_sehn.training.telling._FIRST_S", 0.0)
    said: list[str] = []
    settings = TrainSettings(
        crop_px=(32, 32), batch=2, epochs=0.5, minutes=minutes, judge_every=0.5, judged=2
    )
    request = TrainRequest((small_set,), tmp_path / "n.onnx", NetSettings(width=2), settings, force=True)
    train(request, said.append)
    told = "\n".join(said)
    assert "small: 0 of 2 segments" in told
    assert "12 pictures to learn from, 12 to judge by" in told
    goal = "trains for 3 steps (0.5 epochs)" if minutes is None else "trains for 0.03 min"
    assert f"{goal}, 2 cut-outs of 32 x 32 px a step" in told
    assert any(line.startswith("step 1") and line.endswith("to go") for line in said)
    assert any("judging 1 of 2 pictures; about" in line for line in said)
    assert "judging 2 of 12 pictures" in told
