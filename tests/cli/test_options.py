"""One name means one thing in all commands; nothing is understood by the beginning of its name."""

from __future__ import annotations

import argparse
import warnings

import pytest

from jeat_graph.cli.main import COMMANDS, build_parser
from jeat_graph.cli.options import overrides
from jeat_graph.config.argument_types import drawn_size, picture_size

NEEDED = {
    "calibrate": ["d.csv", "--out", "c.yaml"],
    "compare": ["run"],
    "count": ["run", "--line", "0,0,1,1"],
    "eval": ["run", "--gt", "gt.csv"],
    "export": ["run", "--to", "cvat", "--out", "f.zip"],
    "render": ["run", "--out", "f.mp4"],
    "report": ["run", "--out", "p.html"],
    "stream": [],
    "view": ["run"],
    "track": ["d.csv", "--out", "run"],
    "batch": ["m.csv", "--out", "runs"],
}


def parse(command: str, *more: str) -> argparse.Namespace:
    return build_parser(command).parse_args([command, *NEEDED[command], *more])


@pytest.mark.parametrize(
    "command", ["track", "eval", "compare", "calibrate", "render", "report", "count", "export", "view"]
)
def test_rate_is_that_of_the_input(command):
    args = parse(command, "--rate", "29.97")
    assert args.rate == 29.97
    assert getattr(args, "output_rate", None) is None


@pytest.mark.parametrize("command", ["track", "render", "export"])
def test_output_rate_is_that_of_what_is_written(command):
    args = parse(command, "--output-rate", "50")
    assert (args.rate, args.output_rate) == (None, 50.0)


@pytest.mark.parametrize(
    ("command", "old", "new"),
    [
        ("track", "--frame-rate", "--output-rate"),
        ("render", "--frame-rate", "--rate"),
        ("export", "--frames-per-second", "--output-rate"),
    ],
)
def test_a_name_of_before_is_told_how_it_is_called_now(command, old, new, capsys):
    parse(command, old, "50")
    assert capsys.readouterr().err == f"jeat-graph {command}: warning: {old} is called {new} now\n"


def test_names_of_before_are_still_understood_and_not_shown():
    assert parse("track", "--frame-rate", "50").output_rate == 50.0
    assert parse("render", "--frame-rate", "50").rate == 50.0
    for command in ("track", "render"):
        parser = build_parser(command)
        sub = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction)).choices[command]
        assert "--frame-rate" not in sub.format_help()


@pytest.mark.parametrize("command", ["track", "stream", "calibrate", "batch"])
def test_the_size_of_the_picture_is_one_option(command):
    assert parse(command, "--image", "1920x1080").image == (1920, 1080)


def test_the_size_of_the_picture_is_a_setting_like_any_other():
    args = parse("track", "--set", "image.width=7", "--image", "1920x1080", "--smoother", "full")
    assert overrides(args) == [
        "image.width=7",
        "image.width=1920",
        "image.height=1080",
        "smoother.engine=full",
    ]


@pytest.mark.parametrize("command", COMMANDS)
def test_no_option_is_understood_by_its_beginning(command, capsys):
    parser = build_parser(command)
    sub = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction)).choices[command]
    assert not sub.allow_abbrev
    if command == "track":
        with pytest.raises(SystemExit):
            parse("track", "--diagnos")
        assert "unrecognized arguments: --diagnos" in capsys.readouterr().err


def test_a_size_reads_width_then_height():
    assert picture_size("1280x720") == picture_size(" 1280X720") == picture_size("1280×720") == (1280, 720)
    assert drawn_size("8192x16") == (8192, 16)


@pytest.mark.parametrize(
    "text", ["large", "1280", "1280x", "12.5x720", "-1280x720", "8x720", "70000x720", "1x1x1"]
)
def test_a_size_that_no_picture_has_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="must"):
        picture_size(text)
    with pytest.raises(argparse.ArgumentTypeError, match="8192"):
        drawn_size("9000x720")


def test_a_warning_of_the_library_is_one_line_that_names_the_command(capsys, monkeypatch):
    from jeat_graph.cli import count_command
    from jeat_graph.cli.main import main

    def run(_: argparse.Namespace) -> int:
        warnings.warn("first\nsecond", UserWarning, stacklevel=1)
        return 0

    monkeypatch.setattr(count_command, "run", run)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert main(["count", *NEEDED["count"]]) == 0
    assert capsys.readouterr().err == "jeat-graph count: warning: first second\n"
