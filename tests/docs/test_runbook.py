"""The lines that the guide to live use tells operators of are those that the program says."""

from __future__ import annotations

import ast
import io
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from jeat_graph.cli.main import main
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.messages import decode_scans
from jeat_graph.live.session import Ends, Session
from jeat_graph.tracking.tracker import Tracker

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "guides" / "live.md").read_text(encoding="utf-8")
#: What differs from one line to the next, in the guide and in what is said.
_VARIES = re.compile(r"'[^']*'|-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def lines_of(heading: str) -> list[str]:
    """What stands in the first column of the table under a heading of the guide."""
    _, _, rest = GUIDE.partition(f"\n### {heading}\n")
    table = rest.partition("\n#")[0]
    return re.findall(r"^\| `([^`]+)` \|", table, flags=re.MULTILINE)


def general(text: str) -> str:
    return _VARIES.sub("*", text)


def scan(t: float, sensor: str, stamp: float | None = None, **more: object) -> str:
    boxes = [[100 + 40 * (t % 20.0), 100, 60, 40]]
    return json.dumps(
        {"t": round(t if stamp is None else stamp, 4), "sensor": sensor, "boxes": boxes, **more}
    )


def both(begin: float, count: int, jump_s: float = 0.0) -> list[str]:
    """Messages of two sensors, each a list of scans of one time."""
    times = [begin + k * 0.05 for k in range(count)]
    return [f"[{scan(t, 'evt', t + jump_s)}, {scan(t, 'rgb', t + jump_s)}]" for t in times]


def in_turn(rgb_s: float) -> list[str]:
    """Messages of two sensors, of which one has another clock."""
    return [
        one for k in range(120) for one in (scan(k * 0.05, "evt"), scan(k * 0.05, "rgb", k * 0.05 + rgb_s))
    ]


def told_of_messages(seqs: list[int], times: list[float]) -> list[str]:
    """What a session says of messages with numbers of their source, as a broker brings them."""
    said: list[str] = []
    ends = Ends(tracks=lambda *_: None, warn=said.append)
    session = Session(LiveTracker(Tracker(image=(1280, 720))), ends)
    for seq, t in zip(seqs, times, strict=True):
        message = {"v": 1, "source": "gantry7", "seq": seq, "scans": [json.loads(scan(t, "rgb"))]}
        session.accept(decode_scans(json.dumps(message).encode(), "broker", 1))
    return said


#: Inputs with a fault, options, and the code that the command ends with.
FAULTS: dict[str, tuple[list[str], tuple[str, ...], int]] = {
    "one wrong": ([*both(0, 40), *both(2, 1, 1e9), *both(2, 20)], (), 0),
    "a little late": (in_turn(-0.5), (), 0),
    "an hour ahead": ([*in_turn(3600.0), *both(6, 10)], (), 0),
    "stands still": ([*both(0, 21), *(scan(1.0 + k, "rgb", 1.0) for k in range(120))], (), 0),
    "pause": ([*both(0, 100), *both(3600, 40)], (), 0),
    "set back": ([*both(3600, 40), *both(0, 160)], (), 0),
    "unreadable": ([*both(0, 5), "{}", *both(1, 5)], ("--on-error", "skip"), 0),
    "refused": ([*both(0, 20), *both(0.5, 5)], ("--late", "refuse"), 2),
}


@pytest.fixture(scope="module")
def said() -> set[str]:
    """All lines that the faults bring, without what varies."""
    found: set[str] = set()
    with pytest.MonkeyPatch.context() as patch:
        for lines, options, code in FAULTS.values():
            complaint = io.StringIO()
            patch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO("\n".join([*lines, ""]).encode())))
            patch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO()))
            patch.setattr(sys, "stderr", complaint)
            assert main(["stream", "--image", "1280x720", *options]) == code, complaint.getvalue()
            found |= {general(line) for line in complaint.getvalue().splitlines()}
    times = [k * 0.05 for k in range(300)]
    for seqs in ([*range(1, 101), *range(1, 201)], list(range(1, 301))):  # started again; all once more
        lines = told_of_messages(seqs * 2, times * 2)
        found |= {general(line) for line in lines}
    return found


@pytest.mark.parametrize("line", lines_of("Wrong times"))
def test_a_line_on_wrong_times_is_said_when_the_fault_is_there(line, said):
    assert any(one.endswith(general(line)) for one in said), sorted(said)


def test_the_clock_that_the_guide_says_to_take_off_is_the_right_one(monkeypatch, capsys):
    """`after the newest` by 3600 s: latency_s=3600."""
    lines = "\n".join([*in_turn(3600.0), ""])
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(lines.encode())))
    assert "`sensors.rgb.latency_s=3600`" in GUIDE
    assert main(["stream", "--image", "1280x720", "--set", "sensors.rgb.latency_s=3600"]) == 0
    shown = capsys.readouterr()
    assert len(shown.out.splitlines()) == 240
    assert "has been taken" not in shown.err


def texts(path: Path) -> Iterator[str]:
    """Texts in a file of Python, `*` for what is put in."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr):
            parts = (part.value if isinstance(part, ast.Constant) else "*" for part in node.values)
            yield re.sub(r"\*+", "*", "".join(map(str, parts)))


@pytest.mark.parametrize("line", lines_of("Clocks that differ"))
def test_a_line_on_clocks_is_one_of_the_program(line):
    live = ROOT / "jeat_graph" / "live"
    files = (ROOT / "jeat_graph" / "runs" / "clock_comparison.py", live / "late.py", *live.glob("clock_*.py"))
    pieces = [piece.strip(" ()+") for piece in re.split(r"…|\*", general(line))]
    said = [text for path in files for text in texts(path)]
    assert [text for text in said if all(piece in text for piece in pieces)]


def test_the_tables_of_the_runbook_are_found():
    assert len(lines_of("Wrong times")) >= 12
    assert len(lines_of("Clocks that differ")) >= 5
