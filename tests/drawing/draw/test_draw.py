"""What is drawn on the page comes back as the files that the commands read; nobody else reaches the page."""

from __future__ import annotations

import http.client
import json
import socket
import struct
import threading
import time
from contextlib import closing
from pathlib import Path
from urllib.parse import unquote, urlsplit

import cv2
import numpy as np
import pytest
import yaml

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.drawing.draw.drawn import as_page, save_page
from jeat_graph.drawing.draw.server import DrawServer
from jeat_graph.drawing.grid import grid_step, with_grid
from jeat_graph.io.tables.marks import read_marks_file
from jeat_graph.road.inputs import read_lengths

PAGE = {
    "lines": [{"name": "north", "points": [[10, 20], [100, 20.5]]}],
    "zones": [{"name": "yard", "points": [[0, 0], [50, 0], [50, 40]]}],
    "masks": [{"name": "sky", "points": [[0, 0], [99, 0], [99, 9], [0, 9]]}],
    "lengths": [
        {"name": "length-1", "points": [[1, 2], [3, 40]], "metres": "12,5", "direction": "along"},
    ],
}
NOTHING = {"lines": [], "zones": [], "masks": [], "lengths": []}
PICTURE = np.full((120, 160, 3), 90, dtype=np.uint8)


@pytest.fixture
def files(tmp_path):
    return tmp_path / "marks.yaml", tmp_path / "lengths.csv"


def test_what_was_drawn_comes_back_as_it_was(files):
    said = save_page(PAGE, *files)
    assert said == f"Saved {files[0]} and {files[1]}."
    known = read_marks_file(files[0], ("lines",))
    assert known.lines == {"north": (10.0, 20.0, 100.0, 20.5)}
    assert known.zones == {"yard": ((0.0, 0.0), (50.0, 0.0), (50.0, 40.0))}
    assert list(known.masks) == ["sky"]
    lengths = read_lengths(files[1])
    assert lengths.metres.tolist() == [12.5]
    back = as_page(*files)
    assert back["lines"] == PAGE["lines"]
    assert back["lengths"][0]["metres"] == "12.5"
    assert save_page(back, *files)
    assert as_page(*files) == back


def test_lanes_that_somebody_wrote_stay(files):
    files[0].write_text("lanes: {slow: [-1.8, 1.8]}\n")
    save_page({**NOTHING, "lines": PAGE["lines"]}, *files)
    assert yaml.safe_load(files[0].read_text())["lanes"] == {"slow": [-1.8, 1.8]}


def test_what_was_removed_on_the_page_is_gone(files):
    save_page(PAGE, *files)
    assert "Removed" in save_page(NOTHING, *files)
    assert not files[0].exists()
    assert save_page(NOTHING, *files) == "Nothing is drawn: nothing is saved."


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"lines": [{"name": "", "points": [[0, 0], [1, 1]]}]}, "lines: each needs a name"),
        ({"lines": [{"name": "a", "points": [[0, 0], [1, 1]]}] * 2}, "a is the name of two"),
        ({"lines": [{"name": "a", "points": [[1, 1], [1, 1]]}]}, "both ends are the same point"),
        ({"zones": [{"name": "a", "points": [[0, 0], [1, 1]]}]}, "must be 3 corners or more"),
        ({"zones": [{"name": "a", "points": [[0, 0], [1, 1], ["x", 2]]}]}, "must be 3 corners or more"),
        ({"lengths": [{"points": [[0, 0], [1, 1]], "metres": "", "direction": "along"}]}, "needs its metres"),
        ({"lengths": [{"points": [[0, 0], [1, 1]], "metres": "-2", "direction": "along"}]}, "above 0"),
        ({"lengths": [{"points": [[0, 0], [1, 1]], "metres": "2", "direction": "up"}]}, "along or across"),
        ({"lines": "x"}, "not what the page sends"),
        ({"lines": [{"name": "a", "points": 3}]}, "not what the page sends"),
        ({"more": []}, "not what the page sends"),
    ],
)
def test_what_cannot_be_saved_is_said_and_nothing_is_written(files, change, words):
    with pytest.raises(DataError, match=words):
        save_page({**NOTHING, **change}, *files)
    assert not files[0].exists()
    assert not files[1].exists()


@pytest.fixture
def server(files):
    with DrawServer(PICTURE, "<street>", *files) as server:
        thread = threading.Thread(target=server.run, daemon=True)
        thread.start()
        yield server
        server.done = True
        thread.join(5)


def soon(true):
    """Whether something becomes true before long."""
    end = time.monotonic() + 5.0
    while not true() and time.monotonic() < end:
        time.sleep(0.01)
    return true()


def ask(server, method, path, body=None, **headers):
    at = urlsplit(server.address)
    link = http.client.HTTPConnection(at.hostname, at.port, timeout=10)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    link.request(method, path, body, headers)
    answer = link.getresponse()
    content = answer.read()
    link.close()
    return answer.status, content


def test_the_page_saves_and_ends(server, files):
    status, page = ask(server, "GET", server.prefix)
    assert status == 200
    assert b"Draw on &lt;street&gt;" in page
    assert ask(server, "GET", f"{server.prefix}picture.png")[1].startswith(b"\x89PNG")
    assert json.loads(ask(server, "GET", f"{server.prefix}marks.json")[1]) == NOTHING
    sent = json.dumps(PAGE), {"Content_Type": "application/json"}
    status, said = ask(server, "POST", f"{server.prefix}save", sent[0], **sent[1])
    assert (status, said.startswith(b"Saved ")) == (200, True)
    assert json.loads(ask(server, "GET", f"{server.prefix}marks.json")[1]) == PAGE
    assert not server.done
    assert ask(server, "POST", f"{server.prefix}done", sent[0], **sent[1])[0] == 200
    assert soon(lambda: server.done)
    assert files[0].is_file()


def test_nobody_else_reaches_the_page(server, files):
    sent = {"Content_Type": "application/json"}
    assert ask(server, "GET", "/")[0] == 404
    assert ask(server, "GET", f"{server.prefix}../../etc/passwd")[0] == 404
    assert ask(server, "GET", server.prefix, Host="evil.example")[0] == 403
    assert (
        ask(server, "POST", f"{server.prefix}save", json.dumps(PAGE), Host="evil.example", **sent)[0] == 403
    )
    assert ask(server, "POST", "/save", json.dumps(PAGE), **sent)[0] == 404
    # A form of another page can send no JSON.
    assert ask(server, "POST", f"{server.prefix}save", json.dumps(PAGE), Content_Type="text/plain")[0] == 404
    assert not files[0].exists()


def test_the_browser_is_led_to_the_page_by_a_file_of_its_owner(server, files):
    """Command lines are seen by every user of a machine: the secret word stands on none."""
    with server.way_in() as address:
        path = Path(unquote(urlsplit(address).path))
        assert server.prefix not in address
        assert path.stat().st_mode & 0o077 == 0
        assert f"url={server.address}" in path.read_text()
    assert not path.exists()


def test_a_browser_that_goes_early_leaves_no_trace_and_still_ends_it(server, files, capfd):
    at = urlsplit(server.address)
    body = json.dumps(PAGE).encode()
    head = f"POST {server.prefix}done HTTP/1.1\r\nHost: {at.netloc}\r\nContent-Type: application/json\r\n"
    for path in ("picture.png", ""):
        with closing(socket.create_connection((at.hostname, at.port))) as link:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            link.sendall(f"GET {server.prefix}{path} HTTP/1.1\r\nHost: {at.netloc}\r\n\r\n".encode())
    with closing(socket.create_connection((at.hostname, at.port))) as link:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        link.sendall(f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body)
        assert soon(lambda: files[0].is_file())
    assert soon(lambda: server.done)
    assert capfd.readouterr().err == ""


def test_head_is_get_without_content(server):
    status, content = ask(server, "HEAD", f"{server.prefix}picture.png")
    assert (status, content) == (200, b"")


@pytest.mark.parametrize("body", ["", "nonsense", "[" * 100_000, '{"lines": 1}', "[]"])
def test_what_no_page_sends_is_refused(server, files, body):
    status, said = ask(server, "POST", f"{server.prefix}save", body, Content_Type="application/json")
    assert status == 400
    assert b"\n" not in said
    assert not files[0].exists()


def test_a_file_that_is_no_file_of_marks_is_not_drawn_over(files):
    files[0].write_text("sensors: {}\n")
    with pytest.raises(DataError, match=r"marks\.yaml: must hold"):
        DrawServer(PICTURE, "x", *files)


def test_a_port_that_is_taken_or_none_is_named(server, files):
    for port, words in ((server.server_port, "in use"), (70_000, "ports are 0 to 65535")):
        with pytest.raises(DataError, match=f"port {port} cannot be opened: .*{words}"):
            DrawServer(PICTURE, "x", *files, port)


def test_the_command_serves_a_video_until_the_page_is_done(tmp_path, capsys, monkeypatch):
    folder = tmp_path / "frames"
    folder.mkdir()
    cv2.imwrite(str(folder / "0.png"), PICTURE)
    monkeypatch.setattr(DrawServer, "run", lambda server: save_page(PAGE, *server.files))
    out = ["--out", str(tmp_path / "m.yaml"), "--lengths", str(tmp_path / "l.csv"), "--no-browser"]
    assert main(["draw", str(folder), "--rate", "10", *out]) == 0
    said = capsys.readouterr().out
    assert "draw at http://127.0.0.1:" in said
    assert f"wrote {tmp_path / 'm.yaml'}" in said


def test_the_tracks_of_a_run_are_shown(tmp_path, monkeypatch):
    from jeat_graph.io.tables.trajectories_io import write_trajectories

    from ..movie.conftest import vehicle

    write_trajectories(vehicle(np.arange(21) * 0.05), tmp_path / "causal.csv")
    seen = []
    monkeypatch.setattr(DrawServer, "run", lambda server: seen.append(server.answers))
    out = ["--out", str(tmp_path / "m.yaml"), "--lengths", str(tmp_path / "l.csv"), "--no-browser"]
    assert main(["draw", str(tmp_path / "causal.csv"), *out]) == 0
    (png,) = (content for kind, content in seen[0].values() if kind == "image/png")
    picture = cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert picture[45, 55].max() > 100  # half way
    assert picture[5, 5].max() < 40


@pytest.mark.parametrize(("size", "step"), [((800, 600), 50), ((1920, 1080), 100), ((346, 260), 20)])
def test_the_grid_suits_the_picture(size, step):
    assert grid_step(size) == step


def test_lines_of_the_grid_lie_at_their_pixels():
    drawn = with_grid(PICTURE, 50).astype(int)
    changed = (drawn != PICTURE).any(axis=2)
    assert changed[30:45, 50].all()
    assert changed[:, 100].all()
    assert not changed[30:45, 60:99].any()
    assert (PICTURE == 90).all()


def test_a_picture_is_written_with_its_grid(tmp_path, fails):
    (tmp_path / "frames").mkdir()
    for k in range(3):
        cv2.imwrite(str(tmp_path / "frames" / f"{k}.png"), PICTURE + k)
    out = tmp_path / "frame.png"
    words = ["frame", str(tmp_path / "frames"), "--rate", "10", "--out", str(out)]
    assert main([*words, "--at", "0.2"]) == 0
    assert (cv2.imread(str(out)) == 92).all()
    assert main([*words, "--grid"]) == 0
    assert cv2.imread(str(out)).max() > 100
    assert "there is no picture at 9 s" in fails(*words, "--at", "9")
    assert "--step says nothing without --grid" in fails(*words, "--step", "5")


@pytest.fixture
def fails(capsys):
    def run(*words):
        assert main([str(word) for word in words]) == 2
        return capsys.readouterr().err

    return run


def test_the_page_is_among_the_package_s_files():
    import jeat_graph.drawing.draw as package

    folder = Path(package.__file__).parent
    assert (folder / "page.html").is_file()
    assert (folder / "page.js").is_file()
