"""Check the words of README, documentation and `--help`: the field's own terms, numbers with their zero.

`python .ci/prose.py` prints each finding as `file:line: "words": what to write instead`, and fails where
there is one. Code and links are not looked at. Terms are those of docs/glossary.md.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: What is not to be written, and what is written instead.
RULES: tuple[tuple[str, str], ...] = (
    (
        r"\bworth(y|less)?\b(?! (reading|a look))",
        "name the quantity: existence probability, score calibration, gain",
    ),
    (r"\b(in vain|vain)\b", "unconfirmed, or false"),
    (r"\bborne out\b", "confirmed by later detections"),
    (r"\bclaims?\b", "association, or reservation"),
    (r"\banew\b", "again; start over; reset"),
    (r"\btakers?\b", "the track that it is assigned to; recipient"),
    (r"\bindifferen(t|ce)\b", "decision threshold"),
    (r"\blonely\b", "seen by one sensor alone"),
    (r"\bfruitless\b", "without a confirmed track"),
    (r"\bunproven\b", "tentative"),
    (r"\bwitness(es|ed)?\b", "independent detection"),
    (r"\bwho(ever)? is waited for\b", "the sensors whose scans are awaited"),
    (r"\bnobody (looks|looked|sees|saw)\b", "no sensor sees it"),
    (r"\bfrom nothing that came later\b", "using past data only"),
    (r"\btakes no tracks with it\b", "tracks survive"),
    (r"\bwith what the other half taught\b", "self-calibrated on the other half"),
    (r"\beach score by itself\b", "per metric"),
    (r"\bbelieved in full\b", "trusted fully"),
    (r"\bthe less counts\b", "the smaller limit applies"),
    (r"\bno two such \w+ are equal\b", "not reproducible"),
    (r"\bgive both commands the names\b", "pass the same options to both commands"),
    (r"\bto be had\b", "available"),
    (r"(?<![\w./)\]-])\.\d", "write the zero: 0.6, not .6"),
)
#: Made by the build from the code.
GENERATED = frozenset({"docs/reference/commands.md"})
_CODE = re.compile(r"```.*?```|`[^`\n]*`|\$\$.*?\$\$|\$[^$\n]*\$|\]\([^)]*\)|<!--.*?-->", re.DOTALL)


def pages() -> Iterator[Path]:
    """Markdown pages that are checked."""
    found = [*ROOT.glob("*.md"), ROOT / "sehn" / "README.md", *(ROOT / "docs").rglob("*.md")]
    for path in sorted(found):
        name = path.relative_to(ROOT).as_posix()
        if "_build" not in path.parts and name not in GENERATED:
            yield path


def without_code(text: str) -> str:
    """The prose of a page; what is left out leaves its lines, so that numbers of lines stay."""
    return _CODE.sub(lambda match: "\n" * match[0].count("\n"), text)


def findings(name: str, text: str) -> list[str]:
    """List what is wrong with a text, one line each.

    Args:
        name: of the page, for the lines.
        text: Markdown or plain text.
    """
    prose = without_code(text)
    out = []
    for pattern, better in RULES:
        for match in re.finditer(pattern.replace(" ", r"\s+"), prose, re.IGNORECASE):
            line = prose.count("\n", 0, match.start()) + 1
            out.append((line, f'{name}:{line}: "{match[0]}": {better}'))
    return [text for _, text in sorted(out)]


def helps() -> Iterator[tuple[str, str]]:
    """Names and texts of the commands' help."""
    from jeat_graph.cli.main import COMMANDS, build_parser

    for name in sorted(COMMANDS):
        parser = build_parser(name)
        for action in parser._actions:
            choices = action.choices if isinstance(action.choices, dict) else {}
            if name in choices:
                yield f"jeat-graph {name} --help", choices[name].format_help()


def main() -> int:
    """Print all findings; 1 where there is one."""
    sys.path.insert(0, str(ROOT))
    texts = [(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")) for path in pages()]
    lines = [line for name, text in (*texts, *helps()) for line in findings(name, text)]
    print(*lines, f"prose: {len(texts)} pages and the help of the commands, {len(lines)} findings", sep="\n")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
