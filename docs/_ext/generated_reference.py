"""Pages of the reference made from the code: commands, settings, and what records register.

The build of the documentation writes them, and so does `python docs/_ext/generated_reference.py`. Those of
the settings and of the records are kept in the repository, for those who read the pages there.
"""

from __future__ import annotations

import argparse
import dataclasses
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_WIDTH = 96
#: Columns of the page of settings.
_PRESETS = ("default", "paper")
#: The sensor whose values stand for all; one that no preset declares has the defaults.
_SENSOR = "rgb"
#: Bounds above that keep numbers finite and mean nothing else.
_NO_BOUND = 1e9
_ABOUT_SETTINGS = """# Configuration

Every setting, made from the schema in `jeat_graph/config`, with its value in the two presets. A command
takes the preset `default` unless `--config` names another one. Write a setting as `section.name=value` with
`--set`, or as a tree in a YAML file for `--config`; `base: NAME` in that file takes all other settings from
a preset.

`default` declares no sensors: any name works, and the tracker learns what it needs about a sensor while it
runs. The constants of its model are not settings; they stand in `filters/model_constants.py`, each with its
unit. `paper` is the published method; its file marks which values the paper leaves open. The
[method](../method.md) has the equations.
"""


def commands_page() -> str:
    """Write the help of every command as Markdown, in the order of `jeat-graph --help`."""
    from jeat_graph.cli.main import COMMANDS, build_parser

    out = ["# Commands\n\nMade from the parsers; `jeat-graph COMMAND --help` prints the same.\n"]
    for name in COMMANDS:
        parser = _subparser(build_parser(name), name)
        out.append(
            f"## jeat-graph {name}\n\n{_sentence(parser.description)}\n\n```text\n{_help(parser)}```\n"
        )
        for nested, sub in _nested(parser):
            out.append(f"### jeat-graph {name} {nested}\n\n```text\n{_help(sub)}```\n")
    return "\n".join(out)


def _sentence(text: str | None) -> str:
    line = (text or "").strip()
    return line[:1].upper() + line[1:] + ("" if line.endswith((".", ":")) else ".") if line else ""


def _subparser(parser: argparse.ArgumentParser, name: str) -> argparse.ArgumentParser:
    return dict(_nested(parser))[name]


def _nested(parser: argparse.ArgumentParser) -> list[tuple[str, argparse.ArgumentParser]]:
    """Commands below a parser, with their parsers."""
    found = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return [(name, sub) for action in found for name, sub in action.choices.items()]


def _help(parser: argparse.ArgumentParser) -> str:
    """Help text at a fixed width, whatever the terminal."""
    parser.formatter_class = lambda prog: argparse.HelpFormatter(prog, width=_WIDTH)  # type: ignore[assignment]
    if hasattr(parser, "color"):
        parser.color = False
    text = io.StringIO()
    parser.print_help(text)
    return text.getvalue()


def configuration_page() -> str:
    """Write every setting with its meaning, values, unit and bounds as Markdown."""
    from jeat_graph.config.reading import load_config
    from jeat_graph.config.schema import Config

    out = [_ABOUT_SETTINGS]
    presets = [load_config(name) for name in _PRESETS]
    hints = get_type_hints(Config)
    for f in dataclasses.fields(Config):
        kind = hints[f.name]
        section = kind if dataclasses.is_dataclass(kind) else _section_within(kind)
        if section is None:
            continue
        values = [getattr(preset, f.name) for preset in presets]
        title, note = f.name, ""
        if section is not kind:
            title = f"{f.name}.NAME"
            note = f" Sensors that nobody declares have the values of `default`; `paper` has `{_SENSOR}`."
            values = [value.get(_SENSOR, section()) for value in values]
        about = _about(section)
        head = f"| setting | meaning | {' | '.join(f'`{name}`' for name in _PRESETS)} | unit | range |"
        out.append(f"## {title}\n\n{about}{note}\n\n{head}\n|---|---|{'---|' * len(_PRESETS)}---|---|")
        out += [_row(title, item, values) for item in dataclasses.fields(section)]
        out.append("")
        out += _inner_sections(title, section)
    return "\n".join(out)


_ABOUT_LAYOUTS = """# Layouts of networks' outputs

Made from the records in `jeat_graph/detection/models/layouts`, a file for each family. The metadata of the
network's file (`task`, `names`, `imgsz`, `end2end`, `nms` of `args`) decides first which layout it has, the
shapes of its outputs second, and their names last. A file that leaves shapes open is run once to see them. A
layout that contradicts metadata or shapes is refused, also where `layout` asks for it.

`C` is the number of classes, `N` of cells or three times as many, `K` of detections, `R` of bins. Boxes below
the least score are left out, as the networks' own tools do; a box of the even score is as likely real as not.
"""


def layouts_page() -> str:
    """Write every layout of networks' outputs, from its record, as Markdown."""
    from jeat_graph.detection.models.layouts.registry import all_layouts

    head = "| layout | detectors | outputs | fed with | least score | even score |\n|---|---|---|---|--:|--:|"
    rows = [
        f"| `{one.name}` | {one.detectors} | {one.outputs} | {one.feed.words} | {one.least_score:g} | "
        f"{one.even_score:g} |"
        for one in all_layouts().values()
    ]
    return "\n".join([_ABOUT_LAYOUTS, head, *rows, ""])


def _inner_sections(title: str, section: Any) -> list[str]:
    """Write the sections that stand in fields of a section and that no preset has, with their defaults."""
    out = []
    for name, hint in get_type_hints(section).items():
        inner = _section_within(hint)
        if inner is None:
            continue
        head = "| setting | meaning | default | unit | range |\n|---|---|---|---|---|"
        out.append(f"## {title}.{name}\n\n{_about(inner)}\n\n{head}")
        out += [_row(f"{title}.{name}", item, [inner()]) for item in dataclasses.fields(inner)]
        out.append("")
    return out


def _about(section: Any) -> str:
    """The first paragraph of a section's docstring."""
    return (section.__doc__ or "").strip().split("\n\n")[0]


def _section_within(kind: Any) -> Any:
    """The section type of a mapping from names to sections, or of a section that may be missing; or None."""
    candidates = [a for a in getattr(kind, "__args__", ()) if dataclasses.is_dataclass(a)]
    return candidates[0] if candidates else None


def _row(section: str, item: dataclasses.Field[Any], sections: list[Any]) -> str:
    """A row of a setting; `sections` are that part of the presets."""
    meta = item.metadata
    values = [getattr(one, item.name) for one in sections]
    if "options" in meta:
        span = ", ".join(f"`{option}`" for option in meta["options"])
    elif "low" in meta:
        span = _span(meta["low"], meta["high"], bool(meta.get("open_low")))
    else:
        span = "true, false" if isinstance(values[0], bool) else ""
    unit = "" if meta.get("unit") == "1" else meta.get("unit", "")
    cells = [f"`{section}.{item.name}`", meta.get("doc", ""), *map(_shown, values), unit, span]
    return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"


def _span(low: float, high: float, above: bool) -> str:
    """Bounds in words: an upper one that nothing reaches is none."""
    if high >= _NO_BOUND and low <= -_NO_BOUND:
        return "any number"
    if high >= _NO_BOUND:
        return f"{'>' if above else '≥'} {low:g}"
    return f"{f'above {low:g}' if above else f'{low:g}'} to {high:g}"


def _shown(value: Any) -> str:
    if value is None or value == ():
        return "none"
    if isinstance(value, float) and value >= _NO_BOUND:
        return "no bound"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:.15g}`" if isinstance(value, float) else f"`{value}`"


_ABOUT_RECORDS = """# Formats, exports, brokers, event cameras, scores and protocols

Made from the records in the code, one in a file of its own; `CONTRIBUTING.md` says how to add one.
"""


def records_page() -> str:
    """Write what is found by a record as Markdown: formats of boxes, exports, brokers, scores, protocols."""
    from jeat_graph.eval.metrics import metrics
    from jeat_graph.eval.protocols.registry import protocols
    from jeat_graph.exporting.registry import exports
    from jeat_graph.io.event_cameras.registry import event_cameras
    from jeat_graph.io.formats.registry import formats
    from jeat_graph.live.transport.brokers.registry import brokers

    read = [(f"`{one.name}`", one.title, one.reads, one.suffix and f"`{one.suffix}`") for one in formats()]
    scores = [
        (f"`{name}`", unit, meaning)
        for one in metrics()
        for unit, named in (("%", one.shares), ("", one.numbers))
        for name, meaning in named.items()
    ]
    sent = [(f"`{one.name}`", one.program, one.writes) for one in exports()]
    rules = [(f"`{one.name}`", one.says) for one in protocols()]
    ends = [
        (one.title, f"`{one.scheme}://`, {one.port}", f"`{one.scheme}+tls://`, {one.secure_port}", *options)
        for one in brokers().values()
        for options in [
            [", ".join(f"`{k}`" for k in kind) for kind in (one.source_options, one.sink_options)]
        ]
    ]
    cameras = [(one.maker, ", ".join(f"`{k}`" for k in one.forms)) for one in event_cameras().values()]
    return "\n".join(
        [
            _ABOUT_RECORDS,
            "## Files of boxes\n",
            "Detections, ground truth and results. Without `--input-format` a format is known by its "
            "bytes, then by the\nend of the file's name, then by the form of its first line.\n",
            *_table(("format", "what", "what is read", "a run's tables"), read),
            "## Exports\n",
            "What `export --to` writes ([how](../guides/other-programs.md)).\n",
            *_table(("export", "for", "what is written"), sent),
            "## Brokers\n",
            "Where `stream` and `serve` take scans from and send tracks to ([how](../guides/live.md)).\n",
            *_table(("broker", "address, port", "encrypted", "options of a source", "of a sink"), ends),
            "## Event cameras\n",
            "What `--events` may name beside files ([how](../guides/live.md)).\n",
            *_table(("camera of", "address"), cameras),
            "## Scores\n",
            *_table(("score", "unit", "meaning"), scores),
            "## Protocols\n",
            "Rules of `eval --protocol`.\n",
            *_table(("protocol", "rules"), rules),
        ]
    )


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """Lines of a table of Markdown, with a blank one behind them."""
    lines = [head, tuple("---" for _ in head), *rows]
    return [*(f"| {' | '.join(line)} |" for line in lines), ""]


def write_pages(folder: Path) -> None:
    """Write the pages, where they have changed.

    Args:
        folder: that of the reference.
    """
    pages = {
        "commands.md": commands_page(),
        "configuration.md": configuration_page(),
        "registered.md": records_page(),
        "layouts.md": layouts_page(),
    }
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before Sphinx looks for its sources."""
    app.connect("builder-inited", lambda app: write_pages(Path(app.srcdir) / "reference"))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    write_pages(Path(__file__).parents[1] / "reference")
