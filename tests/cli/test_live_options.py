"""Cameras that are on and files are distinguished, and what says nothing of one of them is refused."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            ["detect", "--frames", "a.mp4", "--duration", "3", "--out", "x.csv"],
            "--duration is of cameras that",
        ),
        (["detect", "--frames", "0", "--events", "a.raw", "--out", "x.csv"], "or both files"),
        (["stream", "--frames", "a.mp4"], "`track` takes files"),
        (["stream", "--duration", "3"], "it needs --frames or --events"),
        (["stream", "--frames", "0", "--source", "nats://h/x"], "leave it out"),
        (["track", "a.csv", "--duration", "3", "--out", "run"], "--duration is of cameras that are on"),
    ],
)
def test_what_does_not_go_together_is_refused(given, words, fails):
    assert words in fails(*given)
