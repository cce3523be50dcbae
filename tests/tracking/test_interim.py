"""While others compile, kernels are interpreted; then they are called as machine code."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from numba import njit

from jeat_graph import Tracker
from jeat_graph.tracking import interim
from jeat_graph.tracking.step import step

pytestmark = pytest.mark.skipif(not hasattr(step, "overloads"), reason="nothing is compiled")


def kernel_of(part):
    """A kernel that nobody has called, of a part of the package."""

    def doubled(x, more=1.0):
        return 2.0 * x + more

    doubled.__module__ = f"jeat_graph.{part}.somewhere"
    return njit(doubled)


@pytest.fixture
def meanwhile(monkeypatch):
    """Begins an interim that the test ends by setting `over`."""
    state = {"over": False, "impatient": 0}

    def complain():
        state["impatient"] += 1

    def begin(patience_s=math.inf):
        interim.begin(interim.Interim(lambda: state["over"], lambda: patience_s, complain))
        return state

    monkeypatch.setattr(interim, "_POLL_S", 0.0)
    yield begin
    interim.end()


@pytest.mark.parametrize("part", ["tracking", "filters", "association", "smoothers"])
def test_kernels_of_the_tracker_are_interpreted_until_they_are_compiled(part, meanwhile):
    kernel = kernel_of(part)
    state = meanwhile()
    assert (kernel(3.0), kernel(3.0, 4.0)) == (7.0, 10.0)
    assert not kernel.overloads
    state["over"] = True
    assert (kernel(3.0), kernel(3.0, 4.0)) == (7.0, 10.0)
    assert len(kernel.overloads) == 2
    assert state["impatient"] == 0


def test_others_are_compiled_at_once(meanwhile):
    meanwhile()
    for part in ("detection", "drawing", "road", "io"):
        kernel = kernel_of(part)
        assert kernel(3.0) == 7.0
        assert kernel.overloads


def test_other_parts_can_be_named(meanwhile):
    interim.begin(interim.Interim(lambda: False, parts=("jeat_graph.detection.",)))
    one, other = kernel_of("detection"), kernel_of("tracking")
    assert (one(3.0), other(3.0)) == (7.0, 7.0)
    assert (len(one.overloads), len(other.overloads)) == (0, 1)


def test_nothing_is_interpreted_before_and_after(meanwhile):
    meanwhile()
    interim.end()
    kernel = kernel_of("tracking")
    assert kernel(3.0) == 7.0
    assert kernel.overloads
    assert interim.stand_in(kernel_of("tracking")) is None


def test_what_is_compiled_already_stays_so(meanwhile, monkeypatch):
    kernel = kernel_of("filters")
    kernel(1.0, 2.0)
    meanwhile()
    monkeypatch.setattr(interim, "stand_in", lambda kernel: pytest.fail("is interpreted"))
    # Both arguments given: a default's type goes by the identity of its value, and may be another one.
    assert kernel(3.0, 1.0) == 7.0


def test_patience_ends_with_the_time_that_was_spent(meanwhile):
    kernel = kernel_of("tracking")
    state = meanwhile(patience_s=0.0)
    assert kernel(3.0) == 7.0  # nothing is spent yet
    assert not kernel.overloads
    assert kernel(3.0) == 7.0
    assert kernel.overloads
    assert state["impatient"] == 1


def test_a_kernel_that_fails_fails_as_itself(meanwhile):
    def wrong(x):
        raise ValueError("no such track")

    wrong.__module__ = "jeat_graph.tracking.somewhere"
    meanwhile()
    with pytest.raises(ValueError, match="no such track"):
        njit(wrong)(1.0)


def scans():
    rng = np.random.default_rng(4)
    for k in range(30):
        boxes = np.array([[100.0 + 6 * k, 90.0, 40.0, 30.0], [700.0 - 9 * k, 200.0, 60.0, 45.0]])
        yield 0.05 * k, "rgb", boxes + rng.normal(size=boxes.shape), np.array([0.9, 0.6])


def test_a_tracker_goes_on_with_machine_code_where_it_was(meanwhile):
    changing, compiled = Tracker(), Tracker()
    expected = [compiled.step([scan]) for scan in scans()]
    state = meanwhile()
    for k, (scan, table) in enumerate(zip(scans(), expected, strict=True)):
        state["over"] = k >= 12
        ours = changing.step([scan])
        np.testing.assert_array_equal(ours.mean, table.mean)
        np.testing.assert_array_equal(ours.var, table.var)
        assert (changing._step._code is None) is (k < 12)
    assert len(expected[-1]) == 2
    np.testing.assert_array_equal(changing.finish().mean, compiled.finish().mean)


# What the command line does on a machine where nothing is compiled: it must not wait for the compiler.
COLD = """
import gc, sys
from numba.core.dispatcher import Dispatcher
from jeat_graph.cli.main import main
from jeat_graph.tracking import interim
code = main(["track", sys.argv[1], "--out", sys.argv[2]])
compiled = [
    k.py_func.__qualname__
    for k in gc.get_objects()
    if isinstance(k, Dispatcher) and k.overloads and k.py_func.__module__.startswith(interim.TRACKER)
]
assert not compiled, compiled
sys.exit(code)
"""


def test_track_begins_at_once_where_nothing_is_compiled(tmp_path, monkeypatch):
    source = tmp_path / "detections.csv"
    rows = [
        f"{t:.2f},{sensor},{left:.1f},{top:.1f},{width:.1f},{height:.1f},{score}\n"
        for t, sensor, boxes, scores in scans()
        for (left, top, width, height), score in zip(boxes, scores, strict=True)
    ]
    source.write_text("t,sensor,left,top,width,height,score\n" + "".join(rows))
    for out, cache in (("cold", str(tmp_path / "cache")), ("warm", None)):
        with monkeypatch.context() as process:
            if cache is not None:
                process.setenv("NUMBA_CACHE_DIR", cache)
            script = (
                COLD
                if cache is not None
                else "import sys; from jeat_graph.cli.main import main; "
                + ("sys.exit(main(['track', sys.argv[1], '--out', sys.argv[2]]))")
            )
            done = subprocess.run(
                [sys.executable, "-c", script, str(source), str(tmp_path / out)],
                capture_output=True,
                text=True,
                check=False,
            )
        assert done.returncode == 0, done.stderr
        assert ("is not compiled for this machine yet" in done.stderr) is (out == "cold")
    for name in ("causal.csv", "smoothed.csv"):
        assert (tmp_path / "cold" / name).read_bytes() == (tmp_path / "warm" / name).read_bytes()
