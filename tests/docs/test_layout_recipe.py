"""The guide for contributors adds a detector layout: its two files, as they stand there, work."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TESTS = Path("tests") / "detection" / "models"

pytest.importorskip("onnx", reason="pip install onnx")


def of_the_recipe() -> tuple[str, str]:
    """The module and the test in the recipe."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    part = text.split("## Add a detector layout")[1].split("\n## ")[0]
    module, test = re.findall(r"```python\n(.*?)```", part, flags=re.DOTALL)
    return tuple(
        textwrap.dedent(block.replace("\n   ", "\n").removeprefix("   ")) for block in (module, test)
    )


@pytest.fixture
def added(tmp_path):
    """A folder in which the files of the recipe lie as in a checkout, and the words that run Python there."""
    module, test = of_the_recipe()
    own = tmp_path / TESTS / "layouts"
    own.mkdir(parents=True)
    (own / "test_quads.py").write_text(test, encoding="utf-8")
    for name in ("tiny.py", "test_no_numbers.py"):
        (tmp_path / TESTS / name).symlink_to(ROOT / TESTS / name)
    layouts = tmp_path / "layouts"
    layouts.mkdir()
    (layouts / "quads.py").write_text(module, encoding="utf-8")
    # The package's folder of layouts is where the file would be written; here it is a second one.
    (tmp_path / "with_quads.py").write_text(
        f"import jeat_graph.detection.models.layouts as found\nfound.__path__.append({str(layouts)!r})\n",
        encoding="utf-8",
    )
    return tmp_path


def run(folder, *words):
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH", str(ROOT))])])
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_layout_of_the_recipe_is_found_and_its_tests_pass(added):
    tests = [str(TESTS / "layouts" / "test_quads.py"), f"{TESTS / 'test_no_numbers.py'}::{ONE_ROW}[quads]"]
    options = ["-p", "with_quads", "-p", "no:randomly", "-p", "no:cacheprovider", "-n", "0", "-o", "addopts="]
    out = run(
        added, "-m", "pytest", "-q", "--import-mode=importlib", "--rootdir", str(added), *options, *tests
    )
    assert "2 passed" in out


ONE_ROW = "test_one_row_without_numbers_changes_no_other"


def test_the_page_and_the_settings_know_it(added):
    code = (
        "import with_quads, runpy\n"
        f"pages = runpy.run_path({str(ROOT / 'docs' / '_ext' / 'generated_reference.py')!r})\n"
        "print(pages['layouts_page']())\n"
        "from jeat_graph.detection.settings import load_settings\n"
        "print(load_settings(None, ['model_frames.layout=quads']).model_frames.layout)\n"
    )
    out = run(added, "-c", code)
    assert (
        "| `quads` | networks of quads | `quads` `[1, K, 4 + C]` | RGB 0 to 1, stretched | 0.25 | 0.45 |"
        in out
    )
    assert out.splitlines()[-1] == "quads"


def test_the_recipe_is_in_the_style_of_the_project(added):
    files = [str(added / "layouts" / "quads.py"), str(added / TESTS / "layouts" / "test_quads.py")]
    for command in (["check"], ["format", "--check"]):
        run(added, "-m", "ruff", *command, "--config", str(ROOT / "pyproject.toml"), *files)


@pytest.mark.slow
def test_the_types_of_the_recipe_are_right(added):
    options = ["--strict", "--follow-imports=silent", "--ignore-missing-imports", "--no-error-summary"]
    run(added, "-m", "mypy", *options, str(added / "layouts" / "quads.py"))
