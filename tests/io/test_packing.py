"""Nested plain data and arrays as a text and bytes: what comes out is what went in, and nothing else can."""

from __future__ import annotations

import json
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from jeat_graph.data.errors import DataError
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.io.files.packing import pack, plain_codec, unpack


class Point(NamedTuple):
    x: Any
    y: Any


@dataclass
class Box:
    content: Any


CODECS = {"Point": plain_codec(Point), "Box": plain_codec(Box)}

plain = st.one_of(
    st.none(), st.booleans(), st.integers(-(2**40), 2**40), st.floats(allow_nan=False), st.text(max_size=3)
)
arrays = st.one_of(
    hnp.arrays(kind, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4))
    for kind in ("f8", "i8", "i4", "u1", "?")
)
trees = st.recursive(
    plain | arrays | st.builds(slice, st.integers(0, 9), st.integers(0, 9)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.lists(inner, max_size=4).map(tuple),
        st.lists(inner, max_size=4).map(deque),
        st.dictionaries(st.integers() | st.text(max_size=2), inner, max_size=3),
        st.builds(Point, inner, inner),
        st.builds(Box, inner),
    ),
    max_leaves=25,
)


def assert_same(one, other):
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.tobytes() == other.tobytes()
    elif isinstance(one, list | tuple | deque):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    elif isinstance(one, dict):
        assert list(one) == list(other)
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, Box):
        assert_same(one.content, other.content)
    else:
        assert one == other


@given(trees)
def test_what_is_unpacked_is_what_was_packed(tree):
    assert_same(unpack(*pack(tree, CODECS), CODECS), tree)


def test_records_keep_every_bit_and_constant_fields_are_kept_once():
    rng = np.random.default_rng(0)
    rows = np.zeros(200, dtype=MEASUREMENT)
    rows["z"], rows["nis"], rows["sensor"] = rng.normal(size=(200, 2)), np.nan, rng.integers(0, 2, 200)
    text, block = pack([rows[:50], rows[50:], rows[:0]], {})
    first, second, none = unpack(text, block, {})
    assert np.concatenate([first, second]).tobytes() == rows.tobytes()
    assert none.dtype == MEASUREMENT
    assert len(none) == 0
    assert len(block) < 200 * (2 * 8 + 1) + 30 * 8


@pytest.mark.parametrize("shapes", [[(0,)], [(0,), (0,)], [(0, 3)], [(2, 0), (1, 4)], [(1,)]])
def test_records_of_which_there_are_none_come_back_as_none(shapes):
    tree = [np.ones(shape, dtype=MEASUREMENT) for shape in shapes]
    assert_same(unpack(*pack(tree, {}), {}), tree)


def test_an_object_that_stands_in_several_places_is_one_object_again():
    shared = Box([np.arange(3)])
    first, (second,), third = unpack(*pack((shared, [shared], Point(shared, 1)), CODECS), CODECS)
    assert first is second
    assert third.x is first


def test_arrays_that_are_read_can_be_written_and_share_nothing():
    one, other = unpack(*pack([np.zeros(3), np.zeros(3)], {}), {})
    one[0] = 1.0
    assert other[0] == 0.0


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"kinds": [], "tree": {"object": ["Popen", [0], 0, 1, [["args", ["ls"]]]]}}),
        json.dumps({"kinds": ["|O"], "tree": {"array": [0, [[[1]]], [0, "|O", 1, 1]]}}),
        json.dumps({"kinds": ["<f8"], "tree": {"array": [0, [[[9]]], [0, "<f8", 9, 9]]}}),
        json.dumps({"kinds": ["<f8"], "tree": {"array": [0, [[[2]]], [0, "<f8", 1, 1]]}}),
        json.dumps({"kinds": [], "tree": {"list": [[2], [1]]}}),
        json.dumps({"kinds": [], "tree": [1, 2]}),
        "{",
        "{}",
    ],
)
def test_what_is_damaged_is_refused_and_no_class_of_its_own_is_made(text):
    with pytest.raises(DataError, match="damaged"):
        unpack(text, bytes(8), CODECS)


def test_what_is_no_plain_data_is_not_packed():
    for strange in (object(), {1, 2}, np.array([object()])):
        with pytest.raises(TypeError, match="cannot be saved"):
            pack({"a": strange}, {})
