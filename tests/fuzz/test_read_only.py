"""A container's installation: it cannot be written, and its user has no home and no rights of root's."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import jeat_graph

#: Parts of the package that lie beside it in a checkout.
BESIDE = ("filters", "association", "smoothers", "eval", "configs")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")


def as_nobody() -> list[str]:
    """What comes before a command so that permissions hold for it: root's do not, until they are given up."""
    if os.geteuid() != 0:
        return []
    setpriv = shutil.which("setpriv")
    if setpriv is None:
        pytest.skip("root cannot give up its rights here")
    return [setpriv, "--inh-caps=-all", "--bounding-set=-all"]


@pytest.fixture
def installed(tmp_path) -> Path:
    """A copy of the package as a wheel lays it out, not to be written."""
    source, site = Path(jeat_graph.__file__).parent, tmp_path / "site"
    bare = shutil.ignore_patterns("__pycache__")
    shutil.copytree(source, site / "jeat_graph", ignore=bare)
    for part in BESIDE:
        if not (source / part).is_dir():
            shutil.copytree(source.parent / part, site / "jeat_graph" / part, ignore=bare)
    for path in (site, *site.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    yield site
    for path in (site, *site.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)


def content(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


def test_track_with_smoothing_runs_from_a_read_only_installation_without_a_home(installed, tmp_path):
    rows = "".join(f"{k * 0.05:.2f},rgb,{100 + 2 * k},200,40,30,0.95\n" for k in range(60))
    (tmp_path / "d.csv").write_text("t,sensor,left,top,width,height,score\n" + rows)
    (tmp_path / "t").mkdir()
    kept = {"PATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH"}
    environment = {key: value for key, value in os.environ.items() if key in kept}
    nowhere = str(installed / "nobody")
    environment |= {"HOME": nowhere, "TMPDIR": str(tmp_path / "t"), "PYTHONPATH": str(installed)}
    before = content(installed)
    track = ("-m", "jeat_graph.cli.main", "track", str(tmp_path / "d.csv"), "--image", "1280x720", "--out")
    command = [*as_nobody(), sys.executable, *track, str(tmp_path / "nobody's")]
    options = {"env": environment, "cwd": tmp_path}  # with `-m` the current folder comes first
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr
    assert content(installed) == before
    # The installation that the tests run from gives the same bytes.
    subprocess.run([sys.executable, *track, str(tmp_path / "usual")], check=True, capture_output=True)
    for table in ("causal.csv", "smoothed.csv"):
        usual = (tmp_path / "usual" / table).read_bytes()
        assert usual.count(b"\n") > 50
        assert (tmp_path / "nobody's" / table).read_bytes() == usual
