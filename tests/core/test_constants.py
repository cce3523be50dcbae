"""Constants of the model stand in Python; the core's header is written from them."""

from __future__ import annotations

import importlib.util
import re
from dataclasses import fields
from pathlib import Path

from jeat_graph.filters import box_sides
from jeat_graph.filters.model_constants import ModelConstants

ROOT = Path(__file__).resolve().parents[2]


def written():
    spec = importlib.util.spec_from_file_location("core_constants", ROOT / ".ci" / "core_constants.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_header_is_what_is_written_from_python():
    module = written()
    assert module.HEADER.read_text() == module.header(), "run python .ci/core_constants.py, and make core"


def test_a_number_is_written_so_that_it_is_read_back(monkeypatch):
    monkeypatch.setattr(box_sides, "_OUTWARDS", -1.0 / 3.0)
    line = next(one for one in written().header().splitlines() if " kOutwards " in one)
    assert float(re.search(r"= (.*);", line)[1]) == -1.0 / 3.0


def test_every_constant_that_can_be_given_is_listed():
    listed = re.findall(r"JEAT_(?:ONE|PAIR)\((\w+)\)", (ROOT / "jeat_graph/core/constants.hpp").read_text())
    assert listed == [one.name for one in fields(ModelConstants)]


def test_no_header_defines_a_number_of_the_model_again():
    again = []
    for path in (ROOT / "jeat_graph" / "core").rglob("*.[hc]pp"):
        if path.parent.name in ("filters", "association", "smoothers"):
            own = re.findall(r"constexpr double (k\w+) = -?[\d.e-]+;", path.read_text())
            again += [f"{path.name}: {name}" for name in own if name != "kImpossible"]
    assert not again, "numbers of the model belong into Python and .ci/core_constants.py"
