"""Events and frames are put on one clock by what their files say of it."""

from __future__ import annotations

from jeat_graph.io.events.frame_clock import FrameClock, events_later_us

EPOCH_US = 1_606_500_000_123_456


def test_a_file_whose_frames_are_its_own_needs_nothing():
    clock = FrameClock(first_s=0.02, origin_s=EPOCH_US / 1e6)
    assert events_later_us(0, EPOCH_US, clock) == (0, "")


def test_frames_since_1970_beside_events_that_know_their_origin():
    later, said = events_later_us(0, EPOCH_US, FrameClock(first_s=1_606_500_001.0, origin_s=0.0))
    assert later == EPOCH_US
    assert "1606500000.123456 s are added" in said


def test_two_recordings_that_both_know_their_origin_keep_the_difference():
    later, said = events_later_us(0, EPOCH_US, FrameClock(first_s=0.0, origin_s=(EPOCH_US - 250_000) / 1e6))
    assert later == 250_000
    assert "0.25 s are added" in said


def test_a_video_from_zero_beside_events_since_1970_begins_with_them_and_that_is_said():
    later, said = events_later_us(EPOCH_US, 0, FrameClock(first_s=0.0, origin_s=0.0))
    assert later == 0
    assert "both are taken to begin together" in said


def test_an_offset_that_is_no_date_is_added_as_the_data_set_says():
    assert events_later_us(49_599_300_523, 0, FrameClock(49_599.3, 0.0)) == (49_599_300_523, "")
    assert events_later_us(49_599_300_523, 0, None) == (49_599_300_523, "")
