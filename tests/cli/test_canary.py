"""Canaries: no command shows the password in an address, or a line of a file that nobody named."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
from pathlib import Path

import pytest

from jeat_graph.cli.main import COMMANDS, build_parser, main

USER, PASSWORD = "canary-user", "canary-p@ssw/rd"
QUOTED = "canary-p%40ssw%2Frd"
#: How the password may appear if it does.
MARKS = (PASSWORD, QUOTED, "canary-p", "ssw/rd")
CONTENT = "canary-content"


def secret_free(text: str) -> bool:
    return not any(mark in text for mark in MARKS)


def files_with(folder: Path, marks: tuple[str, ...]) -> list[str]:
    """The files in which one of the marks stands."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return [str(path) for path in files if any(mark.encode() in path.read_bytes() for mark in marks)]


def argument_lists() -> list[tuple[str, ...]]:
    """Every command with a URL that holds the password in the place of each of its arguments in turn."""
    found = []
    for url in (f"mqtt://{USER}:{QUOTED}@host/t", f"rtsp://{USER}:{PASSWORD}@camera/stream"):
        for name in COMMANDS:
            found += [
                (name, url),
                (name, url, url),
                (name, "none.csv", "--nonsense", url),
                (name, f"--nonsense={url}"),
                (name, "--set", f"{url}=1", "none.csv"),
            ]
            commands = next(a for a in build_parser(name)._actions if isinstance(a.choices, dict))
            for action in commands.choices[name]._actions:
                if (
                    action.option_strings
                    and action.nargs != 0
                    and not isinstance(action, argparse._HelpAction)
                ):
                    found.append((name, "none.csv", action.option_strings[-1], url))
                    found.append((name, "none.csv", "--out", "out", action.option_strings[-1], url))
    return [
        words for words in found if words[0] not in ("demo", "benchmark") or "--nonsense" in " ".join(words)
    ]


@pytest.mark.parametrize("command", COMMANDS)
def test_what_is_said_of_wrong_arguments_has_no_password(command, tmp_path, monkeypatch, capfd):
    """Of all commands: whoever gives an address to the wrong option, or to the wrong command."""
    monkeypatch.chdir(tmp_path)
    lists = [words for words in argument_lists() if words[0] == command]
    assert len(lists) >= 2
    for words in lists:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"")))
        try:
            code = main(list(words))
        except SystemExit as end:
            code = end.code
        said = capfd.readouterr()
        assert secret_free(said.out + said.err), words
        assert "Traceback" not in said.err, words
        assert code in (0, 2), words
    assert not files_with(tmp_path, MARKS)


def test_a_camera_s_address_in_a_manifest_is_shown_without_its_password(tmp_path, capfd):
    manifest, out = tmp_path / "manifest.csv", tmp_path / "out"
    manifest.write_text(f"name,detections\na,rtsp://{USER}:{PASSWORD}@camera/a.csv\nb,none.csv\n")
    assert main(["batch", str(manifest), "--out", str(out)]) != 0
    said = capfd.readouterr()
    assert secret_free(said.out + said.err)
    assert not files_with(out, MARKS)


@pytest.mark.parametrize("place", ["inputs", "files", "reading"])
def test_a_stranger_s_run_has_no_file_read_that_the_user_did_not_name(
    place, recording, tmp_path, capfd, small_plots
):
    """What `run.json` names may be anybody's: nothing of it is shown."""
    from jeat_graph.io.files.hashing import sha256_of

    run, private = tmp_path / "a/b/c/d/run", tmp_path / "private" / "canary.csv"  # nowhere near
    private.parent.mkdir()
    run.parent.mkdir(parents=True)
    private.write_text(f"{CONTENT}\n{CONTENT}: 1\n")
    assert main(["track", str(recording / "detections.csv"), "--out", str(run)]) == 0
    record = json.loads((run / "run.json").read_text())
    described = {"path": str(private), "sha256": sha256_of(private), "size": private.stat().st_size}
    if place == "inputs":
        record["inputs"] = [{**record["inputs"][0], **described}]
        record["reading"]["detections"] = [str(private)]
    elif place == "reading":
        record["reading"]["images"] = str(private)
        record["images"] = described
    else:
        record["files"] = {os.path.relpath(private, run): described, **record["files"]}
    (run / "run.json").write_text(json.dumps(record))
    commands = [
        ("compare", run, "--gt", recording / "gt.csv", "--out", tmp_path / "out"),
        ("report", run, "--out", tmp_path / "out.html"),
        ("report", run, "--gt", recording / "gt.csv", "--out", tmp_path / "gt.html"),
        ("eval", run, "--gt", recording / "gt.csv"),
        ("count", run, "--line", "0,300,1280,300"),
        ("export", run, "--to", "cvat", "--out", tmp_path / "out.zip"),
        ("calibrate", run, "--out", tmp_path / "out.yaml"),
        ("road", run, "--camera", private, "--out", tmp_path / "road"),
    ]
    capfd.readouterr()
    for words in commands:
        with contextlib.suppress(SystemExit), small_plots():
            main([str(word) for word in words])
        said = capfd.readouterr()
        if private not in words:
            assert CONTENT not in said.out + said.err, words
        assert "Traceback" not in said.err, words
    private.unlink()
    assert not files_with(tmp_path, (CONTENT,))
