"""Tables name the commit that they were made at, and `stale` says what has changed since."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import provenance, sources, stale
from benchmarks.__main__ import KINDS, build_parser, main
from benchmarks.readme import update_readme
from benchmarks.sources import ROOT, sources_of
from benchmarks.stale import Entry, changed_since, entries_of, judge

MADE = "Made by `python -m benchmarks road --seeds 51 52` at commit `{}`."


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A small repository: a benchmark imports a module, which imports a second; a function writes files."""
    files = {
        "benchmarks/__init__.py": "",
        "benchmarks/road.py": "from jeat_graph.one import f\n",
        "jeat_graph/__init__.py": "",
        "jeat_graph/one.py": '"""Words."""\n\ndef f():\n    from jeat_graph.two import g\n    return g()\n',
        "jeat_graph/two.py": "def g():\n    return 1\n",
        "jeat_graph/other.py": "X = 1\n",
    }

    def git(*words):
        subprocess.run(["git", "-C", tmp_path, *words], check=True, capture_output=True)

    def write(name, text):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)

    for name, text in files.items():
        write(name, text)
    git("init", "-q")
    git("add", "-A")
    git("-c", "user.name=a", "-c", "user.email=a@b.c", "commit", "-qm", "first")
    monkeypatch.setattr(provenance, "_ROOT", tmp_path)
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    monkeypatch.setattr(stale, "ROOT", tmp_path)
    homes = {"benchmarks": tmp_path / "benchmarks", "jeat_graph": tmp_path / "jeat_graph"}
    monkeypatch.setattr(sources, "_HOMES", homes)
    caches = (sources._file, sources._tree, sources._imported, stale._code_at)
    for one in caches:
        one.cache_clear()
    yield write
    for one in caches:
        one.cache_clear()


def head():
    return provenance.git("rev-parse", "HEAD")


def test_only_code_that_the_command_imports_makes_a_table_stale(checkout):
    entry = Entry("road.md", "road", "road", head())
    modules = {"road": "benchmarks.road"}
    assert judge(entry, modules) == "current"
    checkout("jeat_graph/other.py", "X = 2\n")
    assert judge(entry, modules) == "current"
    checkout("jeat_graph/two.py", "def g():\n    return 2\n")
    assert judge(entry, modules) == "changed: jeat_graph/two.py"


def test_words_and_layout_are_no_code(checkout):
    files = sources_of("benchmarks.road")
    checkout("jeat_graph/one.py", "def f():\n    # why\n    from jeat_graph.two import g\n\n    return g()\n")
    assert changed_since(head(), files) == []
    checkout("jeat_graph/one.py", "def f():\n    return 3\n")
    assert changed_since(head(), files) == ["jeat_graph/one.py"]


def test_what_a_table_does_not_say_is_said(checkout):
    modules = {"road": "benchmarks.road"}
    assert judge(Entry("road.md", "road"), modules) == "names no commit"
    assert judge(Entry("road.md", "road", "rail", head()), modules) == "no benchmark rail"
    assert judge(Entry("road.md", "road", "road", "0" * 12), modules) == "commit not in this repository"
    dirty = Entry("road.md", "road", "road", head(), True)
    assert judge(dirty, modules) == "made with changes that no commit holds"


def test_tables_and_pages_are_found_with_what_they_say(tmp_path):
    page = tmp_path / "benchmarks" / "a.md"
    page.parent.mkdir()
    page.write_text(
        "# A\n\nMade by `python -m benchmarks mot ROOT\n--rate 25` at commit `abcdef0` with changes, 0.1.\n\n"
        f"<!-- table: one -->\n\n| x |\n\n{MADE.format('0123456789ab')}\n\n<!-- end -->\n\n"
        "<!-- table: two -->\n| x |\n<!-- end -->\n"
    )
    assert [entry[1:] for entry in entries_of(page)] == [
        ("one", "road", "0123456789ab", False),
        ("two", None, None, False),
        ("", "mot", "abcdef0", True),
    ]
    page.write_text("# B\n")
    assert [entry.table for entry in entries_of(page)] == [""]


def test_a_table_that_is_renewed_says_how_it_was_made(tmp_path):
    page = tmp_path / "events.md"
    page.write_text("<!-- table: events-throughput -->\n<!-- end -->\n")
    small = ["--stream", "2000", "--size", "64x48"]
    assert main(["events", *small, "--readme", str(page)]) == 0
    (entry,) = entries_of(page)
    assert entry.kind == "events"
    assert f"`python -m benchmarks events {' '.join(small)}` at " in page.read_text()
    assert provenance.git("rev-parse", "--short=12", "HEAD") == (entry.commit or "")
    assert update_readme(page, {}) == []


def test_the_command_line_that_is_named_leaves_out_where_the_result_goes():
    words = ["road", "--out", "bench", "--seeds", "51", "52", "--readme=a.md", "--jobs", "2"]
    assert build_parser(words).parse_args(words).words == "python -m benchmarks road --seeds 51 52"


def test_imports_are_followed_through_functions_packages_and_folders_at_the_top():
    files = sources_of("benchmarks.event_cameras")
    assert {
        "benchmarks/event_noise.py",
        "eval/tables.py",
        "jeat_graph/__init__.py",
        "sehn/jeat_graph_sehn/scenarios/night.yaml",
    } <= files
    assert all((ROOT / path).is_file() for path in files)
    assert "benchmarks/stale.py" not in files
    assert {"jeat_graph/tracking/tracker.py", "configs/default.yaml"} <= sources_of("benchmarks.speed")


def test_of_what_is_compiled_the_imported_folders_count_with_their_headers():
    events, tracker = sources_of("benchmarks.events"), sources_of("jeat_graph.tracking.model_tracker")
    built = {"jeat_graph/core/module.cpp", "jeat_graph/core/CMakeLists.txt"}
    assert built | {"jeat_graph/core/events/evt3.hpp", "jeat_graph/core/events/evt3_block.hpp"} <= events
    assert not [path for path in events if path.startswith("jeat_graph/core/tracking/")]
    assert built | {"jeat_graph/core/tracking/step.cpp", "jeat_graph/core/filters/singer.hpp"} <= tracker
    assert "jeat_graph/core/events/evt3.hpp" not in tracker


def test_no_header_of_the_core_is_overlooked():
    core = ROOT / "jeat_graph" / "core"
    every = set(core.rglob("*.?pp"))
    found = {
        ROOT / path
        for module in core.glob("*/module.cpp")
        for path in sources_of(f"jeat_graph.core.{module.parent.name}")
    }
    assert every <= found


def test_only_the_core_itself_imports_the_extension():
    """Others import a submodule from `jeat_graph.core`: what they depend on is seen in the text."""
    users = [
        path.relative_to(ROOT).as_posix()
        for folder in ("jeat_graph", "filters", "association", "smoothers", "eval", "sehn", "benchmarks")
        for path in (ROOT / folder).rglob("*.py")
        if re.search(r"^\s*(from|import) .*\b_core\b", path.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    assert users == ["jeat_graph/core/__init__.py"]


def test_what_is_imported_when_it_runs_is_among_the_files_that_are_found():
    """The oracle: the interpreter's own list, after a small benchmark."""
    program = (
        "import argparse, sys\n"
        "from benchmarks.events import measure, tables\n"
        "tables(measure(argparse.Namespace(stream=500, size=(64, 48), seed=0)))\n"
        "names = ('jeat_graph', 'benchmarks')\n"
        "for name, module in sys.modules.items():\n"
        "    if name.split('.')[0] in names and getattr(module, '__file__', None):\n"
        "        print('::' + module.__file__)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    files = [line[2:] for line in done.stdout.splitlines() if line.startswith("::")]
    loaded = {str(Path(file).resolve()) for file in files if file.endswith(".py")}  # links lead to the top
    assert loaded
    assert loaded <= {str(ROOT / path) for path in sources_of("benchmarks.events")}


def test_every_page_of_the_documentation_names_its_commit():
    for page in sorted((ROOT / "docs" / "benchmarks").glob("*.md")):
        for entry in entries_of(page):
            assert entry.commit is not None, f"{entry.page}: {entry.table or 'the page'} names no commit"
            assert entry.kind in KINDS


def test_rigs_say_how_they_were_made_and_can_be_read_again(tmp_path, monkeypatch, capsys):
    refused = {"refused": "no traffic", "seconds": 1.0}
    monkeypatch.setattr(
        "benchmarks.rigs.measure_rig", lambda kind, seed: {"kind": kind, "seed": seed, **refused}
    )
    assert main(["rigs", "--quick", "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "Made by `python -m benchmarks rigs --quick` at commit `" in (tmp_path / "rigs.md").read_text()
    assert main(["rigs", "--from", str(tmp_path / "rigs.json")]) == 0
    assert capsys.readouterr().out == shown
