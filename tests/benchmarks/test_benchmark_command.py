"""`python -m benchmarks accuracy` and `ablation`, in small."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.__main__ import build_parser, main

SMALL = ["--scenarios", "day", "--seeds", "3", "--duration", "2", "--jobs", "1"]


@pytest.fixture(scope="module")
def ablation(tmp_path_factory):
    out = tmp_path_factory.mktemp("ablation")
    assert main(["ablation", *SMALL, "--quick", "--out", str(out)]) == 0
    return out


def test_the_result_holds_what_is_needed_to_repeat_it(ablation):
    result = json.loads((ablation / "ablation.json").read_text())
    assert result["settings"] == {"scenarios": ["day"], "seeds": [3], "duration_s": 2.0}
    assert result["packages"]["numpy"]
    assert result["machine"]["cores"] >= 1
    rows = [record["row"] for record in result["records"]]
    assert rows[0] == "paper"
    assert set(rows) == set(result["configs"])


def test_scores_of_a_row_are_those_of_its_configuration(ablation):
    from benchmarks.judging import judge_recordings
    from benchmarks.recordings import simulated
    from jeat_graph.config.reading import config_from_dict

    result = json.loads((ablation / "ablation.json").read_text())
    last = result["records"][-1]
    config = config_from_dict(result["configs"][last["row"]])
    assert judge_recordings(config, [simulated("day", 3, 2.0)]) == last["scores"]


def test_tables_are_rendered_again_from_the_result(ablation, tmp_path, capsys):
    readme = tmp_path / "README.md"
    readme.write_text("<!-- table: ablation -->\n<!-- end -->\n")
    source = str(ablation / "ablation.json")
    assert main(["ablation", "--from", source, "--readme", str(readme)]) == 0
    assert (ablation / "ablation.md").read_text().strip() in readme.read_text()
    assert "+ likelihood as cost" in capsys.readouterr().out


def test_a_result_of_another_benchmark_is_refused(ablation, capsys):
    assert main(["accuracy", "--from", str(ablation / "ablation.json")]) == 2
    assert "not a result of `python -m benchmarks accuracy`" in capsys.readouterr().err


def test_missing_real_data_are_skipped_with_a_line(tmp_path, capsys):
    args = ["ablation", *SMALL, "--data", str(tmp_path)]
    assert main(args) == 0
    captured = capsys.readouterr()
    assert "no KITTI sequences" in captured.err
    assert "real data" not in captured.out


def test_accuracy_compares_sensors_associations_and_detectors(tmp_path, capsys):
    args = ["accuracy", *SMALL, "--quick", "--no-peers", "--out", str(tmp_path)]
    assert main(args) == 0
    table = capsys.readouterr().out
    for row in ("highway, rgb + evt", "highway, evt", "paper, rgb + evt", "sequential", "paper, no light"):
        assert row in table
    found = json.loads((tmp_path / "accuracy.json").read_text())["detectors"]
    assert 0.0 < found["day"]["rgb"]["AP50"] <= 100.0


def test_unknown_scenario_is_named(capsys):
    assert main(["ablation", "--scenarios", "dya", "--quick"]) == 2
    assert "dya" in capsys.readouterr().err


def test_kind_of_benchmark_is_required():
    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 2


@pytest.mark.parametrize("kind", ["accuracy", "speed", "smoothing", "events"])
def test_a_quick_benchmark_never_replaces_published_tables(kind, capsys, tmp_path):
    page = tmp_path / "README.md"
    page.write_text("<!-- table: speed -->\n1\n<!-- end -->\n")
    if "--quick" not in _help_of_benchmark(kind, capsys):
        pytest.skip("has no --quick")
    assert main([kind, "--quick", "--readme", str(page)]) == 2
    assert "leave out --readme" in capsys.readouterr().err


def _help_of_benchmark(kind: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit):
        build_parser().parse_args([kind, "--help"])
    return capsys.readouterr().out


def test_fewer_seeds_never_replace_published_tables():
    from benchmarks.common import settings
    from jeat_graph.data.errors import ConfigError

    args = build_parser().parse_args(["accuracy", "--seeds", "0", "--readme", "README.md"])
    with pytest.raises(ConfigError, match="leave out --seeds"):
        settings(args)


def test_a_benchmark_that_simulates_says_how_to_get_the_simulator():
    code = (
        "import sys; sys.modules['jeat_graph_sehn'] = None\n"
        "from benchmarks.__main__ import main; sys.exit(main(['real', '--quick']))"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode == 2
    assert done.stderr.startswith("jeat-graph benchmarks: ")
    assert "pip install ./sehn" in done.stderr
    assert done.stderr.count("\n") == 1
