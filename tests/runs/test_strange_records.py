"""A run may be damaged or a stranger's: its record is not believed, and it leads to nothing elsewhere."""

from __future__ import annotations

import hashlib
import json
import os
import shutil

import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.beside import lies_beside
from jeat_graph.runs.directory import read_record

SECRET = "marker-of-a-file-that-nobody-named 1 2 3\nsecond line\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run of one vehicle, and the file that it was made from beside it."""
    folder = tmp_path_factory.mktemp("made")
    rows = [f"{0.05 * k:.2f},rgb,{100 + 4 * k},100,60,40,.9" for k in range(40)]
    (folder / "det.csv").write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    out = ["--out", str(folder / "run"), "--image", "640x480"]
    assert main(["track", str(folder / "det.csv"), *out]) == 0
    return folder


@pytest.fixture
def stranger(made, tmp_path):
    """A copy of the run deep in a folder, and the path of a secret that does not lie beside it."""
    home = tmp_path / "deep" / "in" / "folders"
    shutil.copytree(made / "run", home / "run")
    shutil.copy(made / "det.csv", home / "det.csv")
    secret = tmp_path / "secret.csv"
    secret.write_text(SECRET)
    return home / "run", secret


def rewrite(run, change) -> None:
    record = json.loads((run / "run.json").read_text())
    change(record)
    (run / "run.json").write_text(json.dumps(record))


def described(path) -> dict[str, object]:
    data = path.read_bytes()
    return {
        "path": str(path),
        "absolute": str(path),
        "bytes": len(data),
        "sha256": hashlib.sha256(data).hexdigest(),
    }


COMMANDS = {
    "compare": lambda run: ["compare", run, "--no-plots"],
    "report": lambda run: ["report", run, "--out", f"{run}.html"],
}


@pytest.fixture
def said(capsys):
    """Run a command on a run; its exit code and all that it said and wrote."""

    def do(command, run, *more):
        capsys.readouterr()
        code = main([*map(str, COMMANDS[command](str(run))), *more])
        out, err = capsys.readouterr()
        page = run.with_name("run.html")
        assert "Traceback" not in err
        return code, out + err + (page.read_text() if page.exists() else "")

    return do


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("way", ["input", "images", "link", "list"])
def test_what_a_record_names_elsewhere_is_not_opened(stranger, said, command, way):
    run, secret = stranger

    def change(record):
        one = described(secret)
        if way == "input":
            record["inputs"], record["reading"]["detections"] = [one], [str(secret)]
        elif way == "link":
            link = run.parent / "link.csv"
            link.symlink_to(secret)
            record["inputs"], record["reading"]["detections"] = [one | {"path": str(link)}], [str(link)]
        else:
            record["reading"] |= {"images": str(secret), "fmt": "coco" if way == "images" else None}
            if way == "images":
                record["images"] = one

    rewrite(run, change)
    code, text = said(command, run)
    assert "marker" not in text
    assert code == (2 if command == "compare" else 0)
    assert text.count("\n") == 1 or command == "report"
    assert "beside" in text or "record of a run" in text


def test_the_user_may_name_it(stranger, said, made):
    run, _ = stranger
    elsewhere = str(made / "det.csv")
    (run.parent / "det.csv").unlink()
    rewrite(run, lambda record: record["inputs"][0].update(absolute=elsewhere, path=elsewhere))
    rewrite(run, lambda record: record["reading"].update(detections=[elsewhere]))
    code, text = said("compare", run)
    assert code == 2
    assert "name it with --detections" in text
    assert said("compare", run, "--detections", elsewhere)[0] == 0


@pytest.mark.parametrize("name", ["causal.csv", "smoothed.csv", "scans.csv", "run.json"])
@pytest.mark.parametrize("command", ["eval", "report", "compare"])
def test_a_link_in_a_run_leads_nowhere(stranger, capsys, made, command, name):
    run, secret = stranger
    (run / name).unlink()
    (run / name).symlink_to(secret)
    given = ["--gt", str(made / "det.csv")] if command == "eval" else ["--out", str(run.parent / "out")]
    capsys.readouterr()
    code = main([command, str(run), *given])
    out, err = capsys.readouterr()
    assert "marker" not in out + err
    # What a command does not read at all does not stop it.
    unread = {("report", "scans.csv"), ("compare", "causal.csv"), ("compare", "smoothed.csv")}
    assert code == 2 or (command, name) in unread | {("compare", "scans.csv")}


# What of a record may be wrong, and what then is refused.
WRONG = {
    "config": [3, [], {"image": 3}, {"image": {"width": 0, "height": 9}}, {"image": {"width": 1e400}}],
    "counts": [[], {"tracks_born": "many"}, {"scans": [1]}],
    "files": [[], {"causal.csv": 3}],
    "images": ["a.txt"],
    "inputs": [{}, [3], "det.csv"],
    "reading": ["det.csv", {"rate_hz": -1}, {"rate_hz": "fast"}, {"rate_hz": 1e400}],
    "warnings": ["none", {}],
    "timings": [[]],
}


@pytest.mark.parametrize(("key", "value"), [(key, v) for key, values in WRONG.items() for v in values])
def test_a_record_of_other_kinds_is_no_record(stranger, key, value):
    run, _ = stranger
    rewrite(run, lambda record: record.update({key: value}))
    with pytest.raises(DataError, match=r"run\.json: is not the record of a run: .*" + key):
        read_record(run)


@pytest.mark.parametrize(
    "text", ["", "[", "[]", "3", '{"a":', "[" * 100_000, '{"config": ' * 5000, "\x00", '{"config": 1}']
)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_damaged_record_is_one_line(stranger, capsys, command, text):
    run, _ = stranger
    (run / "run.json").write_text(text)
    capsys.readouterr()
    assert main(COMMANDS[command](str(run))) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "run.json" in err


@pytest.mark.parametrize("key", ["inputs", "reading", "config", "files"])
def test_compare_needs_all_of_it(stranger, said, key):
    run, _ = stranger
    rewrite(run, lambda record: record.pop(key))
    code, text = said("compare", run)
    assert code == 2
    assert text.count("\n") == 1


def test_settings_that_no_reader_has_are_refused(stranger, said):
    run, _ = stranger
    rewrite(run, lambda record: record["reading"].update(colour="red"))
    code, text = said("compare", run)
    assert (code, text.count("\n")) == (2, 1)


def test_beside_is_near_and_not_hidden(tmp_path):
    run = tmp_path / "a" / "b" / "run"
    run.mkdir(parents=True)
    assert lies_beside(run / "causal.csv", run)
    assert lies_beside(run.parent / "det.csv", run)
    assert lies_beside(tmp_path / "a" / "data" / "det.csv", run)
    assert not lies_beside(tmp_path / "det.csv", run)
    assert not lies_beside(tmp_path / "a" / ".ssh" / "id", run)
    assert not lies_beside("/etc/passwd", "/run")  # only the root in common
    assert not lies_beside("/etc/passwd", "/srv/run")
    os.symlink(run / "circle", run / "circle")
    assert not lies_beside(run / "circle", tmp_path / "elsewhere")
