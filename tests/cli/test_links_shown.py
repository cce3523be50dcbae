"""Decided identities in `explain`, `report`, `render` and `compare`: who was joined to whom, how probably."""

from __future__ import annotations

import csv
import re

import cv2
import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.tables.links_io import LINK_COLUMNS, read_links

HIDDEN_S = (2.0, 4.6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A car that is hidden for longer than a causal track lives, and one that is seen all the time."""
    path = tmp_path_factory.mktemp("links")
    rng = np.random.default_rng(2)
    rows = ["t,sensor,left,top,width,height,score"]
    for k in range(160):
        t = k / 20
        x, y = np.array([40.0 + 60.0 * t, 200.0]) + rng.normal(scale=0.5, size=2)
        if not HIDDEN_S[0] < t < HIDDEN_S[1]:
            rows.append(f"{t},cam,{x:.3f},{y:.3f},30,40,0.9")
        rows.append(f"{t},cam,{300 + 20 * t:.3f},{50 + rng.normal(scale=0.5):.3f},30,40,0.9")
    (path / "d.csv").write_text("\n".join(rows) + "\n")
    command = ["track", str(path / "d.csv"), "--image", "3840x2160"]
    for way in ("whole", "causal"):
        assert main([*command, "--set", f"smoother.identities={way}", "--out", str(path / way)]) == 0
    return path


def said(capsys, *arguments: str) -> str:
    capsys.readouterr()
    assert main([*arguments]) == 0
    return capsys.readouterr().out


def joined(folder) -> dict[str, str]:
    with (folder / "whole" / "links.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == LINK_COLUMNS
    return next(row for row in rows if row["from"] != row["to"])


def test_the_terms_of_a_link_make_up_its_log_ratio(folder):
    links = read_links(folder / "whole" / "links.csv")
    assert links.terms.sum(axis=1) == pytest.approx(links.log_ratio, abs=1e-5)
    # No pass has seen anything over so long a gap.
    assert (links.terms != 0.0).any(axis=0).tolist() == [True, False, True, True, True, False]


def test_explain_tells_a_link_in_words_by_either_identity(folder, capsys):
    link = joined(folder)
    text = said(capsys, "explain", str(folder / "whole"), "--track", link["from"])
    told = next(line for line in text.splitlines() if line.startswith("a link joins"))
    assert told.startswith(f"a link joins {link['from']} to {link['to']} over {float(link['gap']):.3f} s")
    assert f"probability {float(link['probability']):.2f}" in told
    terms = [float(value) for value in re.findall(r"[a-z] ([+-]\d+\.\d)", told.split("log ratio", 1)[1])]
    assert sum(terms) == pytest.approx(float(link["log_ratio"]), abs=0.3)
    assert f"causal track {link['to']}" in text
    text = said(capsys, "explain", str(folder / "whole"), "--track", link["to"])
    assert f"causal track {link['to']} of causal.csv went to identity {link['from']}" in text
    assert f"\ntrack {link['to']}: from " in text


def test_explain_says_nothing_of_identities_that_nobody_decided(folder, capsys):
    text = said(capsys, "explain", str(folder / "causal"), "--track", "1")
    assert text.startswith("track 1: from ")


def test_the_page_lists_links_with_their_probabilities(folder, capsys, tmp_path):
    link = joined(folder)
    for way in ("whole", "causal"):
        said(capsys, "report", str(folder / way), "--no-compare", "--out", str(tmp_path / f"{way}.html"))
    page = (tmp_path / "whole.html").read_text()
    table = page.split("<caption>Causal tracks that were joined</caption>", 1)[1].split("</table>", 1)[0]
    row = re.findall(r"<td[^>]*>([^<]*)</td>", table)
    assert row[:3] == [link["track_id"], link["from"], link["to"]]
    assert float(row[6]) == pytest.approx(float(link["probability"]), abs=0.0051)
    assert "Causal tracks that were joined" not in (tmp_path / "causal.html").read_text()


def test_a_film_draws_a_link_over_its_gap(folder, capsys, tmp_path):
    """On a dark ground nothing but the link lies between the ends of the gap where the car is hidden."""
    link = joined(folder)
    middle = (float(link["t_from"]) + float(link["t_to"])) / 2.0

    def drawn(way: str, t: float):
        out = tmp_path / "moment.png"
        command = ["render", str(folder / way), "--at", str(t), "--size", "1920x1080", "--only", "smoothed"]
        said(capsys, *command, "--out", str(out))
        return cv2.imread(str(out)).astype(int)

    for t, differs in ((middle, True), (1.0, False)):
        one, other = (drawn(way, t) for way in ("whole", "causal"))
        lane = np.abs(one - other)[104:116, 90:145].max(axis=(0, 2))
        assert ((lane > 40).mean() > 0.4) == differs, t


def test_compare_says_by_which_identities_it_goes(folder, capsys, tmp_path):
    capsys.readouterr()
    for way in ("whole", "causal"):
        assert main(["compare", str(folder / way), "--no-plots", "--out", str(tmp_path / way)]) == 0
        assert ("causal.csv" in capsys.readouterr().err) == (way == "whole")
