"""A film is whole or not there, the same each time, and played by browsers."""

from __future__ import annotations

import http.server
import shutil
import subprocess
import sys
import threading
from functools import partial
from urllib.parse import unquote

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.drawing.movie.film import CODECS, MovieWriter
from jeat_graph.io.media.video import count_frames
from jeat_graph.io.tables.trajectories_io import write_trajectories

from .conftest import HEIGHT, WIDTH, read_movie, vehicle

BROWSER = next((n for n in ("chromium", "chromium-browser", "google-chrome") if shutil.which(n)), None)
PAGE = """<script>(async () => { const said = [];
for (const name of %s) { const film = document.createElement("video"); film.muted = true; film.src = name;
  said.push(await new Promise(done => {
    film.onerror = () => done(name + " " + film.error.message);
    film.oncanplay = () => film.play().then(() => setTimeout(() => done(name + " plays " +
      film.videoWidth + "x" + film.videoHeight + " " + (film.currentTime > 0)), 300)); })); }
new Image().src = "/said?" + encodeURIComponent(said.join("|")); })()</script>"""
FULL = """
import resource, sys
import numpy as np
from jeat_graph.data.errors import DataError
from jeat_graph.drawing.movie.film import MovieWriter
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))  # no file may grow larger: as a full disk does
rng = np.random.default_rng(1)
for name in sys.argv[1:]:
    try:
        with MovieWriter(name, (160, 96), 20.0) as film:
            for _ in range(30):
                film.append(rng.integers(0, 255, (96, 160, 3), dtype=np.uint8))
    except DataError as error:
        print(error)
"""


def frames(count: int) -> list[np.ndarray]:
    return [np.full((HEIGHT, WIDTH, 3), 20 + 8 * k, dtype=np.uint8) for k in range(count)]


def write(path, pictures) -> bytes:
    with MovieWriter(path, (WIDTH, HEIGHT), 20.0) as film:
        for picture in pictures:
            film.append(picture)
    return path.read_bytes()


@pytest.mark.parametrize("suffix", CODECS)
def test_every_picture_is_in_the_film_and_twice_gives_the_same_bytes(tmp_path, suffix):
    first = write(tmp_path / f"a{suffix}", frames(12))
    assert first == write(tmp_path / f"b{suffix}", frames(12))
    pictures, rate = read_movie(tmp_path / f"a{suffix}")
    assert rate == pytest.approx(20.0)
    assert [float(p.mean()) for p in pictures] == pytest.approx([20 + 8 * k for k in range(12)], abs=3.9)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on PATH")
def test_a_browser_plays_it(tmp_path):
    names = [f"film{suffix}" for suffix in CODECS]
    for name in names:
        write(tmp_path / name, frames(20))
    (tmp_path / "page.html").write_text(PAGE % names)
    said: list[str] = []
    told = threading.Event()

    class Handler(http.server.SimpleHTTPRequestHandler):
        def do_GET(self):
            if self.path.startswith("/said?"):
                said.append(unquote(self.path[6:]))
                told.set()
                self.send_error(404)
            else:
                super().do_GET()

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=tmp_path)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = f"http://127.0.0.1:{server.server_port}/page.html"
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"]
        command = [BROWSER, *flags, f"--user-data-dir={tmp_path / 'profile'}", page]
        browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            assert told.wait(60)
        finally:
            browser.terminate()
            browser.wait()
            server.shutdown()
    assert said[0].split("|") == [f"{name} plays {WIDTH}x{HEIGHT} true" for name in names]


def test_a_full_disk_is_said_and_what_was_there_stays(tmp_path):
    films = [tmp_path / f"film{suffix}" for suffix in CODECS]
    for film in films:
        film.write_bytes(b"earlier")
    done = subprocess.run([sys.executable, "-c", FULL, *films], capture_output=True, text=True, check=False)
    for film, line in zip(films, done.stdout.splitlines(), strict=True):
        assert film.name in line
        assert "is the disk full?" in line
        assert film.read_bytes() == b"earlier"
    assert sorted(tmp_path.iterdir()) == sorted(films)


def test_a_damaged_video_is_noticed(run, tmp_path, capsys):
    film = tmp_path / "in.mp4"
    rng = np.random.default_rng(2)
    data = write(film, list(rng.integers(0, 255, (20, HEIGHT, WIDTH, 3), dtype=np.uint8)))
    film.write_bytes(data[: len(data) // 3] + bytes(len(data) // 3) + data[2 * (len(data) // 3) :])
    assert 0 < count_frames(film) < 20
    command = ["render", str(run), "--frames", str(film), "--out", str(tmp_path / "out.webm")]
    assert main(command) == 0
    assert "damaged or cut off" in capsys.readouterr().err


def test_times_of_two_clocks_are_refused_rather_than_an_empty_film(segment, tmp_path, capsys):
    late = tmp_path / "late"
    late.mkdir()
    table = vehicle(np.arange(21) * 0.05 + 1.7e9)
    write_trajectories(table, late / "causal.csv")
    command = ["render", str(late), "--frames", str(segment), "--out", str(tmp_path / "x.mp4")]
    assert main(command) == 2
    assert "are both times of one clock?" in capsys.readouterr().err
    assert not (tmp_path / "x.mp4").exists()


def test_a_film_that_cannot_be_begun_leaves_nothing(tmp_path):
    with pytest.raises(DataError, match="cannot be written"), MovieWriter(tmp_path / "x.mp4", (0, 0), 20.0):
        pass
    assert list(tmp_path.iterdir()) == []
