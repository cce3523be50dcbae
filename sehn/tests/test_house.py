"""How this distribution stands beside jeat-graph: what it may use of it, and how it is found."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

import jeat_graph
from jeat_graph.drawing.movie import sources
from jeat_graph.runs.demo_recording import read_demo_recording
from jeat_graph_sehn.make_demo import make_demo, write_demo
from jeat_graph_sehn.simulation.dataset import layout
from jeat_graph_sehn.version import __version__

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "jeat_graph_sehn"
#: Modules of jeat-graph that are public for distributions beside it; docs/design.md lists them, too.
PUBLIC = {
    "jeat_graph",
    "jeat_graph.association.overlap",
    "jeat_graph.cli.options",
    "jeat_graph.cli.terminal",
    "jeat_graph.config.argument_types",
    "jeat_graph.config.fields",
    "jeat_graph.config.rig_file",
    "jeat_graph.config.schema",
    "jeat_graph.config.section_tree",
    "jeat_graph.config.sensors",
    "jeat_graph.config.yaml_text",
    "jeat_graph.data.arrays",
    "jeat_graph.data.detections",
    "jeat_graph.data.errors",
    "jeat_graph.data.events",
    "jeat_graph.data.interop",
    "jeat_graph.data.normal",
    "jeat_graph.data.private_folder",
    "jeat_graph.data.processes",
    "jeat_graph.data.progress",
    "jeat_graph.data.trajectories",
    "jeat_graph.detection.models.choosing",
    "jeat_graph.detection.models.class_names",
    "jeat_graph.detection.models.event_places",
    "jeat_graph.detection.models.feeding",
    "jeat_graph.detection.models.layouts.record",
    "jeat_graph.detection.models.layouts.registry",
    "jeat_graph.detection.models.model_settings",
    "jeat_graph.detection.models.onnx_head",
    "jeat_graph.detection.models.parts",
    "jeat_graph.detection.named",
    "jeat_graph.detection.windows",
    "jeat_graph.eval.detection_ap",
    "jeat_graph.io.files.atomic",
    "jeat_graph.io.exports.coco_writer",
    "jeat_graph.io.media.decoders",
    "jeat_graph.io.tables.detections_io",
    "jeat_graph.io.events.converting",
    "jeat_graph.io.events.dsec_hdf5",
    "jeat_graph.io.events.indexed",
    "jeat_graph.io.events.opening",
    "jeat_graph.io.formats.prophesee",
    "jeat_graph.io.events.dsec_writer",
    "jeat_graph.io.files.hashing",
    "jeat_graph.io.files.locking",
    "jeat_graph.io.files.limits",
    "jeat_graph.io.files.outputs",
    "jeat_graph.io.media.picture_file",
    "jeat_graph.io.media.pictures",
    "jeat_graph.io.exports.prophesee_writer",
    "jeat_graph.io.tables.rounding",
    "jeat_graph.io.tables.sensor_columns",
    "jeat_graph.io.tables.table_writer",
    "jeat_graph.io.tables.truth_io",
    "jeat_graph.io.media.video",
    "jeat_graph.io.media.video_writer",
    "jeat_graph.rig.common_picture",
    "jeat_graph.road.camera",
    "jeat_graph.road.camera_map",
    "jeat_graph.runs.demo_recording",
    "jeat_graph.runs.latency",
    "jeat_graph.version",
}


def used() -> dict[str, set[str]]:
    """Modules of jeat-graph that each module of this distribution imports, inside functions too."""
    found: dict[str, set[str]] = {}
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            ours = {name for name in names if name.split(".")[0] == "jeat_graph"}
            found.setdefault(path.relative_to(ROOT).as_posix(), set()).update(ours)
    return found


def test_only_what_is_public_is_used_and_all_of_it():
    found = used()
    assert {file: names - PUBLIC for file, names in found.items() if names - PUBLIC} == {}
    assert PUBLIC - set().union(*found.values()) == set()


def test_what_is_public_stands_in_the_page_on_the_layout():
    page = (ROOT.parent / "docs" / "design.md").read_text(encoding="utf-8")
    assert {name for name in PUBLIC if f"`{name}`" not in page} == set()


def test_nothing_that_is_used_begins_with_an_underscore():
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "jeat_graph":
                hidden = [a.name for a in node.names if a.name.startswith("_") and a.name != "__version__"]
                assert hidden == [], path


def test_both_distributions_have_one_version():
    assert jeat_graph.__version__ == __version__


def test_another_version_of_jeat_graph_is_refused_in_words():
    code = (
        "import sys, jeat_graph\njeat_graph.__version__ = '0.0.1'\n"
        "from jeat_graph.cli.main import main\nsys.exit(main(['simulate', '--help']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("jeat-graph simulate: jeat-graph-sehn ")
    assert "does not belong to jeat-graph 0.0.1" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("group", ["jeat_graph.commands", "jeat_graph.functions"])
def test_what_is_offered_is_there(group):
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    offered = declared["project"]["entry-points"][group]
    points = {point.name: point for point in entry_points(group=group)}
    assert set(points) == set(offered)
    for point in points.values():
        found = point.load()
        assert callable(found) or (found.HELP and found.add_arguments and found.run)


def test_the_recording_of_the_demo_is_what_the_simulator_makes(tmp_path):
    made, shipped = make_demo(), read_demo_recording()
    np.testing.assert_allclose(shipped.detections.boxes, made.detections.boxes, atol=2e-3)
    np.testing.assert_allclose(shipped.detections.scan_t, made.detections.scan_t, atol=1e-6)
    np.testing.assert_allclose(shipped.truth.boxes, made.truth.boxes, atol=1e-5)
    assert (shipped.name, shipped.width, shipped.height) == (made.name, made.width, made.height)
    for line, again in zip(shipped.lines, made.lines, strict=True):
        np.testing.assert_allclose(line, again, atol=0.051)


def test_it_is_written_with_the_same_bytes_each_time_and_small(tmp_path):
    recording = make_demo()
    for name in ("once", "again"):
        write_demo(recording, tmp_path / name)
    files = sorted(path.name for path in (tmp_path / "once").iterdir())
    assert files == ["detections.csv.gz", "gt.csv.gz", "picture.json"]
    assert all((tmp_path / "once" / f).read_bytes() == (tmp_path / "again" / f).read_bytes() for f in files)
    assert sum((tmp_path / "once" / f).stat().st_size for f in files) <= 300_000


def test_the_names_of_files_are_those_that_render_looks_for():
    assert (sources.SEGMENTS, sources.EVENTS, sources.TRUTH) == (layout.SEGMENTS, layout.EVENTS, layout.TRUTH)
