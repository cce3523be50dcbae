"""`python -m benchmarks mot` and its like, in small."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.__main__ import build_parser, main
from benchmarks.simulated_sets import simulated
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.io.tables.truth_io import write_truth

FEW = ["--set", "tracker.engine=core", "--no-peers", "--jobs", "1"]


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two sets in our layout, of one short simulated recording each."""
    root = tmp_path_factory.mktemp("data")
    for name, seed in (("first", 5), ("second", 6)):
        folder = root / name / f"drive{seed}"
        folder.mkdir(parents=True)
        one = simulated("day-sparse", seed, 1.0)
        write_detections(one.detections, folder / "detections.csv")
        write_truth(one.truth, folder / "gt.csv")
    return root


@pytest.fixture(scope="module")
def result(data, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    written = ["--out", str(out), "--page", str(out / "page.md")]
    assert main(["mot", str(data), *FEW, "--copies", "2", *written]) == 0
    return out


def test_every_stream_of_every_set_has_a_row_a_table(result):
    found = json.loads((result / "mot.json").read_text())
    assert [one["name"] for one in found["sets"]] == ["first", "second"]
    assert {(e["set"], *e["sensors"]) for e in found["records"]} == {
        (name, *stream) for name in ("first", "second") for stream in (("rgb", "evt"), ("rgb",), ("evt",))
    }
    text = (result / "mot.md").read_text()
    assert text.count("| default, causal | rgb + evt |") == 4  # of both sets, plain and over copies
    assert "±" in text


def test_the_result_holds_what_is_needed_to_repeat_it(data, result):
    found = json.loads((result / "mot.json").read_text())
    command = f"python -m benchmarks mot {data} --copies 2 --set tracker.engine=core --no-peers"
    assert found["settings"]["command"] == command
    words = command.split()[3:]
    assert vars(build_parser().parse_args(words))["changes"] == ["tracker.engine=core"]
    assert found["packages"]["numpy"]
    assert found["configs"]["default"]["tracker"]["engine"] == "core"
    assert found["commit"]


def test_the_page_says_how_it_was_made_and_has_a_plot_that_is_the_same_each_time(data, result, tmp_path):
    page = (result / "page.md").read_text()
    found = json.loads((result / "mot.json").read_text())
    assert f"`{found['settings']['command']} --page" in page
    assert found["commit"] in page
    assert "| first | 1 |" in page
    assert "| 0 of 1 |" in page
    assert "arXiv:2606.14094, 2026" in page
    assert "(page.svg)" in page
    again = ["--from", str(result / "mot.json"), "--page", str(tmp_path / "page.md")]
    assert main(["mot", str(data), *again]) == 0
    assert (tmp_path / "page.svg").read_bytes() == (result / "page.svg").read_bytes()


def test_recordings_that_were_in_view_are_counted(tmp_path):
    from benchmarks.page import _set_row

    one = {"name": "MOT17", "recordings": ["MOT17-02-FRCNN", "MOT17-04-FRCNN"], "frames": 2, "boxes": 2}
    assert _set_row(one | {"sensors": ["rgb"]})["in view"] == "1 of 2"


def test_simulated_worlds_are_judged_by_the_same_rows(tmp_path):
    words = ["simulated", "--worlds", "day", "square", "no light", "--seeds", "3", "--duration", "1"]
    assert main([*words, *FEW, "--out", str(tmp_path), "--page", str(tmp_path / "page.md")]) == 0
    found = json.loads((tmp_path / "simulated.json").read_text())
    assert [one["name"] for one in found["sets"]] == ["day", "square", "no light"]
    assert "velocity_rmse" in found["records"][0]["causal"]
    assert "Published" not in (tmp_path / "page.md").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["mot", "{data}", "--detections", "yolox=nowhere"], "nowhere is no folder"),
        (["mot", "{data}", "--set", "no.such=1"], "no"),
        (["mot", "nowhere"], "nowhere: is no folder"),
        (["simulated", "--worlds", "moon"], "unknown world 'moon'"),
        (["kitti", "{data}"], "holds no recording with truth in the layout 'kitti'"),
    ],
)
def test_mistakes_are_one_line_and_exit_code_2(data, words, said, capsys):
    assert main([word.format(data=data) for word in words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_result_of_another_benchmark_is_refused(data, result, capsys):
    assert main(["kitti", str(data), "--from", str(result / "mot.json")]) == 2
    assert "not a result of `python -m benchmarks kitti`" in capsys.readouterr().err


def test_kind_of_benchmark_is_required():
    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 2


@pytest.mark.parametrize("kind", ["speed", "events"])
def test_a_quick_benchmark_never_replaces_published_tables(kind, capsys, tmp_path):
    page = tmp_path / "README.md"
    page.write_text("<!-- table: speed -->\n1\n<!-- end -->\n")
    assert main([kind, "--quick", "--readme", str(page)]) == 2
    assert "leave out --readme" in capsys.readouterr().err


def test_a_benchmark_that_simulates_says_how_to_get_the_simulator():
    code = (
        "import sys; sys.modules['jeat_graph_sehn'] = None\n"
        "from benchmarks.__main__ import main; sys.exit(main(['simulated', '--quick']))"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode == 2
    assert done.stderr.startswith("jeat-graph benchmarks: ")
    assert "pip install ./sehn" in done.stderr
    assert done.stderr.count("\n") == 1
