"""What README and documentation promise: code runs, commands are understood, links lead somewhere."""

from __future__ import annotations

import dataclasses
import importlib.util
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import yaml

from benchmarks.__main__ import build_parser as benchmarks_parser
from jeat_graph.cli.main import COMMANDS, build_parser, main
from jeat_graph.config.reading import load_config
from jeat_graph.tracking.tracker import Tracker

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "sehn" / "README.md",
    *sorted(p for p in (ROOT / "docs").rglob("*.md") if "_build" not in p.parts),
]
GENERATED = {"commands.md"}
#: Letters of a line of an equation beside which the page of the site, 46 em wide, has no room for more.
WIDEST_EQUATION = 40


def blocks(page: Path, language: str) -> list[str]:
    """Blocks of code of one language in a page, in their order."""
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def commands(page: Path, languages: tuple[str, ...] = ("sh", "text")) -> list[list[str]]:
    """Words of the `jeat-graph` commands in a page's blocks, comments, pipes and brackets left out."""
    found = []
    for language in languages:
        for block in blocks(page, language):
            for line in block.replace("\\\n", " ").splitlines():
                words = (
                    shlex.split(line.split(" | ")[-1], comments=True)
                    if line.startswith("jeat-graph ")
                    else []
                )
                found += [words[1:]] if words else []
    return found


def benchmarks_run(page: Path) -> list[list[str]]:
    """Words after `python -m benchmarks` in a page's blocks."""
    lines = "\n".join(blocks(page, "sh") + blocks(page, "text")).replace("\\\n", " ").splitlines()
    start = "python -m benchmarks "
    return [shlex.split(line.removeprefix(start), comments=True) for line in lines if line.startswith(start)]


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


PYTHON = [
    pytest.param(block, id=f"{name(page)}-{k}")
    for page in PAGES
    for k, block in enumerate(blocks(page, "python"))
]
YAML = [
    pytest.param(block, id=f"{name(page)}-{k}")
    for page in PAGES
    for k, block in enumerate(blocks(page, "yaml"))
]
SHELL = [
    pytest.param(words, id=f"{name(page)}: {' '.join(words)}"[:90])
    for page in PAGES
    if page.name not in GENERATED
    for words in commands(page)
]


@pytest.mark.parametrize("block", PYTHON)
def test_blocks_of_python_run(block, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(block, "block", "exec"), {"__name__": "block"})


@pytest.mark.parametrize("block", YAML)
def test_blocks_of_yaml_are_mappings_of_names(block):
    found = yaml.safe_load(block)
    assert isinstance(found, dict)
    assert all(re.fullmatch(r"\w+", str(key)) for key in found)


def test_the_rig_by_hand_is_understood(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text(blocks(ROOT / "docs" / "guides" / "rigs.md", "yaml")[0], encoding="utf-8")
    event_camera = load_config("default", rig=str(path)).sensors["evt"]
    assert event_camera.image == (640, 360)
    assert (event_camera.clock.offset_s, event_camera.clock.drift_ppm) == (0.15, 12.0)


def test_the_readme_tracks_a_vehicle_in_a_few_lines(capsys):
    exec(compile(blocks(ROOT / "README.md", "python")[0], "README", "exec"), {})
    shown = capsys.readouterr().out
    assert shown.startswith("Trajectories: 1 rows, 1 track, 1.95 to 1.95 s")
    assert "track 1 at [717.0 300.0 80.0 60.0] px" in shown


@pytest.mark.parametrize("words", SHELL)
def test_commands_are_understood(words):
    if words[0].startswith("-") or words[0].isupper():
        pytest.skip("shows the command itself")
    assert words[0] in COMMANDS
    args = build_parser(words[0]).parse_args([word for word in words if word != "…"])
    assert args.command == words[0]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_configurations_that_a_page_names_are_there(page):
    """In blocks and in prose: what `--config` takes is a preset, a file, or stands for a name."""
    named = re.findall(r"--config[= ]([^\s`'\"|,;)\]]+)", page.read_text(encoding="utf-8"))
    stand_ins = {"FILE", "NAME", "NAME|FILE", "…", "NAME|FILE.yaml"}
    there = {path.stem for path in (ROOT / "configs").glob("*.yaml")}
    strange = [one for one in named if one not in there | stand_ins and not one.endswith((".yaml", ".yml"))]
    assert strange == []


def test_every_guide_stands_in_one_group():
    """The groups of docs/index.md are in the order in which somebody needs the guides."""
    listed = re.findall(
        r"^guides/(.+)$", (ROOT / "docs" / "index.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert sorted(listed) == sorted(path.stem for path in (ROOT / "docs" / "guides").glob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_equations_fit_into_the_page(page):
    """A line of an equation has so many letters at most, without marks; `aligned` has several lines."""
    for equation in re.findall(r"\$\$(.*?)\$\$", page.read_text(encoding="utf-8"), re.DOTALL):
        for line in equation.split(r"\\"):
            shown = re.sub(r"\\(begin|end)\{\w+\}|\\[,;]|\\(quad|left|right|Big|big)\b|[&{}\s^_]", "", line)
            shown = re.sub(r"\\[a-z]+", "x", shown, flags=re.IGNORECASE)
            assert len(shown) <= WIDEST_EQUATION, line


IN_PROSE = [
    pytest.param(text, id=f"{name(page)}: {text}"[:90])
    for page in PAGES
    for text in re.findall(r"`jeat-graph ([^`\n]+)`", page.read_text(encoding="utf-8"))
    if page.name not in GENERATED
]


@pytest.mark.parametrize("text", IN_PROSE)
def test_commands_in_prose_are_understood(text):
    words = shlex.split(text.split(" | ")[0])
    if words[0].startswith("-") or words[0].isupper():
        pytest.skip("shows the command itself")
    assert words[0] in COMMANDS
    options = [word.split("=")[0] for word in words[1:] if word.startswith("--")]
    commands_there = next(one for one in build_parser(words[0])._actions if isinstance(one.choices, dict))
    parser = commands_there.choices[words[0]]
    below = [one.choices for one in parser._actions if isinstance(one.choices, dict)]
    known = "".join(one.format_help() for one in (parser, *(sub for subs in below for sub in subs.values())))
    assert [option for option in options if option not in known] == []


def test_benchmarks_are_understood():
    run = [words for page in PAGES for words in benchmarks_run(page)]
    assert len(run) > 5
    for words in run:
        assert benchmarks_parser().parse_args([word for word in words if word != "…"]).kind == words[0]


@pytest.mark.slow
def test_the_tutorial_runs_from_beginning_to_end(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    steps = commands(ROOT / "docs" / "tutorial.md", ("sh",))
    assert [words[0] for words in steps] == ["simulate", "track", "eval", "compare", "report", "render"]
    # As it stands there but for the length: most of the time would go into the film.
    steps[0][steps[0].index("12")] = "2"
    for words in steps:
        assert main(words) == 0, " ".join(words)
    assert (tmp_path / "run.webm").stat().st_size > 0
    assert (tmp_path / "run.html").stat().st_size > 0


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_to_files(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = re.findall(r"\]\((?!http|#)([^)#]+)(?:#[^)]*)?\)", text)
    missing = [t for t in targets if not (page.parent / t).is_file() and Path(t).name not in GENERATED]
    assert missing == []


def anchors(page):
    """What headings of a page are called in links: small letters, no punctuation, hyphens for spaces."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    headings = (re.sub(r"[^\w\- ]", "", one.lower()) for one in re.findall(r"^#+ (.+)$", text, re.MULTILINE))
    return {one.replace(" ", "-") for one in headings}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_to_headings(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = re.findall(r"\]\((?!http)([^)#]*)#([^)]+)\)", text)
    pages = [(page.parent / target if target else page, anchor) for target, anchor in links]
    read = [(target, anchor) for target, anchor in pages if target.suffix == ".md"]
    assert [f"{t.name}#{a}" for t, a in read if a not in anchors(t)] == []


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


def test_settings_that_the_short_answers_name_exist():
    text = (ROOT / "docs" / "questions.md").read_text(encoding="utf-8")
    known = load_config("default", ["sensors.some={rate_hz: 20}"])
    sections = {f.name: getattr(known, f.name) for f in dataclasses.fields(known)}
    sections["sensors"] = known.sensors["some"]
    named = re.findall(r"\b([a-z]+)\.(?:NAME\.|evt\.)?([a-z_]+)\b(?:=|`)", text)
    named = [(section, setting) for section, setting in named if section in sections]
    assert len(named) >= 5
    for section, setting in named:
        assert hasattr(sections[section], setting), f"{section}.{setting}"


def test_what_the_short_answers_say_of_dying_tracks_is_so():
    tracker = Tracker(image=(1920, 1080))
    for k in range(20):
        tracker.step((k / 20, "rgb", [[600 + 3 * k, 300, 80, 60]], [0.95]))
    for k in range(20, 120):
        tracker.step((k / 20, "rgb", [], []))
        if tracker.num_tracks == 0:
            break
    assert tracker.num_tracks == 0
    assert tracker.time is not None
    assert tracker.time - 0.95 <= 3.0 + 1 / 20


@pytest.mark.parametrize(
    ("asked", "answer"),
    [
        ("tracks die sooner", "at the latest 3 s"),
        ("why track", "jeat-graph explain run --track 7"),
        ("one camera", "jeat-graph track rgb=det.txt"),
        ("existence", "probability that there is an object"),
        ("how late smoothed row", "smoother.lag_s"),
        ("picture size", "--image 1920x1080"),
        ("nees", "2 in `eval`"),
    ],
)
def test_the_short_answers_have_what_newcomers_search_for(asked, answer):
    rows = (ROOT / "docs" / "questions.md").read_text(encoding="utf-8").splitlines()
    mine = [row for row in rows if answer in row]
    assert mine
    assert all(word in mine[0].lower() for word in asked.split())


def test_the_search_puts_the_short_answers_first():
    """The page that the scorer lifts is there, and the settings of the site name the scorer."""
    scorer = (ROOT / "docs" / "_static" / "scorer.js").read_text(encoding="utf-8")
    (page,) = re.findall(r'docname === "(\w+)"', scorer)
    assert page == "questions"
    assert (ROOT / "docs" / f"{page}.md").is_file()
    assert '"scorer.js"' in (ROOT / "docs" / "conf.py").read_text(encoding="utf-8")


def test_every_extra_is_in_the_guide_to_installing():
    found = set()
    for folder in (ROOT, ROOT / "sehn"):
        project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        found |= set(project["optional-dependencies"])
    text = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    rows = " ".join(row.split("|")[1] for row in text.splitlines() if row.startswith("| `"))
    assert found == set(re.findall(r"`(\w+)`", rows))


def made_from_the_code():
    """The module that writes the pages made from the code."""
    spec = importlib.util.spec_from_file_location("pages", ROOT / "docs" / "_ext" / "generated_reference.py")
    assert spec is not None
    assert spec.loader is not None
    pages = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pages)
    return pages


def test_the_page_of_settings_in_the_repository_is_that_of_the_code():
    kept = (ROOT / "docs" / "reference" / "configuration.md").read_text(encoding="utf-8")
    assert kept == made_from_the_code().configuration_page(), "run python docs/_ext/generated_reference.py"


def test_the_page_of_records_in_the_repository_is_that_of_the_code():
    kept = (ROOT / "docs" / "reference" / "registered.md").read_text(encoding="utf-8")
    assert kept == made_from_the_code().records_page(), "run python docs/_ext/generated_reference.py"


def test_the_page_of_layouts_in_the_repository_is_that_of_the_records():
    kept = (ROOT / "docs" / "reference" / "layouts.md").read_text(encoding="utf-8")
    assert kept == made_from_the_code().layouts_page(), "run python docs/_ext/generated_reference.py"


def test_the_page_of_settings_has_what_a_run_takes_without_being_told():
    """The generated page shows the values of the preset `default`, with unit and meaning."""
    text = made_from_the_code().configuration_page()
    known = load_config("default", ["sensors.rgb={rate_hz: 20}"])
    row = next(line for line in text.splitlines() if line.startswith("| `smoother.lag_s`"))
    assert f"| `{known.smoother.lag_s:g}` |" in row
    assert "| s |" in row
    rows = re.findall(r"^\| `(\w+)\.(?:NAME\.)?(\w+)` \| (.*?) \|", text, flags=re.MULTILINE)
    sections = {f.name: getattr(known, f.name) for f in dataclasses.fields(known)}
    expected = {
        (section, f.name)
        for section, value in sections.items()
        for f in dataclasses.fields(value["rgb"] if isinstance(value, dict) else value)
    }
    assert {(section, setting) for section, setting, _ in rows} == expected
    assert all(meaning for _, _, meaning in rows)


def test_the_page_on_the_layout_names_every_folder_and_files_that_are_there():
    text = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\| `([\w/]+?)/` \|", text, flags=re.MULTILINE))
    tops = {"filters", "association", "smoothers", "eval", "configs", "sehn", "benchmarks"}
    folders = [p.parent for p in (ROOT / "jeat_graph").glob("*/__init__.py")]
    parts = {f"jeat_graph/{folder.name}" for folder in folders if not folder.is_symlink()}
    assert named == tops | parts
    places = re.findall(r"^\| [^|]+ \| `([\w/]+\.[ch]?pp|[\w/]+\.py)` \|", text, flags=re.MULTILINE)
    assert len(places) >= 8
    assert [place for place in places if not (ROOT / place).is_file()] == []
