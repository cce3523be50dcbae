"""Names from a file cannot put anything into the report's page."""

from __future__ import annotations

from html.parser import HTMLParser

import numpy as np

from jeat_graph.cli.main import main

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
    rows = [f"{k:.2f},1,{k},2,30,20,0.9,{k + 15},12,1,0,0,0,1,1,1,1,1,1,rgb,{quoted}" for k in t]
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
