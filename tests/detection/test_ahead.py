"""Streams that threads make are what they are without threads, errors and early ends included."""

from __future__ import annotations

import gc
import threading
import time

import numpy as np
import pytest

from jeat_graph.core import detection as core
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.ahead import Ahead


def scans(count: int, made: list[int] | None = None):
    for k in range(count):
        if made is not None:
            made.append(k)
        yield Scan(float(k), "rgb", np.zeros((0, 4)), np.zeros(0))


def test_all_scans_come_in_their_order():
    assert [scan.t for scan in Ahead(scans(100))] == [float(k) for k in range(100)]


def test_what_goes_wrong_is_told_where_it_happened():
    def broken():
        yield from scans(3)
        raise DataError("is damaged", "file")

    found = []
    with pytest.raises(DataError, match="is damaged"):
        found.extend(Ahead(broken()))
    stream = Ahead(broken())
    assert [next(stream).t for _ in range(3)] == [0.0, 1.0, 2.0]
    with pytest.raises(DataError, match="is damaged"):
        next(stream)


def test_whoever_stops_asking_stops_the_work():
    made: list[int] = []
    before = threading.active_count()
    stream = Ahead(scans(100_000, made))
    assert next(stream).t == 0.0
    stream.close()
    assert threading.active_count() == before
    assert len(made) < 100


def test_the_work_begins_before_anybody_asks():
    begun = threading.Event()

    def beginning():
        begun.set()
        yield from scans(1)

    stream = Ahead(beginning())
    assert begun.wait(10.0)
    stream.close()
    assert list(stream) == []
    stream.close()


def test_what_nobody_closes_ends_with_whoever_had_it():
    before = threading.active_count()
    stream = Ahead(scans(100_000))
    next(stream)
    del stream
    gc.collect()
    assert threading.active_count() == before


@pytest.mark.parametrize("asked", [1, 5])
def test_what_goes_wrong_when_a_stream_is_closed_is_told_too(asked):
    class Items:
        left = 3

        def __iter__(self):
            return self

        def __next__(self):
            self.left -= 1
            if self.left < 0:
                raise StopIteration
            return self.left

        def close(self):
            raise DataError("cannot be closed", "file")

    stream = Ahead(Items(), most=1)
    if asked > 3:
        with pytest.raises(DataError, match="cannot be closed"):
            list(stream)
    else:
        assert next(stream) == 2
        stream.close()
    assert list(stream) == []


def test_at_the_end_there_is_nothing_more_and_no_thread():
    before = threading.active_count()
    stream = Ahead(scans(3))
    assert len(list(stream)) == 3
    assert next(stream, None) is None
    assert threading.active_count() == before


def test_what_a_stream_has_open_is_closed_in_its_thread_before_anything_else_ends():
    closed = []

    def opened():
        try:
            yield from scans(100)
        finally:
            closed.append(threading.current_thread() is not threading.main_thread())

    stream = Ahead(opened())
    next(stream)
    stream.close()
    assert closed == [True]


def test_kernels_let_other_threads_run():
    """One that does not stops the other camera's thread as long as it runs."""
    pictures = np.random.default_rng(1).integers(0, 256, (25, 400, 600)).astype(np.uint8)
    begun, done, turns = threading.Event(), threading.Event(), 0

    def learn():
        begun.set()
        core.middle_and_spread(pictures)
        done.set()

    thread = threading.Thread(target=learn)
    thread.start()
    begun.wait()
    while not done.is_set():
        turns += 1
        time.sleep(0.001)
    thread.join()
    assert turns > 10
