"""An interrupt that comes when compiled code has just made its events ends Python in good order."""

from __future__ import annotations

import subprocess
import sys

import pytest

# Compiled code calls the class to give Python a sink; there, at the latest, Python deals with a signal.
SCRIPT = """
import sys
from dataclasses import replace
from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
from jeat_graph_sehn.simulation.imaging.event_sink import EventSink
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario

imaging = ImagingConfig()
render = replace(imaging.render, width=16, height=16)
imaging = replace(imaging, render=render, evt=replace(imaging.evt, mode=sys.argv[1]))
source = RenderedSource(load_scenario("night"), imaging, seed=0, frames=2)
made, make = [], EventSink.__new__

def interrupted(cls, *columns):
    made.append(cls)
    if len(made) > 1:  # the first is what is filled
        raise KeyboardInterrupt
    return make(cls, *columns)

EventSink.__new__ = interrupted
try:
    for _ in source.segment(0):
        pass
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.parametrize("mode", ["physical", "carla"])
def test_an_interrupt_while_events_are_given_to_python_does_not_crash_it(mode):
    done = subprocess.run([sys.executable, "-c", SCRIPT, mode], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "interrupted\n"), done.stderr
