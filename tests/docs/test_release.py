"""What a release needs: one version everywhere, licences of what is compiled in, files that hosts read."""

from __future__ import annotations

import hashlib
import re
import runpy
import tomllib
from pathlib import Path

import pytest
import yaml

from jeat_graph.version import __version__

ROOT = Path(__file__).parents[2]
_CALL = re.compile(r"(?:`|run: |- |^)make ([\w./-]+)", re.MULTILINE)
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def test_the_version_is_the_same_in_the_package_the_simulator_and_the_citation():
    sehn = (ROOT / "sehn" / "jeat_graph_sehn" / "version.py").read_text(encoding="utf-8")
    assert re.findall(r'__version__ = "(.+)"', sehn) == [__version__]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == __version__
    assert citation["license"] == "Apache-2.0"


@pytest.mark.parametrize("name", ["nanobind", "robin-map"])
def test_licences_of_what_is_compiled_into_the_core_go_into_the_wheel(name):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert "licenses/*.txt" in project["license-files"]
    text = (ROOT / "licenses" / f"{name}.txt").read_text(encoding="utf-8")
    assert "Copyright (c)" in text
    assert "WARRANT" in text


def test_the_bill_of_materials_lists_every_network_that_comes_along_with_its_licence():
    made = runpy.run_path(str(ROOT / ".ci" / "sbom.py"))
    weights = ROOT / "jeat_graph" / "detection" / "weights"
    listed = {
        one["description"].split(",")[0].rpartition("/")[2]: one
        for one in made["network_components"](weights)
    }
    assert sorted(listed) == sorted(path.name for path in weights.glob("*.onnx"))
    assert len(listed) == 7
    for name, one in listed.items():
        assert one["licenses"] == [{"license": {"id": "Apache-2.0"}}]
        assert one["hashes"][0]["content"] == hashlib.sha256((weights / name).read_bytes()).hexdigest()


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_may_write_nothing_but_what_a_job_asks_for(path):
    flow = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert flow["permissions"] == {"contents": "read"}
    for job in flow["jobs"].values():
        assert job["timeout-minutes"] <= 180
        for step in job["steps"]:
            if step.get("uses", "").startswith("actions/checkout@"):
                assert step["with"]["persist-credentials"] is False


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_actions_are_named_by_the_hash_of_a_commit_with_its_version_beside_it(path):
    used = re.findall(r"uses: (.+)", path.read_text(encoding="utf-8"))
    assert used
    assert [one for one in used if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40} # v\d+(\.\d+)+", one)] == []


def test_the_licence_expression_names_those_of_what_is_compiled_into_the_core():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    made = runpy.run_path(str(ROOT / ".ci" / "sbom.py"))
    compiled = {one["licenses"][0]["license"]["id"] for one in made["compiled_components"]()}
    assert set(project["license"].split(" AND ")) == {"Apache-2.0", *compiled}


def test_make_targets_that_workflows_and_the_host_of_the_documentation_call_exist():
    targets = set(
        re.findall(r"^([\w.$()/-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    )
    targets |= {one.replace("$(VENV)", ".venv") for one in targets}
    files = [*WORKFLOWS, ROOT / ".readthedocs.yaml", ROOT / "CONTRIBUTING.md"]
    called = {one for path in files for one in _CALL.findall(path.read_text(encoding="utf-8"))}
    assert {"reproducible", "sbom", "docs", "core"} <= called
    assert called <= targets


def test_files_that_the_guide_for_contributors_names_are_there():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = [one for one in re.findall(r"`((?:jeat_graph|tests|docs)/[\w./-]+)`", text) if "NAME" not in one]
    assert len(named) > 8
    assert [one for one in named if not (ROOT / one).exists()] == []
