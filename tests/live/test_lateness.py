"""How late scans were, in words."""

from __future__ import annotations

import pytest

from jeat_graph.live.lateness import LatenessCounter


@pytest.mark.parametrize(
    ("late_s", "text"),
    [
        ([0.0] * 98 + [0.02, 0.03], "2 of 100 scans late, median 0 ms, 99 % within 20 ms"),
        ([0.0] * 90 + [60.0] * 10, "10 of 100 scans late, median 0 ms, more than 1 % by more than 9.999 s"),
        ([0.0] * 20 + [3600.0] * 80, "80 of 100 scans late, most by more than 9.999 s"),
    ],
)
def test_what_is_later_than_what_is_counted_is_said_to_be_so(late_s, text):
    counter = LatenessCounter()
    for one in late_s:
        counter.add("rgb", one, dropped=False)
    assert counter.summary()["rgb"].text() == text


def test_the_greatest_lateness_there_is_can_be_counted():
    counter = LatenessCounter()
    counter.add("rgb", 1.7e308 - -1.7e308, True)
    assert counter.summary()["rgb"].dropped == 1
    assert counter.summary()["rgb"].max_s < float("inf")
