"""When a taught network is kept, and why not."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph_sehn.teaching.gain import Held, TeachingOutcome, compared

NAN = float("nan")


def test_the_gain_is_as_sure_as_the_pieces_agree():
    before = Held(50.0, np.array([40.0, 60.0, NAN]), np.array([30.0, 10.0, 0.0]))
    after = Held(56.0, np.array([44.0, 68.0, NAN]), np.array([30.0, 10.0, 0.0]))
    found = compared(before, after, 70.0, 69.5)
    # Differences 4 and 8 with weights 3/4 and 1/4: mean 5, and √(((3/4)² 1² + (1/4)² 3²) · 2 / 1) = 3/2.
    assert found.sigma == pytest.approx(1.5)
    assert (found.gain, found.lost) == (6.0, 0.5)
    assert found.described() == [
        "own road, held back: AP50 50.0 -> 56.0 (+6.0 ± 1.5)",
        "old worlds: AP50 70.0 -> 69.5 (-0.5)",
    ]


@pytest.mark.parametrize(
    ("outcome", "why"),
    [
        (TeachingOutcome(50.0, 58.0, 2.0, 70.0, 69.5), None),
        (TeachingOutcome(50.0, 58.0, NAN, NAN, NAN), None),
        (TeachingOutcome(50.0, 50.9, 0.1, 70.0, 70.0), "gained 0.9 points of AP50, and 1 are asked for"),
        (TeachingOutcome(50.0, 40.0, 0.1, 70.0, 70.0), "gained -10.0 points"),
        (TeachingOutcome(50.0, 53.0, 4.0, 70.0, 70.0), "no more than chance (4.0)"),
        (
            TeachingOutcome(50.0, 58.0, 2.0, 70.0, 68.5),
            "lost 1.5 points of AP50 on old worlds",
        ),
        (TeachingOutcome(NAN, NAN, NAN, NAN, NAN), "gained nan points"),
    ],
)
def test_what_did_not_gain_or_forgot_is_refused(outcome, why):
    found = outcome.refusal(1.0, 1.0)
    assert found is None if why is None else why in found
