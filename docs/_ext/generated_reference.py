"""Pages of the reference made from the code: commands from their parsers, settings from the schema."""

from __future__ import annotations

import argparse
import dataclasses
import io
from pathlib import Path
from typing import Any, get_type_hints

from sphinx.application import Sphinx

_WIDTH = 96


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
    """Write every setting with its unit, default, bounds and meaning as Markdown."""
    from jeat_graph.config.schema import Config

    out = [
        "# Configuration\n\nEvery setting, made from the schema in `jeat_graph/config`. A setting is written"
        " `section.name=value` with `--set`, or as a tree in a YAML file; `base: NAME` takes the rest from a"
        " preset. Defaults are those of the schema; presets change some of them.\n"
    ]
    hints = get_type_hints(Config)
    for f in dataclasses.fields(Config):
        kind = hints[f.name]
        section = kind if dataclasses.is_dataclass(kind) else _value_of_mapping(kind)
        if section is None:
            continue
        title = f"{f.name}.NAME" if section is not kind else f.name
        about = (section.__doc__ or "").strip().split("\n\n")[0]
        out.append(
            f"## {title}\n\n{about}\n\n| setting | default | unit | range | meaning |\n|---|---|---|---|---|"
        )
        out += [_row(title, item) for item in dataclasses.fields(section)]
        out.append("")
    return "\n".join(out)


def _value_of_mapping(kind: Any) -> Any:
    """The section type of a mapping from names to sections, or None."""
    candidates = [a for a in getattr(kind, "__args__", ()) if dataclasses.is_dataclass(a)]
    return candidates[0] if candidates else None


def _row(section: str, item: dataclasses.Field[Any]) -> str:
    meta = item.metadata
    default = item.default if item.default is not dataclasses.MISSING else item.default_factory()  # type: ignore[misc]
    if "options" in meta:
        span = ", ".join(f"`{option}`" for option in meta["options"])
    elif "low" in meta:
        high = "∞" if meta["high"] == float("inf") else f"{meta['high']:g}"
        span = f"{'(' if meta.get('open_low') else '['}{meta['low']:g}, {high}{')' if high == '∞' else ']'}"
    else:
        span = "true, false" if isinstance(default, bool) else ""
    shown = f"`{str(default).lower() if isinstance(default, bool) else default}`"
    cells = [f"`{section}.{item.name}`", shown, meta.get("unit", ""), span, meta.get("doc", "")]
    return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"


def _write(app: Sphinx) -> None:
    folder = Path(app.srcdir) / "reference"
    for name, text in (("commands.md", commands_page()), ("configuration.md", configuration_page())):
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before Sphinx looks for its sources."""
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
