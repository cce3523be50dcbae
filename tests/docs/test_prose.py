"""The words of the documentation, and the linter that keeps them."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
_SPEC = importlib.util.spec_from_file_location("prose", ROOT / ".ci" / "prose.py")
assert _SPEC is not None
assert _SPEC.loader is not None
prose = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(prose)

GLOSSARY = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
TERMS = [line for line in GLOSSARY.splitlines() if line.startswith("| ") and not line.startswith("| term")]


@pytest.mark.parametrize(
    "sentence",
    [
        "What its scores are worth is learnt while tracking.",
        "Boxes that were looked at in vain",
        "a sensor that is lonely",
        "what is borne out by others",
        "who is waited for",
        "where every vehicle is, from nothing that came later",
        "A sensor that goes blind takes no tracks with it, and is named",
        "with what the other half taught, without truth, causal",
        "best of the others on any input, each score by itself",
        "is believed in full if none of its repeated detections came to nothing",
        "in scans of the slowest sensor; the less counts",
        "no two such trainings are equal",
        "of networks give both commands the names",
        "an error of .6 km/h",
    ],
)
def test_words_that_no_textbook_has_are_found_and_their_line_is_named(sentence):
    (found, *_) = prose.findings("page.md", f"# Title\n\n{sentence}\n")
    assert found.startswith("page.md:3: ")


def test_words_on_two_lines_are_found_where_they_begin():
    (found,) = prose.findings("help", "train for so long; no two such\n    trainings are equal\n")
    assert found.startswith("help:1: ")


@pytest.mark.parametrize(
    "text",
    [
        "An error of 0.6 km/h, a file `.5`, a link [text](a.5) and version 2.6.",
        "```text\nthis is worth nothing\n```\n",
        "The path docs/.ci, the number 1.5 and the formula $.5$.",
    ],
)
def test_code_links_and_formulas_are_left_alone(text):
    assert [line for line in prose.findings("page.md", text) if "zero" in line or "worth" in line] == []


def test_pages_and_help_have_no_findings():
    texts = [(path.name, path.read_text(encoding="utf-8")) for path in prose.pages()]
    assert len(texts) > 20
    assert [line for name, text in (*texts, *prose.helps()) for line in prose.findings(name, text)] == []


def test_the_glossary_has_at_most_sixty_terms_each_once():
    names = [line.split("|")[1].strip() for line in TERMS]
    assert 30 <= len(names) <= 60
    assert len(set(names)) == len(names)
    assert all(line.split("|")[2].strip() for line in TERMS)


def plain(text: str) -> str:
    """Lower case, and one blank for what stands between words."""
    return re.sub(r"[\s_]+", " ", text.lower())


def test_every_term_of_the_glossary_is_used():
    """In the pages, or in the code, where names have underlines for blanks."""
    pages = [path for path in prose.pages() if path.name != "glossary.md"]
    folders = ("filters", "association", "smoothers", "eval", "jeat_graph")
    modules = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    used = " ".join(plain(path.read_text(encoding="utf-8")) for path in (*pages, *modules))
    names = [
        plain(one).strip()
        for line in TERMS
        for one in re.sub(r"\$[^$]*\$|\([^)]*\)", "", line.split("|")[1]).split(",")
    ]
    assert len(names) >= len(TERMS)
    assert [one for one in names if one not in used] == []


def test_every_reference_of_the_glossary_is_listed_and_used():
    body, _, listed = GLOSSARY.partition("## References")
    numbers = set(re.findall(r"^(\d+)\. ", listed, flags=re.MULTILINE))
    used = {one for group in re.findall(r"\[([\d, ]+)\]", body) for one in group.split(", ")}
    assert used == numbers
