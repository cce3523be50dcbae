"""Known networks: fetched once from a server that stands for the internet, checked, and used without it."""

from __future__ import annotations

import hashlib
import http.server
import re
import tempfile
import threading
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.notes import listening
from jeat_graph.detection import network_cache
from jeat_graph.detection.known_networks import KNOWN
from jeat_graph.detection.named import network_file
from jeat_graph.detection.network_cache import cached, fetched

pytest.importorskip("onnx", reason="pip install onnx")

from .models.tiny import constant_net

#: A network whose file nobody has pinned.
TINY = KNOWN["yolox-tiny"]._replace(sha256=())
#: One with an address and a pin.
PINNED = KNOWN["yolox-tiny"]


def _network() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return constant_net(
            Path(folder) / "n.onnx", {"output": np.ones((1, 252, 85))}, (128, 96)
        ).read_bytes()


CONTENT = _network()


class _Server(http.server.BaseHTTPRequestHandler):
    content, cut, asked = CONTENT, 0, 0

    def do_GET(self):
        type(self).asked += 1
        if not self.path.endswith("/nets/yolox_tiny.onnx"):
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(self.content) + self.cut))
        self.end_headers()
        self.wfile.write(self.content)

    def log_message(self, *_):
        pass


@pytest.fixture
def internet(tmp_path, monkeypatch):
    """A server, and a cache of one's own; the smallest YOLOX has no pin here."""
    monkeypatch.setitem(KNOWN, TINY.name, TINY)
    handler = type("Handler", (_Server,), {})
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    folder = tmp_path / "networks"
    monkeypatch.setenv(network_cache.FOLDER, str(folder))
    monkeypatch.setattr(network_cache, "is_private", lambda _: True)
    monkeypatch.setenv(network_cache.MIRROR, f"http://user:canary@127.0.0.1:{server.server_port}/nets/")
    yield handler, folder, server
    server.shutdown()
    server.server_close()


@pytest.fixture
def without_login(internet, monkeypatch):
    """The same where the address has no user."""
    handler, folder, server = internet
    monkeypatch.setenv(network_cache.MIRROR, f"http://127.0.0.1:{server.server_port}/nets")
    return handler, folder, server


def test_a_network_is_fetched_once_and_used_without_a_network_afterwards(without_login):
    handler, folder, server = without_login
    said: list[str] = []
    with listening(said.append):
        assert network_file("yolox-tiny", "frames").read_bytes() == CONTENT
    assert handler.asked == 1
    assert "fetched once from http://127.0.0.1" in said[0]
    assert "Apache-2.0, https://github.com/Megvii-BaseDetection/YOLOX" in said[0]
    assert hashlib.sha256(CONTENT).hexdigest() in said[1]
    server.shutdown()
    server.server_close()
    assert network_file("yolox-tiny", "frames") == folder / "yolox_tiny.onnx"
    assert sorted(path.name for path in folder.iterdir()) == ["yolox_tiny.onnx", "yolox_tiny.onnx.sha256"]


def test_a_file_that_has_changed_since_is_not_taken(without_login):
    _, folder, _ = without_login
    fetched(TINY)
    (folder / TINY.file).write_bytes(CONTENT + b"x")
    with pytest.raises(DataError, match=r"yolox_tiny\.onnx is not yolox-tiny: its SHA-256 is .*, not "):
        fetched(TINY)


def test_a_file_that_is_not_what_is_pinned_is_refused_and_not_kept(without_login):
    pinned = TINY._replace(sha256=(hashlib.sha256(b"the true one").hexdigest(),))
    with pytest.raises(DataError, match=r"what came from http.* is not yolox-tiny: its SHA-256 is"):
        fetched(pinned)
    assert cached(pinned) is None
    assert not without_login[1].exists()


def test_a_file_that_the_user_puts_there_is_taken_if_it_is_the_one(without_login):
    handler, folder, _ = without_login
    folder.mkdir()
    (folder / TINY.file).write_bytes(CONTENT)
    assert fetched(TINY._replace(sha256=("0" * 64, hashlib.sha256(CONTENT).hexdigest()))).is_file()
    assert handler.asked == 0


def test_what_is_cut_off_is_not_kept(without_login):
    handler, folder, _ = without_login
    handler.cut = 5
    with pytest.raises(DataError, match=rf"put yolox_tiny\.onnx into {re.escape(str(folder))}"):
        fetched(TINY)
    assert not folder.exists()


@pytest.mark.parametrize("mirror", ["http://127.0.0.1:9/nets", "http://127.0.0.1:{port}/else"])
def test_without_a_network_it_says_what_to_put_where(without_login, monkeypatch, mirror):
    _, folder, server = without_login
    monkeypatch.setenv(network_cache.MIRROR, mirror.format(port=server.server_port))
    with pytest.raises(DataError, match="cannot be fetched from") as error:
        fetched(TINY)
    assert f"put yolox_tiny.onnx into {folder}" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_network_without_an_address_says_how_it_is_had(without_login):
    with pytest.raises(DataError, match=r"export the checkpoint .* then put dfine_s_coco\.onnx into"):
        network_file("dfine-s", "frames")


def test_a_password_in_the_mirror_is_not_shown(internet):
    said: list[str] = []
    with listening(said.append), pytest.raises(DataError) as error:
        fetched(KNOWN["yolox-s"])
    assert "canary" not in " ".join([*said, str(error.value)])


def test_a_folder_that_others_can_write_gives_no_networks(without_login, monkeypatch):
    fetched(TINY)
    monkeypatch.setattr(network_cache, "is_private", lambda _: False)
    with pytest.raises(DataError, match="others can write this folder"):
        cached(TINY)


def test_only_one_of_two_fetches(without_login):
    handler, _, _ = without_login
    found = []
    errors = []

    def fetch():
        try:
            found.append(fetched(TINY))
        except DataError as error:
            errors.append(str(error))

    threads = [threading.Thread(target=fetch) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert handler.asked == 1
    assert len(found) + len(errors) == 2
    assert found
    assert all("another command is writing it" in line for line in errors)


def test_the_command_lists_what_there_is(without_login, capsys):
    assert main(["detectors", "--no-speed"]) == 0
    shown = capsys.readouterr().out
    for name in ("motion", "sehn", *KNOWN):
        assert f"\n{name} " in shown
    assert "40.5" in shown
    assert "to be fetched" in shown
    assert main(["detectors", "--fetch", "yolox-tiny"]) == 0
    assert capsys.readouterr().out.strip().endswith("yolox_tiny.onnx")
    assert main(["detectors", "--fetch", "yolo"]) == 2


def test_networks_that_are_here_are_timed(without_login, tmp_path, capsys):
    pytest.importorskip("onnx", reason="pip install onnx")
    from .models.tiny import constant_net

    without_login[1].mkdir()
    constant_net(without_login[1] / TINY.file, {"output": np.ones((1, 252, 85))}, (128, 96))
    assert main(["detectors"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("yolox-tiny"))
    assert " here " in row


def test_a_page_that_asks_to_log_in_is_no_network(without_login):
    handler, folder, _ = without_login
    for content in (b"<html>log in</html>", b"", CONTENT[:2000]):
        handler.content = content
        with pytest.raises(DataError, match=r"what came from http.*ONNX.*: it is not yolox-tiny"):
            fetched(TINY)
    assert not folder.exists() or not list(folder.iterdir())


def test_a_network_that_nobody_pinned_comes_by_https_only(internet, monkeypatch):
    monkeypatch.setenv(network_cache.MIRROR, "http://192.0.2.1/nets")
    with pytest.raises(DataError, match="no SHA-256 of it is known, so it is fetched by https only"):
        fetched(TINY)


def test_a_redirect_from_https_to_http_is_not_followed():
    asked = urllib.request.Request("https://example.com/a.onnx")
    redirects = network_cache._Redirects()
    with pytest.raises(ValueError, match="redirected from https to another way"):
        redirects.redirect_request(asked, None, 302, "Found", {}, "http://example.com/a.onnx")
    onward = redirects.redirect_request(asked, None, 302, "Found", {}, "https://cdn.example.com/a.onnx")
    assert onward.full_url == "https://cdn.example.com/a.onnx"


def test_what_the_release_pages_give_is_pinned():
    assert all(network.sha256 for network in KNOWN.values() if network.address)
    assert PINNED.sha256
    assert KNOWN["nanodet-plus-m-416"].address


def test_every_known_network_has_a_licence_and_a_way_to_get_it():
    for network in KNOWN.values():
        assert network.licence == "Apache-2.0"
        assert bool(network.address) != bool(network.how)
        assert not network.address or network.address.startswith("https://")
        assert all(len(one) == 64 for one in network.sha256)


@pytest.mark.parametrize(
    "mirror",
    [
        "nonsense",
        "htp://host/x",
        "https://",
        "https://[bad",
        "https://host:port/x",
        "https://a b/c",
        "file:///etc",
    ],
)
def test_a_mirror_that_is_no_address_is_named_before_anything_is_fetched(internet, monkeypatch, mirror):
    handler, folder, _ = internet
    monkeypatch.setenv(network_cache.MIRROR, mirror)
    said = []
    with (
        listening(said.append),
        pytest.raises(DataError, match="JEAT_GRAPH_MIRROR must be the address of a f"),
    ):
        fetched(PINNED)
    assert (said, handler.asked, folder.exists() and any(folder.iterdir())) == ([], 0, False)
