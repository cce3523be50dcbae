"""The beginning of every HTML page: title, style, and a policy by which it asks nothing of any network."""

from __future__ import annotations

from html import escape
from importlib.resources import files

# The browser itself refuses whatever a page might ask of a network.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
_SCRIPTS = "; script-src 'unsafe-inline'"


def beside(package: str, name: str) -> str:
    """Read a file that stands beside the modules of a package."""
    return files(package).joinpath(name).read_text(encoding="utf-8")


def page_head(title: str, more_style: str = "", *, scripts: bool = False) -> str:
    """Return what stands before the content of a page's body.

    Args:
        title: of the page.
        more_style: CSS that follows the style of all pages.
        scripts: whether scripts within the page may run.
    """
    style = beside("jeat_graph.drawing.page", "page.css") + more_style
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}{_SCRIPTS if scripts else ""}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>",
        f"<style>\n{style}</style></head><body>",
    ]
    return "\n".join(parts)
