"""The files of a run appear together or not at all, and nobody else's file is touched."""

from __future__ import annotations

import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.runs.directory import RUN_JSON, RunDirectory, read_record


def write(folder, **content):
    """Write a run of files with the given content; `run_json` is the record."""
    with RunDirectory(folder) as run:
        for name, text in content.items():
            run.path(name.replace("_", ".")).write_text(text, encoding="utf-8")


def content_of(folder):
    """Text of every file below a folder by name."""
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def test_nothing_is_seen_of_a_run_before_it_is_whole(tmp_path):
    out = tmp_path / "deep" / "run"
    with RunDirectory(out) as run:
        run.path("causal.csv").write_text("new", encoding="utf-8")
        assert not (out / "causal.csv").exists()
    assert content_of(out) == {"causal.csv": "new"}


def test_an_error_leaves_the_earlier_run_as_it_was(tmp_path):
    write(tmp_path, causal_csv="old", run_json="old")
    with pytest.raises(TypeError, match="must be str"):
        write(tmp_path, causal_csv="new", run_json=None)  # None is no text: the second file cannot be written
    assert content_of(tmp_path) == {"causal.csv": "old", RUN_JSON: "old"}


def test_an_error_leaves_no_folder_where_there_was_none(tmp_path):
    with pytest.raises(ValueError, match="half way"), RunDirectory(tmp_path / "deep" / "run"):
        raise ValueError("half way")
    assert list(tmp_path.iterdir()) == []


def test_a_run_replaces_all_files_of_an_earlier_one_and_no_others(tmp_path):
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    write(tmp_path, causal_csv="old", smoothed_csv="old", diagnostics_csv="old", run_json="old")
    write(tmp_path, causal_csv="new", run_json="new")
    assert content_of(tmp_path) == {"causal.csv": "new", RUN_JSON: "new", "notes.txt": "mine"}


def test_an_input_is_never_replaced(tmp_path):
    with pytest.raises(DataError, match="would be replaced by a file of the run"):
        RunDirectory(tmp_path, inputs=[tmp_path / "sub" / ".." / "causal.csv"])
    RunDirectory(tmp_path, inputs=[tmp_path / "detections.csv"])


def test_the_place_of_a_run_is_no_file(tmp_path):
    (tmp_path / "run").write_text("", encoding="utf-8")
    with pytest.raises(DataError, match="is a file"):
        RunDirectory(tmp_path / "run")


def test_files_are_written_within_the_with_block_only(tmp_path):
    with pytest.raises(RuntimeError, match="must be entered"):
        RunDirectory(tmp_path).path("causal.csv")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('{\n"version": \n', r"run\.json:\d: .*is not JSON"),
        ("[" * 100_000, "is not JSON"),
        ("[]", "is not the record of a run"),
        (b"\xff\xfe", "is not JSON"),
    ],
)
def test_a_broken_record_is_refused_by_name(tmp_path, content, message):
    assert read_record(tmp_path) == {}
    (tmp_path / RUN_JSON).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(DataError, match=message):
        read_record(tmp_path)
