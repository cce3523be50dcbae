"""The recipes of CONTRIBUTING, followed word by word in a copy: their tests, lint and types pass."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
_PACKAGE = ROOT / "jeat_graph"
_TOP = ("filters", "association", "smoothers", "eval", "configs")
_LEFT_OUT = ("__pycache__", ".git", ".venv", ".mypy_cache", ".ruff_cache", ".pytest_cache", "build")
_FILE = re.compile(r"```python\n# (\S+\.py)\n(.*?)```", re.DOTALL)


def recipes() -> dict[str, str]:
    """Text of each file that CONTRIBUTING says to write, by its path."""
    return dict(_FILE.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy in which the recipes were followed; what they do not touch is linked."""
    root = tmp_path_factory.mktemp("checkout")
    touched = {Path(name).parts for name in recipes()}

    def fill(source: Path, target: Path, at: tuple[str, ...]) -> None:
        target.mkdir()
        for one in source.iterdir():
            within = (*at, one.name)
            if one.name in ("__pycache__", ".git", ".venv") or one.name.startswith(
                (".mypy", ".ruff", ".pytest")
            ):
                continue
            if one.is_symlink():  # to a folder at the top, of the copy then
                (target / one.name).symlink_to(os.readlink(one))
            elif one.is_dir() and any(parts[: len(within)] == within for parts in touched):
                fill(one, target / one.name, within)
            else:
                (target / one.name).symlink_to(one)

    fill(ROOT, root / "it", ())
    for name, text in recipes().items():
        path = root / "it" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return root / "it"


def run(copy: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a program in the copy, on its packages."""
    environment = {**os.environ, "PYTHONPATH": f"{copy}{os.pathsep}{copy / 'sehn'}"}
    return subprocess.run(
        [sys.executable, "-m", *command],
        cwd=copy,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_there_is_a_recipe_and_a_test_of_a_format_an_export_a_metric_and_a_broker():
    folders = [str(Path(name).parent) for name in recipes()]
    own = {
        "jeat_graph/io/formats",
        "jeat_graph/exporting",
        "jeat_graph/live/transport/brokers",
        "eval/scores",
    }
    assert own < set(folders)
    assert sum(folder.startswith("tests/") for folder in folders) == 4


def test_their_tests_pass(copy):
    own = [name for name in recipes() if name.startswith("tests/")]
    done = run(copy, "pytest", "-q", "-n", "0", "-p", "no:randomly", "-p", "no:cacheprovider", *own)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert done.stdout.startswith("......")  # six of them, and none is left out


def test_their_page_follows(copy):
    """The page of the copy names the new format, export, score and broker; no other file had to."""
    code = (
        "import sys; sys.path.insert(0, 'docs/_ext'); import generated_reference as made; "
        "print(made.records_page())"
    )
    environment = {**os.environ, "PYTHONPATH": f"{copy}{os.pathsep}{copy / 'sehn'}"}
    page = subprocess.run(
        [sys.executable, "-c", code], cwd=copy, env=environment, capture_output=True, text=True, check=True
    ).stdout
    assert all(f"| `{name}` |" in page for name in ("semicolons", "lifetimes", "crowding"))
    assert "| Memory | `memory://`, 1 |" in page


def test_lint_passes(copy):
    files = list(recipes())
    for command in (("ruff", "check", "--no-cache"), ("ruff", "format", "--no-cache", "--check")):
        done = run(copy, *command, *files)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_types_pass(copy):
    pytest.importorskip("mypy")
    modules = [
        name.removesuffix(".py").replace("/", ".") for name in recipes() if not name.startswith("tests/")
    ]
    modules = [name if name.startswith("jeat_graph.") else f"jeat_graph.{name}" for name in modules]
    flags = ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(copy.parent / "cache")]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *flags, *(flag for name in modules for flag in ("-m", name))],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert not [
        line for line in done.stdout.splitlines() if any(Path(name).name in line for name in recipes())
    ]
    shutil.rmtree(copy.parent / "cache", ignore_errors=True)


def test_no_other_file_of_live_use_names_a_broker():
    """A broker's scheme stands in its record, and in the modules of its client."""
    from jeat_graph.live.transport.brokers.registry import brokers

    quoted = re.compile("|".join(rf"[\"']{scheme}[\"']" for scheme in brokers()))
    own = re.compile(rf"({'|'.join(brokers())})\w*\.py")
    found = {
        path.name: quoted.findall(path.read_text(encoding="utf-8"))
        for path in (_PACKAGE / "live").rglob("*.py")
        if not own.fullmatch(path.name)
    }
    assert {name: words for name, words in found.items() if words} == {}


#: Words that are names of formats, exports, metrics, protocols or layouts and common words of this code too.
_COMMON = {"csv", "parquet", "plain", "identity", "clear", "rerun", "boxes"}


def test_no_other_file_names_a_format_an_export_a_metric_a_protocol_a_layout_or_an_event_camera():
    """Their names stand in their own file alone, so that whoever adds one has to look nowhere else."""
    from jeat_graph.detection.models.layouts.registry import all_layouts
    from jeat_graph.eval.metrics import metrics
    from jeat_graph.eval.protocols.registry import protocols
    from jeat_graph.exporting.registry import exports
    from jeat_graph.io.event_cameras.registry import event_cameras
    from jeat_graph.io.formats.registry import formats

    own = [ROOT / "eval" / "scores", ROOT / "eval" / "protocols"]
    own += [
        _PACKAGE / name
        for name in ("exporting", "io/formats", "io/event_cameras", "detection/models/layouts")
    ]
    own += [_PACKAGE / "detection" / "models" / "exports.py"]  # has what notes of exports call their network
    own += [_PACKAGE / "data" / "extras.py"]  # a package that is needed more may be called as what needs it
    records = (formats(), exports(), metrics(), protocols(), all_layouts().values())
    names = {one.name for found in records for one in found} | set(event_cameras())
    names -= _COMMON
    quoted = re.compile("|".join(rf"[\"']{re.escape(name)}[\"']" for name in sorted(names)))
    files = [path for folder in (_PACKAGE, *(ROOT / name for name in _TOP)) for path in folder.rglob("*.py")]
    found = {
        path.relative_to(ROOT).as_posix(): quoted.findall(path.read_text(encoding="utf-8"))
        for path in files
        if not any(path.is_relative_to(folder) for folder in own)
    }
    assert {name: words for name, words in found.items() if words} == {}
