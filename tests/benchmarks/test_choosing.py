"""The search for constants, on scores whose best point is known in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import pytest

from benchmarks.choosing import REPEATED, TRIED, Gain, choose


class Place(NamedTuple):
    x: int = 0
    y: int = 0


@dataclass(frozen=True)
class Step:
    name: str
    by: int

    def __call__(self, place: Place) -> Place:
        return place._replace(**{self.name: getattr(place, self.name) + self.by})


STEPS = [Step(name, by) for name in "xy" for by in (-1, 1)]


def judged_by(score, error=0.0):
    return lambda base, points: [Gain(float(score(one) - score(base)), error) for one in points]


@pytest.mark.parametrize("best", [(3, -4), (0, 2), (0, 0)])
def test_of_a_sum_of_parabolas_the_top_is_found_in_one_sweep(best):
    found = choose(Place(), STEPS, judged_by(lambda p: -((p.x - best[0]) ** 2) - 2 * (p.y - best[1]) ** 2))
    assert found.point == best
    assert len(found.moves) == sum(map(abs, best))
    assert (found.tried, found.gained) == (4, sum(one != 0 for one in best))


@pytest.mark.parametrize("error", [0.5, 2.0, 4.0, 100.0])
def test_a_move_has_to_gain_more_than_its_error(error):
    """From a distance d of the top a step gains 2d − 1."""
    found = choose(Place(), STEPS, judged_by(lambda p: -((p.x - 4) ** 2), error))
    stopped = next(d for d in range(4, -1, -1) if 2 * d - 1 <= error)
    assert found.point == Place(4 - stopped, 0)


def test_a_move_is_repeated_so_often_in_a_sweep_at_most():
    judge = judged_by(lambda p: p.x)
    assert choose(Place(), STEPS, judge).point == Place(REPEATED, 0)
    assert choose(Place(), STEPS, judge, 3).point == Place(3 * REPEATED, 0)


def test_what_gains_alone_but_not_on_top_of_another_is_not_taken():
    found = choose(
        Place(), STEPS, judged_by(lambda p: 3 * (p.x == 1) + 2 * (p.y == 1) - 4 * (p.x * p.y == 1))
    )
    assert found.moves == (Step("x", 1),)
    assert found.gained == 2


def test_a_parameter_moves_one_way_in_a_sweep_and_back_in_the_next():
    """Y pulls x: after the first sweep x is one too far."""
    judge = judged_by(lambda p: -10 * abs(p.y - 3) - abs(p.x - 3 + p.y))
    assert choose(Place(), STEPS, judge, 1).point.y == 3
    assert choose(Place(), STEPS, judge, 3).point == Place(0, 3)


def test_only_so_many_moves_are_tried_in_a_sweep():
    moves = [Step("x", k) for k in range(1, 2 * TRIED)]
    asked = []

    def judge(base, points):
        asked.append(len(points))
        alone = len(points) > 1
        return [Gain(float(one.x) if alone else -1.0) for one in points]

    found = choose(Place(), moves, judge)
    assert found.gained == len(moves)
    assert asked == [len(moves)] + [1] * TRIED
    assert found.moves == ()
