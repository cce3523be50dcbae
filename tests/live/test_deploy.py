"""What is in `deploy/` fits the package: systemd takes the unit, the image installs extras that there are."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
UNIT = ROOT / "deploy" / "jeat-graph@.service"


def test_systemd_takes_the_unit(tmp_path):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd is not installed")
    unit = tmp_path / "jeat-graph@gantry7.service"
    unit.write_text(UNIT.read_text().replace("/opt/jeat-graph/bin/jeat-graph", "/bin/true"))
    done = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_unit_is_exposed_little(tmp_path):
    """What systemd itself makes of it: 0 is shut off, 10 is exposed."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd is not installed")
    unit = tmp_path / "jeat-graph@gantry7.service"
    unit.write_text(UNIT.read_text())
    command = ["systemd-analyze", "security", "--offline=yes", "--no-pager", str(unit)]
    done = subprocess.run(command, capture_output=True, text=True)
    [level] = re.findall(r"Overall exposure level for \S+: ([0-9.]+)", done.stdout)
    assert float(level) < 3.0
    assert "PrivateDevices" not in UNIT.read_text()  # cameras are devices


def test_the_unit_says_what_the_command_does():
    unit = UNIT.read_text()
    assert "Type=notify" in unit
    assert re.search(r"^WatchdogSec=\d+$", unit, re.M)
    assert (
        "ExecStart=/opt/jeat-graph/bin/jeat-graph serve --set-aside-damaged /etc/jeat-graph/%i.yaml" in unit
    )


def test_logrotate_takes_its_file(tmp_path):
    if shutil.which("logrotate") is None:
        pytest.skip("logrotate is not installed")
    rows, rules = tmp_path / "smoothed.csv", tmp_path / "rules"
    rows.write_text("t\n1\n")
    text = (ROOT / "deploy" / "logrotate").read_text().replace("/var/lib/jeat-graph", str(tmp_path))
    rules.write_text(re.sub(r"^ *su .*\n", "", text, flags=re.M))
    rules.chmod(0o644)
    command = ["logrotate", "--force", "--state", str(tmp_path / "state"), str(rules)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    [moved] = tmp_path.glob("smoothed.csv-*")
    assert moved.read_text() == "t\n1\n"
    assert not rows.exists()


def test_the_image_installs_extras_that_there_are():
    text = (ROOT / "deploy" / "Dockerfile").read_text()
    [named] = re.findall(r"/source\[([a-z0-9,]+)\]", text)
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(named.split(",")) <= extras.keys()
    assert "serve" in named.split(",")
