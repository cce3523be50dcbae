"""Confirmation sets the flags of those that earned it and touches no other, whatever the pattern of flags.

With a branch that skips the confirmed, numba (0.68 too) compiles the loop so that the flags of eight tracks
at a time are cleared. So the compiled kernel is compared with NumPy on all patterns of a few tracks, and on
patterns around the widths in which vector instructions take them.
"""

import itertools

import numpy as np
import pytest

from jeat_graph.config.kernel_form import kernel_settings
from jeat_graph.config.reading import load_config
from jeat_graph.tracking.compaction import allocate
from jeat_graph.tracking.stages.ending import confirm

MOST = 64


def flags(bits):
    return np.array(bits, dtype=bool)


def all_of_a_few():
    """Every pattern of flags and of those that earn them, for up to six tracks."""
    for n in range(7):
        for before, earned in itertools.product(itertools.product((0, 1), repeat=n), repeat=2):
            yield flags(before), flags(earned)


def many():
    """Runs of every start and length, each with the odd one out, and random patterns; up to 64 tracks."""
    rng = np.random.default_rng(0)
    for n in (7, 8, 9, 15, 16, 17, 31, 32, 33, 63, MOST):
        place = np.arange(n)
        for start in range(0, n, 3):
            for length in (1, 7, 8, 9, 16, n):
                run = (place >= start) & (place < start + length)
                for before in (run, ~run):
                    yield before, np.zeros(n, dtype=bool)
                    yield before, place == n - 1
        for share in (0.05, 0.5, 0.95):
            for _ in range(20):
                yield rng.random(n) < share, rng.random(n) < 0.5


def after_confirm(settings, before, earned, *, by_existence):
    """Flags and existence of all rows after the kernel; the rows beyond the living tracks are set too."""
    n = len(before)
    tracks = allocate(MOST + 8, 2)
    tracks.confirmed[:] = True
    tracks.confirmed[:n] = before
    tracks.existence[:] = 0.25
    if by_existence:
        tracks.existence[:n] = np.where(earned, settings.lifecycle.confirm_existence, 0.1)
    else:
        tracks.hits[:n] = np.where(earned, settings.lifecycle.confirm_hits, 1)
    existence = tracks.existence.copy()
    confirm(tracks, n, 10.0, settings)
    return tracks.confirmed, tracks.existence, existence


@pytest.mark.parametrize("patterns", [all_of_a_few, many])
def test_a_flag_is_set_where_it_is_earned_and_stays_where_it_was(patterns):
    settings = kernel_settings(load_config("highway"))
    for before, earned in patterns():
        n = len(before)
        found, existence, as_before = after_confirm(settings, before, earned, by_existence=True)
        assert np.array_equal(found[:n], before | earned), (before, earned)
        assert found[n:].all()
        assert np.array_equal(existence, as_before)


@pytest.mark.parametrize("patterns", [all_of_a_few, many])
def test_by_hits_too_and_existence_follows_the_flag(patterns):
    settings = kernel_settings(load_config("paper"))
    for before, earned in patterns():
        n = len(before)
        found, existence, _ = after_confirm(settings, before, earned, by_existence=False)
        assert np.array_equal(found[:n], before | earned), (before, earned)
        assert found[n:].all()
        assert np.array_equal(existence[:n], np.where(before | earned, 1.0, 0.5))
        assert (existence[n:] == 0.25).all()
