"""The page in a real browser, clicked as a user does: what the mouse draws is what the files hold."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import threading
import time
import urllib.request

import numpy as np
import pytest

from jeat_graph.drawing.draw.server import DrawServer
from jeat_graph.io.tables.marks import read_marks_file
from jeat_graph.road.inputs import read_lengths

DRIVER = shutil.which("chromedriver")
BROWSER = next((one for one in ("chromium", "chromium-browser", "google-chrome") if shutil.which(one)), None)
pytestmark = pytest.mark.skipif(
    DRIVER is None or BROWSER is None, reason="no Chromium with its chromedriver on PATH"
)
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1300,900"]
PATIENCE_S = 20.0


class Browser:
    """A few words of the WebDriver protocol."""

    def __init__(self, port, profile):
        self._base = f"http://127.0.0.1:{port}"
        options = {"args": [*FLAGS, f"--user-data-dir={profile}"], "binary": shutil.which(BROWSER)}
        wanted = {"alwaysMatch": {"browserName": "chrome", "goog:chromeOptions": options}}
        self._base += f"/session/{self.ask('POST', '/session', {'capabilities': wanted})['sessionId']}"

    def ask(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{self._base}{path}", data, method=method)
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.loads(answer.read())["value"]

    def script(self, text):
        return self.ask("POST", "/execute/sync", {"script": text, "args": []})

    def until(self, text):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            if found := self.script(text):
                return found
            time.sleep(0.05)
        raise AssertionError(f"never true: {text}")

    def mouse(self, *steps):
        """Move to places of the window and press or let go there."""
        actions = []
        for name, x, y in steps:
            actions.append(
                {"type": "pointerMove", "duration": 0, "x": round(x), "y": round(y), "origin": "viewport"}
            )
            kinds = {"click": ("pointerDown", "pointerUp"), "down": ("pointerDown",), "up": ("pointerUp",)}
            actions += [{"type": kind, "button": 0} for kind in kinds[name]]
        pointer = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}}
        self.ask("POST", "/actions", {"actions": [pointer | {"actions": actions}]})

    def key(self, text):
        keys = [{"type": "keyDown", "value": text}, {"type": "keyUp", "value": text}]
        self.ask("POST", "/actions", {"actions": [{"type": "key", "id": "keys", "actions": keys}]})

    def click(self, name):
        x, y, width, height = self.script(
            f"const b = document.getElementById('{name}').getBoundingClientRect();"
            "return [b.left, b.top, b.width, b.height]"
        )
        self.mouse(("click", x + width / 2, y + height / 2))


@pytest.fixture
def browser(tmp_path):
    process = subprocess.Popen([DRIVER, "--port=0"], stdout=subprocess.PIPE, text=True)
    port = None
    for line in process.stdout:
        if found := re.search(r"started successfully on port (\d+)", line):
            port = int(found[1])
            break
    opened = Browser(port, tmp_path / "profile")
    yield opened
    opened.ask("DELETE", "")
    process.terminate()
    process.wait(10)
    process.stdout.close()


@pytest.fixture
def server(tmp_path):
    picture = np.full((480, 640, 3), 80, dtype=np.uint8)
    with DrawServer(picture, "street", tmp_path / "marks.yaml", tmp_path / "lengths.csv") as server:
        thread = threading.Thread(target=server.run, daemon=True)
        thread.start()
        yield server
        server.done = True
        thread.join(5)


def choose(browser, kind):
    browser.script(
        f"const s = document.getElementById('kind'); s.value = '{kind}'; s.dispatchEvent(new Event('change'))"
    )


def test_lines_zones_masks_and_lengths_are_drawn_with_the_mouse(browser, server, tmp_path):
    browser.ask("POST", "/url", {"url": server.address})
    browser.until("return document.body.dataset.ready === 'yes'")
    left, top, width = browser.script(
        "const b = document.getElementById('canvas').getBoundingClientRect(); return [b.left, b.top, b.width]"
    )
    assert width == 640

    def at(name, *places):
        browser.mouse(*((name, left + x, top + y) for x, y in places))

    at("click", (100, 100))
    at("click", (300, 120))  # a line ends with its second point
    choose(browser, "zones")
    for place in ((50, 200), (250, 200), (250, 300), (60, 320)):
        at("click", place)
    browser.key("\ue007")  # Enter
    choose(browser, "masks")
    for place in ((400, 10), (600, 10), (600, 60)):
        at("click", place)
    browser.click("finish")
    choose(browser, "lengths")
    at("click", (320, 400))
    at("click", (330, 300))
    browser.click("save")
    assert "each length needs its metres" in browser.until(
        "return document.getElementById('status').textContent"
    )
    assert not (tmp_path / "marks.yaml").exists()
    browser.script(
        "const i = document.querySelector('input.metres'); i.value = '12.5';"
        "i.dispatchEvent(new Event('input'))"
    )
    # A corner is dragged: the line's second point.
    browser.mouse(("down", left + 300, top + 120), ("up", left + 310, top + 140))
    browser.click("done")
    browser.until("return document.getElementById('status').textContent.startsWith('Saved')")
    marks = read_marks_file(tmp_path / "marks.yaml", ("lines",))
    assert list(marks.lines) == ["line-1"]
    np.testing.assert_allclose(marks.lines["line-1"], (100, 100, 310, 140), atol=1.5)
    np.testing.assert_allclose(
        marks.zones["zone-1"], ((50, 200), (250, 200), (250, 300), (60, 320)), atol=1.5
    )
    np.testing.assert_allclose(marks.masks["mask-1"], ((400, 10), (600, 10), (600, 60)), atol=1.5)
    lengths = read_lengths(tmp_path / "lengths.csv")
    assert lengths.metres.tolist() == [12.5]
    np.testing.assert_allclose(lengths.start, [[320, 400]], atol=1.5)
