"""Streams that threads make are what they are without threads, errors and early ends included."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.ahead import ahead


def scans(count: int, made: list[int] | None = None):
    for k in range(count):
        if made is not None:
            made.append(k)
        yield Scan(float(k), "rgb", np.zeros((0, 4)), np.zeros(0))


def test_all_scans_come_in_their_order():
    assert [scan.t for scan in ahead(scans(100))] == [float(k) for k in range(100)]


def test_what_goes_wrong_is_told_where_it_happened():
    def broken():
        yield from scans(3)
        raise DataError("is damaged", "file")

    found = []
    with pytest.raises(DataError, match="is damaged"):
        found.extend(ahead(broken()))
    stream = ahead(broken())
    assert [next(stream).t for _ in range(3)] == [0.0, 1.0, 2.0]
    with pytest.raises(DataError, match="is damaged"):
        next(stream)


def test_whoever_stops_asking_stops_the_work():
    made: list[int] = []
    before = threading.active_count()
    stream = ahead(scans(100_000, made))
    assert next(stream).t == 0.0
    stream.close()
    assert threading.active_count() == before
    assert len(made) < 100


def test_what_a_stream_has_open_is_closed_in_its_thread_before_anything_else_ends():
    closed = []

    def opened():
        try:
            yield from scans(100)
        finally:
            closed.append(threading.current_thread() is not threading.main_thread())

    stream = ahead(opened())
    next(stream)
    stream.close()
    assert closed == [True]
