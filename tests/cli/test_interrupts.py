"""Ctrl-C and its like, whenever they come: the command tidies up, says so in one line, and ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import warnings

import pytest

from jeat_graph.cli import main as entry
from jeat_graph.cli import terminal
from jeat_graph.cli.terminal import Terminated, in_good_order

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
both = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
LONG_S = 60.0  # it never takes as long

# A command that is interrupted when it begins to load a module.
LOADING = """
import signal, sys

class Finder:
    def find_spec(self, name, *_):
        if name == sys.argv[1]:
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Finder())
from jeat_graph.cli.main import main
sys.exit(main(["track", "none.csv", "--out", "none"]))
"""


@pytest.fixture(autouse=True)
def _as_python_starts():
    """Signals end the process, as when it began: a library that another test tried may have set its own."""
    handlers = {
        signal.SIGINT: signal.default_int_handler,
        signal.SIGTERM: signal.SIG_DFL,
        signal.SIGHUP: signal.SIG_DFL,
    }
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


class Callback:
    """What an object does at its end is a callback, from which no exception gets out."""

    def __init__(self, number):
        self.number = number

    def __del__(self):
        signal.raise_signal(self.number)


@both
def test_a_signal_to_end_ends_in_good_order_and_the_handlers_are_as_before(number):
    before = signal.getsignal(number)
    with pytest.raises(Terminated), in_good_order("track"):
        signal.raise_signal(number)
    assert signal.getsignal(number) == before


@both
def test_a_signal_that_a_library_turns_into_an_error_of_its_own_still_ends_in_good_order(number):
    def a_library_s_import():
        try:
            signal.raise_signal(number)
        except BaseException:
            raise AttributeError("partially initialized module") from None

    with pytest.raises(Terminated) as end, in_good_order("track"):
        a_library_s_import()
    assert end.value.number == number


@both
def test_a_signal_that_comes_within_a_callback_ends_what_follows_it(number, capsys):
    def command():
        Callback(number)
        time.sleep(LONG_S)

    with pytest.raises(Terminated), in_good_order("track"):
        command()
    assert capsys.readouterr().err == ""


@both
def test_a_signal_that_a_library_takes_for_an_error_that_it_can_forget_comes_once_more(number):
    def a_library():
        try:
            signal.raise_signal(number)
        except BaseException:
            return

    def command():
        a_library()
        time.sleep(LONG_S)

    begin = time.monotonic()
    with pytest.raises(Terminated), in_good_order("track"):
        command()
    assert time.monotonic() - begin < LONG_S / 2


def test_no_second_signal_comes_where_the_first_one_got_out():
    steps = []

    def command():
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            time.sleep(20 * terminal._AGAIN_S)
            steps.append("tidied up")

    with pytest.raises(Terminated), in_good_order("track"):
        command()
    assert steps == ["tidied up"]


def test_a_signal_that_got_lost_just_before_the_end_does_not_come_after_it():
    with in_good_order("track"):
        Callback(signal.SIGINT)
    time.sleep(5 * terminal._AGAIN_S)


def test_no_compiled_library_is_interrupted_while_it_sets_itself_up(monkeypatch):
    steps = []

    def set_up():
        signal.raise_signal(signal.SIGINT)
        time.sleep(3 * terminal._AGAIN_S)
        steps.append("set up")

    def command():
        set_up()
        time.sleep(LONG_S)

    monkeypatch.setattr(terminal, "_LOADS_COMPILED", (set_up.__code__,))
    with pytest.raises(Terminated), in_good_order("track"):
        command()
    assert steps == ["set up"]


def test_what_an_interrupt_left_half_made_goes_without_a_word(capsys):
    class HalfMade:
        def __init__(self):
            signal.raise_signal(signal.SIGINT)
            self.handle = 1

        def __del__(self):
            print(self.handle)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(Terminated), in_good_order("track"):
            HalfMade()
    assert capsys.readouterr().err == ""


def test_an_interrupt_within_a_callback_is_told_as_any_other(monkeypatch, capsys, tmp_path):
    def command(args: object) -> int:
        Callback(signal.SIGINT)
        time.sleep(LONG_S)
        return 0

    monkeypatch.setattr("jeat_graph.cli.track_command.run", command)
    assert entry.main(["track", "d.csv", "--out", str(tmp_path)]) == 130
    assert capsys.readouterr().err == "jeat-graph track: interrupted\n"


@pytest.mark.parametrize("module", ["jeat_graph.cli.options", "numpy", "jeat_graph.cli.track_command"])
def test_an_interrupt_while_a_command_is_loaded_is_one_line(module, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", LOADING, module], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (130, "jeat-graph track: interrupted\n")


def test_an_interrupt_before_the_command_is_known_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(entry, "build_parser", lambda _: signal.raise_signal(signal.SIGINT))
    assert entry.main(["--help"]) == 130
    assert capsys.readouterr().err == "jeat-graph: interrupted\n"
