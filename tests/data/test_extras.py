"""Messages name packages that can be installed, and the same as `pyproject.toml`."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import pytest

from jeat_graph.data.extras import PACKAGES, install

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("extra", sorted(PACKAGES))
def test_an_extra_stands_for_the_packages_that_the_project_asks_for(extra):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [one.partition(";")[0].strip() for one in project["optional-dependencies"][extra]]
    assert list(PACKAGES[extra]) == asked


def test_a_shell_takes_the_command_as_it_stands():
    assert install("aedat4") == "pip install 'aedat>=2.2,<3'"
    assert shlex.split(install("mqtt", "onnxruntime")) == [
        "pip",
        "install",
        "paho-mqtt>=2.1,<3",
        "onnxruntime>=1.20,<2",
    ]


def test_no_message_names_an_extra_of_the_package_itself():
    """That cannot be installed before a release, nor from a wheel or a checkout."""
    folders = ("jeat_graph", "eval", "filters", "association", "smoothers")
    sources = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    named = [
        str(path.relative_to(ROOT))
        for path in sources
        if path.name != "extras.py" and re.search(r"jeat-graph\[", path.read_text(encoding="utf-8"))
    ]
    assert named == []
