"""`jeat-graph train`: what it says to whom who asks for what cannot be."""

from __future__ import annotations

import builtins

import pytest

from jeat_graph.cli.main import main


def refused(capsys, *words):
    """The one line that a command answers with."""
    assert main(["train", *words]) == 2
    shown = capsys.readouterr()
    (line,) = shown.err.splitlines()
    assert line.startswith("jeat-graph train: ")
    return line


def test_without_pytorch_the_packages_are_named(tmp_path, capsys, monkeypatch):
    real = builtins.__import__

    def lacking(name, *rest, **more):
        if name.partition(".")[0] == "torch":
            raise ImportError("no module named torch")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", lacking)
    line = refused(capsys, "frames", str(tmp_path), "--out", str(tmp_path / "n.onnx"))
    assert "pip install './sehn[train]'" in line


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["frames", "{dir}", "--out", "{dir}/n.pt"], "must end in .onnx"),
        (["frames", "{dir}", "--out", "{dir}/n.onnx"], "holds no segments with truth"),
        (["frames", "{dir}/none.json", "--out", "{dir}/n.onnx"], "none.json: no such file"),
        (["events", "{dir}/none", "--out", "{dir}/n.onnx"], "holds no segments with truth"),
        (["events", "{dir}", "--out", "{dir}/n.onnx", "--crop", "100x64"], "whole multiples of 16"),
        (
            ["events", "{dir}", "--out", "{dir}/n.onnx", "--set", "events.drop=1"],
            "did you mean events.drop_share",
        ),
        (
            ["events", "{dir}", "--out", "{dir}/n.onnx", "--set", "net.memory_keep=2"],
            "net.memory_keep: 2.0 is not in",
        ),
        (
            ["events", "{dir}", "--out", "{dir}/n.onnx", "--set", "learning_rate"],
            "must read section.key=value",
        ),
    ],
)
def test_what_cannot_be_is_said_in_one_line(tmp_path, capsys, words, said):
    pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")
    assert said in refused(capsys, *(word.format(dir=tmp_path) for word in words))
    assert list(tmp_path.iterdir()) == []


def test_what_learned_nothing_is_not_written_unless_it_is_forced(tmp_path, capsys, monkeypatch):
    pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")
    from jeat_graph_sehn.training.judging import Precision

    from ..training.small_sets import write_segment

    def found_nothing(*_):
        return {"all": Precision(0.0, 0.0, 7)}

    monkeypatch.setattr("jeat_graph_sehn.training.procedure.judge", found_nothing)
    monkeypatch.setattr("jeat_graph_sehn.training.procedure.draw_log", lambda _, path: path.touch())
    write_segment(tmp_path / "a" / "segments" / "000000", 0)
    out = tmp_path / "out" / "n.onnx"
    small = ["--net", "tiny", "--crop", "32x32", "--batch", "2", "--epochs", "0.2", "--threads", "1"]
    words = ["train", "frames", str(tmp_path / "a"), "--out", str(out), *small]
    assert main(words) == 1
    shown = capsys.readouterr()
    assert "learned nothing, AP50 0 by 7 boxes; nothing is written" in shown.err.splitlines()[-1]
    assert shown.out == ""
    assert [path.name for path in out.parent.iterdir()] == ["n.checkpoint"]
    assert main([*words, "--force"]) == 0
    assert "goes on from step" in capsys.readouterr().err  # to its end: there are no more steps
    assert sorted(path.name for path in out.parent.iterdir()) == ["n.csv", "n.onnx", "n.png"]


@pytest.mark.parametrize(
    ("of", "more", "memory"),
    [
        ("time", [], "time"),
        ("windows", [], "windows"),
        ("windows", ["--set", "net.memory=time"], "time"),
        ("time", ["--set", "net.memory=windows"], "windows"),
    ],
)
def test_what_goes_on_with_a_network_by_time_goes_by_time(tmp_path, monkeypatch, of, more, memory):
    """Unless it is told otherwise, which is refused later, in words of its own."""
    pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")
    from jeat_graph_sehn.training.export import write_onnx
    from jeat_graph_sehn.training.network import DetectionNet
    from jeat_graph_sehn.training.procedure import Trained
    from jeat_graph_sehn.training.settings import NetSettings

    asked = []
    monkeypatch.setattr(
        "jeat_graph_sehn.training.procedure.train",
        lambda request, *_: asked.append(request) or Trained((request.out,), {}),
    )
    card = {"net": {"kind": "events", "width": 2, "memory": of}}
    start, out = tmp_path / "start.onnx", tmp_path / "n.onnx"
    write_onnx(DetectionNet(NetSettings(**card["net"])).eval(), (32, 32), card, start)
    assert main(["train", "events", str(tmp_path), "--start", str(start), "--out", str(out), *more]) == 0
    assert asked[0].net.memory == memory


@pytest.mark.slow
def test_a_training_from_the_command_line(tmp_path, capsys):
    pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")
    from ..training.small_sets import write_segment

    for name in ("a", "b"):
        write_segment(tmp_path / name / "segments" / "000000", 0)
    out = tmp_path / "out" / "n.onnx"
    small = [
        "--net",
        "tiny",
        "--crop",
        "32x32",
        "--batch",
        "2",
        "--epochs",
        "0.2",
        "--threads",
        "1",
        "--force",
    ]
    assert (
        main(
            ["train", "frames", str(tmp_path / "a"), "--test", str(tmp_path / "b"), "--out", str(out), *small]
        )
        == 0
    )
    shown = capsys.readouterr()
    assert "tested, b: AP50" in shown.out
    assert "too few segments to part" in shown.err
    assert sorted(p.name for p in out.parent.iterdir()) == ["n.csv", "n.onnx", "n.png"]
    assert (out.parent / "n.csv").read_text(encoding="utf-8").startswith("step,progress,learning_rate,loss")
    same = str(tmp_path / "a")
    assert "cannot be the test as well" in refused_last(
        capsys, "frames", same, "--test", same, "--out", str(out)
    )


def refused_last(capsys, *words):
    """The last line of a command that failed after it had said something."""
    assert main(["train", *words]) == 2
    return capsys.readouterr().err.splitlines()[-1]
