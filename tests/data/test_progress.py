"""What loops tell of their progress adds up, and reaches only who still waits."""

from __future__ import annotations

import threading

import pytest

from jeat_graph.data.progress import progress_span, progress_to, with_progress


def test_without_anybody_waiting_the_pieces_are_passed_on():
    assert list(with_progress("abc")) == ["a", "b", "c"]
    with progress_span(0.0, 0.5):
        assert list(with_progress(iter("abc"), 3)) == ["a", "b", "c"]


def test_each_piece_is_an_equal_share():
    shares: list[float] = []
    with progress_to(shares.append):
        assert list(with_progress([1, 2, 3, 4])) == [1, 2, 3, 4]
    assert shares == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_a_loop_within_a_loop_tells_shares_of_the_outer_piece():
    shares: list[float] = []
    with progress_to(shares.append):
        for _ in with_progress(range(2)):
            for _ in with_progress(range(2)):
                pass
    assert shares == [0.0, 0.0, 0.25, 0.5, 0.5, 0.5, 0.75, 1.0, 1.0]


def test_a_portion_is_a_part_of_the_present_piece():
    shares: list[float] = []
    with progress_to(shares.append):
        with progress_span(0.0, 0.2):
            list(with_progress("ab"))
        with progress_span(0.2, 1.0):
            list(with_progress("ab"))
    assert shares == pytest.approx([0.0, 0.0, 0.1, 0.2, 0.2, 0.2, 0.2, 0.6, 1.0, 1.0])


def test_pieces_without_a_number_tell_nothing_and_are_all_there():
    shares: list[float] = []
    with progress_to(shares.append):
        assert list(with_progress(iter("abc"))) == ["a", "b", "c"]
    assert shares == []


def test_more_pieces_than_were_announced_are_no_more_than_the_whole():
    shares: list[float] = []
    with progress_to(shares.append):
        assert len(list(with_progress(iter("abcd"), 2))) == 4
    assert max(shares) == 1.0


def test_a_loop_that_is_left_early_leaves_the_outer_one_as_it_was():
    shares: list[float] = []
    with progress_to(shares.append):
        for _ in with_progress(range(2)):
            for k in with_progress(range(4)):
                if k == 1:
                    break
    assert shares == [0.0, 0.0, 0.125, 0.5, 0.5, 0.625, 1.0]


def test_who_does_not_wait_any_more_is_not_told():
    shares: list[float] = []
    with progress_to(shares.append):
        late = with_progress(range(4))
        next(late)
    list(late)
    assert shares == [0.0]
    assert list(with_progress(range(2))) == [0, 1]
    assert shares == [0.0]


def test_another_thread_is_not_heard():
    shares: list[float] = []
    with progress_to(shares.append):
        other = threading.Thread(target=lambda: list(with_progress(range(3))))
        other.start()
        other.join()
    assert shares == []
