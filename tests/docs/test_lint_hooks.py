"""The checks that git runs on a commit are those of `make lint`."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]


def test_every_check_of_make_lint_is_a_hook_and_every_hook_a_check():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipe = re.search(r"^lint:.*\n((?:\t.*\n)+)", makefile, re.MULTILINE)
    assert recipe
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]
    # Files and folders may be named otherwise, the tool and its options not.
    checks = [
        re.split(r" (?=\$\(|\.github/|\.readthedocs)", line.strip().removeprefix("@$(BIN)/"))[0]
        for line in recipe[1].splitlines()
    ]
    entries = [hook["entry"].removeprefix(".venv/bin/") for repo in hooks for hook in repo["hooks"]]
    assert len(checks) == len(entries) > 5
    for check, entry in zip(sorted(checks), sorted(entries), strict=True):
        assert entry.startswith(check)
