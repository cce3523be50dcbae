"""Dates and time codes, to the second and its decimals, or not at all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.time_text import all_seconds, looks_like_time, seconds_of_text

DAY_S = 86_400


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("1970-01-01T00:00:10", 10.0),
        ("1970-01-02", DAY_S),
        ("1970-01-01T00:00:10.040000001", 10.040000001),
        ("1970-01-01T02:00:10.08+02:00", 10.08),
        ("1970-01-01 00:00:10,08", 10.08),
        # Before 1970: a camera whose clock was never set, in a zone east of Greenwich.
        ("1970-01-01T00:30:00+01:00", -1800.0),
        ("1970-01-01T00:30:00.04+01:00", -1799.96),
        ("1969-12-31T23:59:59.5", -0.5),
        ("01:00:00.5", 3600.5),
        ("1:01:01.5", 3661.5),
        ("02:03", 123.0),
    ],
)
def test_what_a_text_is_in_seconds(text, seconds):
    assert seconds_of_text(text) == seconds


@pytest.mark.parametrize(
    "text",
    [
        "1970-01-01T12:30.5",  # a fraction of a minute in ISO 8601, taken for one of a second by Python
        "1970-01-01T12.5",
        "1970-01-01T123000.5",
        "1970-01-01T12:30:00+02:00:30.5",
        "1970-01-01T12:30:00.",
        "1970-13-01",
        "1970-01-01T25:00",
        "00:61:00",
        "12:60",
    ],
)
def test_what_is_meant_as_a_time_and_is_none_is_not_guessed(text):
    assert seconds_of_text(text) is None


def test_frames_of_a_time_code_need_a_rate_and_hours():
    assert seconds_of_text("01:00:01:05", 25.0) == 3601.2
    assert seconds_of_text("00:00:01;05", 25.0) == 1.2
    assert seconds_of_text("00:00:01:05") is None
    # Hours and no frames, as without a rate.
    assert seconds_of_text("00:01:05", 25.0) == 65.0


@given(
    st.datetimes(allow_imaginary=False).filter(lambda moment: 1900 < moment.year < 2200),
    st.integers(-23, 23),
)
def test_a_date_is_what_python_says_it_is(moment, hours):
    zone = f"{'-' if hours < 0 else '+'}{abs(hours):02d}:00"
    text = f"{moment:%Y-%m-%dT%H:%M:%S}.{moment.microsecond:06d}"
    since = (moment - type(moment)(1970, 1, 1)).total_seconds()
    assert seconds_of_text(text) == pytest.approx(since, abs=1e-6)
    assert seconds_of_text(text + zone) == pytest.approx(since - 3600 * hours, abs=1e-6)


def test_what_looks_like_a_time():
    assert looks_like_time(" 2026-13-01 ")
    assert looks_like_time("00:01:02.5")
    assert not looks_like_time("12.5")
    assert not looks_like_time("yesterday")


def refusal(row: int, message: str) -> ValueError:
    return ValueError(f"{row}: {message}")


def test_numbers_among_dates_are_seconds():
    found = all_seconds(["1970-01-01T00:00:10.5", "11.5", "00:00:12"], refusal)
    np.testing.assert_array_equal(found, [10.5, 11.5, 12.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nan", "1: t must be a finite number, got nan"),
        ("-inf", "1: t must be a finite number, got -inf"),
        ("1e999", "1: t must be a finite number, got inf"),
        ("soon", "1: t must be a time, got 'soon'; known are a number, a date"),
        ("00:00:12:05", "1: t must be a time, got '00:00:12:05'; give the rate of its frames"),
    ],
)
def test_what_stands_among_dates_and_is_no_time_is_refused_with_its_row(text, message):
    with pytest.raises(ValueError, match=message):
        all_seconds(["1970-01-01", text], refusal)
