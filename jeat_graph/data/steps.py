"""How many steps of time a recording may be cut into: a wrong time would make more than a memory holds."""

from __future__ import annotations

from jeat_graph.data.errors import DataError
from jeat_graph.data.time_text import exact_text

#: Rows, pictures or intervals, one a step of time: days at any usual rate.
MOST_STEPS = 10_000_000


def check_steps(start_s: float, end_s: float, rate_hz: float, what: str, mend: str = "") -> None:
    """Refuse to go through a time in too many steps.

    Args:
        start_s: its begin (s).
        end_s: its end (s).
        rate_hz: steps per second.
        what: what is made in each, in the plural.
        mend: what helps beside mending a wrong time.

    Raises:
        DataError: says how long the time lasts, and how many steps that would be.
    """
    steps = (end_s - start_s) * rate_hz
    # Numbers that are neither large nor small, infinities among them, are refused too.
    if not steps <= MOST_STEPS:
        raise DataError(
            f"from {exact_text(start_s)} to {exact_text(end_s)} s are "
            f"{(end_s - start_s) / 3600.0:.6g} h, "
            f"and at {rate_hz:.6g} Hz {steps:.6g} {what}, more than {MOST_STEPS}: is one of the times wrong?"
            + (f" Or {mend}" if mend else "")
        )
