"""The page in a real browser: no errors, and the script draws what was chosen."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

BROWSER = next(
    (name for name in ("chromium", "chromium-browser", "google-chrome") if shutil.which(name)), None
)
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium on PATH")
FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--enable-logging=stderr", "--virtual-time-budget=3000"),
]


def dump(page: str, profile, width: int = 1200) -> tuple[str, list[str]]:
    """Open a page and return its elements as the script left them, and what went to the console."""
    command = [
        BROWSER,
        *FLAGS,
        f"--user-data-dir={profile}",
        f"--window-size={width},1600",
        "--dump-dom",
        page,
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line.upper()]


def test_a_broken_script_would_be_noticed(tmp_path):
    page = tmp_path / "bad.html"
    page.write_text("<script>undefinedFunction()</script>")
    assert dump(page.as_uri(), tmp_path / "profile")[1]


def test_a_chosen_track_is_drawn_without_errors(full_run, tmp_path):
    chosen = full_run.html.data["tracks"][3]
    dom, console = dump(f"{full_run.page.as_uri()}#track={chosen['id']}", tmp_path / "profile")
    assert console == []
    assert f'aria-label="Curves of track {chosen["id"]} ' in dom
    assert re.findall(r'class="track on" data-id="(\d+)"', dom) == [str(chosen["id"])]
    assert "NaN" not in re.sub(r"<script.*?</script>", "", dom, flags=re.DOTALL)
    titles = re.findall(r'<text class="title"[^>]*>([^<]+)', dom)
    assert len(titles) == 8
    assert titles[0] == "Which sensor gave a detection"


def test_the_readout_says_what_the_data_say(full_run, tmp_path):
    data = full_run.html.data
    chosen = data["tracks"][3]
    dom, _ = dump(f"{full_run.page.as_uri()}#track={chosen['id']}", tmp_path / "profile")
    middle = (chosen["from"] + chosen["to"]) / 2
    said = re.search(r'id="read".*?</p>', dom, re.DOTALL).group(0)
    assert f"t = {(middle + data['start_ms']) / 1000:.2f} s" in said
    k = max(k for k, t in enumerate(chosen["existence"]["t"]) if t <= middle)
    assert f"existence {chosen['existence']['v'][k]:.2f}" in said


def test_without_a_choice_the_most_telling_track_is_drawn_and_none_is_dimmed(full_run, tmp_path):
    dom, console = dump(full_run.page.as_uri(), tmp_path / "profile", width=500)
    assert console == []
    assert f'aria-label="Curves of track {full_run.html.data["first"]} ' in dom
    assert '<svg id="map" class="map"' in dom


def acting(full_run, tmp_path, script: str) -> tuple[str, list[str]]:
    """The page after a script of ours has done what a user would do."""
    page = tmp_path / "acting.html"
    text = full_run.page.read_text(encoding="utf-8")
    page.write_text(text.replace("</body>", f"<script>{script}</script></body>"), encoding="utf-8")
    return dump(page.as_uri(), tmp_path / "profile")


def test_a_click_in_the_list_a_key_and_the_pointer_do_what_they_say(full_run, tmp_path):
    chosen = full_run.html.data["tracks"][5]
    script = f"""
      document.querySelector('tr[data-id="{chosen["id"]}"] button').click();
      const svg = document.querySelector('#chart svg');
      svg.dispatchEvent(new KeyboardEvent('keydown', {{key: 'End', bubbles: true}}));
    """
    dom, console = acting(full_run, tmp_path, script)
    assert console == []
    assert f'aria-label="Curves of track {chosen["id"]} ' in dom
    last = (chosen["to"] + full_run.html.data["start_ms"]) / 1000
    assert f"t = {last:.2f} s" in re.search(r'id="read".*?</p>', dom, re.DOTALL).group(0)


def test_next_goes_on_to_the_following_track_and_round(full_run, tmp_path):
    ids = [one["id"] for one in full_run.html.data["tracks"]]
    script = f"""
      const pick = document.getElementById('pick');
      pick.value = '{ids[-1]}';
      pick.dispatchEvent(new Event('change'));
      document.getElementById('after').click();
    """
    dom, console = acting(full_run, tmp_path, script)
    assert console == []
    assert f'aria-label="Curves of track {ids[0]} ' in dom
