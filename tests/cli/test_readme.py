"""What the README promises."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from jeat_graph.cli.main import COMMANDS, build_parser

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_python_example_runs_and_tracks_the_vehicle(capsys):
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len(blocks) == 1
    space: dict[str, object] = {}
    exec(blocks[0], space)
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "1.95 s: vehicle 1 at [717. 300.  80.  60.]"
    assert len(space["smoothed"]) == 40  # type: ignore[arg-type]


def _commands_shown() -> list[list[str]]:
    shell = "\n".join(re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL))
    lines = [line.split("#")[0].split() for line in shell.splitlines()]
    return [words[1:] for words in lines if words[:1] == ["jeat-graph"]]


@pytest.mark.parametrize("words", _commands_shown(), ids=" ".join)
def test_the_commands_shown_are_understood(words):
    assert words[0] in COMMANDS
    args = build_parser(words[0]).parse_args(words)
    assert args.command == words[0]


def test_the_links_lead_to_files():
    targets = re.findall(r"\]\((?!http)([^)#]+)\)", README)
    assert targets
    assert [target for target in targets if not (ROOT / target).is_file()] == []
