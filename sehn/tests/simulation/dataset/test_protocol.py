"""The division into splits."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.dataset.protocol import SPLITS, Protocol


@given(seed=st.integers(0, 10_000), count=st.integers(1, 600))
def test_any_first_segments_have_nearly_the_shares_asked_for(seed: int, count: int) -> None:
    protocol = Protocol(count, seed)
    found = [protocol.split_of(index) for index in range(count)]
    for name, share in zip(SPLITS, protocol.shares, strict=True):
        assert abs(found.count(name) - share * count) < 3.0


@given(shares=st.tuples(*[st.floats(0, 10)] * 3).filter(lambda s: sum(s) > 0.1), index=st.integers(0, 10**6))
def test_a_split_without_a_share_gets_nothing(shares, index) -> None:
    split = Protocol(1, shares=shares).split_of(index)
    assert shares[SPLITS.index(split)] > 0.0


def test_another_seed_divides_otherwise() -> None:
    divisions = {tuple(Protocol(200, seed).split_of(k) for k in range(200)) for seed in range(5)}
    assert len(divisions) == 5


@pytest.mark.parametrize(
    "bad",
    [
        {"segments": 0},
        {"segments": 1, "seed": -1},
        {"segments": 1, "shares": (0.0, 0.0, 0.0)},
        {"segments": 1, "shares": (1.0, -0.1, 0.1)},
        {"segments": 1, "video": "gif"},
        {"segments": 1, "compression": "zip"},
    ],
)
def test_what_makes_no_sense_is_refused(bad) -> None:
    with pytest.raises(ConfigError):
        Protocol(**bad)
