"""Names from a file cannot put anything into the report's page."""

from __future__ import annotations

import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest

from jeat_graph.cli.main import main

BROWSER = next(
    (name for name in ("chromium", "chromium-browser", "google-chrome") if shutil.which(name)), None
)
FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--enable-logging=stderr", "--virtual-time-budget=2000", "--dump-dom"),
]
#: What a script of a name would leave behind for all to see.
PROOF = "document.documentElement.id='it-ran'"
NASTY = [
    "<script>boom()</script>",
    "</script><img src=x onerror=boom()>",
    "\"' onload=boom() x='",
    "]]>--><b>",
]


class Page(HTMLParser):
    """Collects the tags with their attributes, and what stands in scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.handlers: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.handlers += [name for name, value in attrs if name.startswith("on") or "boom" in name]


def page_of(folder, name: str) -> Page:
    """The report's page of a table whose classes, sensors and own name are `name`."""
    folder.mkdir()
    t = np.arange(20) * 0.05
    quoted = '"' + name.replace('"', '""') + '"'
    header = "t,track_id,left,top,width,height,existence,x,y,vx,vy,ax,ay,"
    header += "var_x,var_y,var_vx,var_vy,var_ax,var_ay,sensors,class"
    rows = [f"{k:.2f},1,{k},2,30,20,0.9,{k + 15},12,1,0,0,0,1,1,1,1,1,1,{quoted},{quoted}" for k in t]
    (folder / "causal.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    assert main(["report", str(folder), "--out", str(folder / "page.html"), "--no-compare"]) == 0
    page = Page()
    page.feed((folder / "page.html").read_text(encoding="utf-8"))
    return page


def test_a_page_has_the_same_tags_whatever_the_names_are(tmp_path):
    plain = page_of(tmp_path / "plain", "car")
    for k, name in enumerate(NASTY):
        page = page_of(tmp_path / f"{k} {name.replace('/', '')}", name)
        assert page.tags == plain.tags
        assert page.handlers == plain.handlers


def opened(page, profile) -> str:
    """The page's elements after its scripts have run in a real browser."""
    command = [BROWSER, *FLAGS, f"--user-data-dir={profile}", page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False).stdout


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on PATH")
def test_no_script_in_a_name_runs_in_a_real_browser(tmp_path):
    """All names in one page; and one that does run, to show that it would be seen."""
    (tmp_path / "bad.html").write_text(f"<html><script>{PROOF}</script></html>", encoding="utf-8")
    assert 'id="it-ran"' in opened(tmp_path / "bad.html", tmp_path / "first")
    name = " ".join(text.replace("boom()", PROOF) for text in NASTY)
    page_of(tmp_path / "all", name)
    assert "it-ran" in (tmp_path / "all" / "page.html").read_text(encoding="utf-8")  # as text
    seen = opened(tmp_path / "all" / "page.html", tmp_path / "second")
    assert "<svg" in seen
    assert 'id="it-ran"' not in seen
