"""Canaries in a broker's password and user: no output and no file of a stream has them."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import time
import zipfile
from pathlib import Path

import pytest
from live_tests import brokers

from jeat_graph.cli.main import main
from jeat_graph.live.transport.ends import open_sink, open_source

USER, PASSWORD = "canary-user", "canary-p@ssw/rd"
QUOTED = "canary-p%40ssw%2Frd"
#: How the password may appear if it does.
MARKS = (PASSWORD, QUOTED, "canary-p", "ssw/rd")
PATIENCE_S = 120.0


def secret_free(text: str) -> bool:
    return not any(mark in text for mark in MARKS)


def files_with(folder: Path, marks: tuple[str, ...]) -> list[str]:
    """The files in which one of the marks stands, packed ones unpacked, and the names that have one."""
    found = []
    for path in folder.rglob("*"):
        content = b"" if not path.is_file() else path.read_bytes()
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                content += b"".join(archive.read(name) for name in archive.namelist())
        if any(mark.encode() in content or mark in path.name for mark in marks):
            found.append(str(path))
    return found


def message(k: int, boxes: int = 1) -> bytes:
    rows = [[60 * (i % 30) + k, 60 * (i // 30), 40, 30] for i in range(boxes)]
    scan = {"t": round(0.05 * k, 6), "sensor": "rgb", "boxes": rows, "scores": [0.95] * boxes}
    return json.dumps({"v": 1, "source": "canary-source", "seq": k, "scans": [scan]}).encode()


@pytest.fixture(scope="module", params=["mqtt", "nats"])
def broker(request, tmp_path_factory):
    """(begin of an address without login, server) of a broker that wants the password."""
    folder = tmp_path_factory.mktemp("broker")
    if request.param == "mqtt":
        pytest.importorskip("paho.mqtt", reason="the client is not installed")
        hashing = brokers.program("mosquitto_passwd") or shutil.which("mosquitto_passwd")
        if hashing is None:
            pytest.skip("this machine has no mosquitto")
        (folder / "users").touch(0o600)
        subprocess.run(
            [hashing, "-b", folder / "users", USER, PASSWORD], check=True, stderr=subprocess.DEVNULL
        )
        settings = ["allow_anonymous false", f"password_file {folder}/users", "max_packet_size 20000"]
        server = brokers.mosquitto(folder, *settings)
    else:
        pytest.importorskip("nats", reason="the client is not installed")
        users = f'authorization {{ user: "{USER}", password: "{PASSWORD}" }}\nmax_payload: 20000\n'
        (folder / "nats.conf").write_text(users)
        server = brokers.nats_server(folder, "-c", str(folder / "nats.conf"))
        if server is None:
            pytest.skip("this machine has no nats-server")
    yield request.param, server
    server.stop()


def login(way: str, folder: Path) -> tuple[str, str]:
    """What stands before the host and behind the topic, for each way to give the password."""
    if way == "address":
        return f"{USER}:{QUOTED}@", ""
    if way == "environment":
        return "${CANARY_USER}:${CANARY_PASSWORD}@", ""
    (folder / "password").write_text(PASSWORD + "\n")
    return f"{USER}@", f"?password_file={folder}/password"


@pytest.mark.parametrize("way", ["address", "environment", "file"])
def test_a_stream_with_every_warning_shows_no_password(way, broker, tmp_path, start):
    """Late, unreadable, repeated and too large: then the end by a signal."""
    scheme, server = broker
    secret = tmp_path / "secret"
    secret.mkdir()
    before, behind = login(way, secret)
    begin = f"{scheme}://{before}127.0.0.1:{server.port}/canary{way}"
    given = f"{scheme}://{USER}:{QUOTED}@127.0.0.1:{server.port}/canary{way}"
    scans, answers = open_sink(f"{given}in"), open_source(f"{given}out")
    work = tmp_path / "canary-folder"
    work.mkdir()
    options = ["--checkpoint", work / "state.npz", "--every", "0.5", "--smoothed", work / "smoothed.csv"]
    options += ["--record", work / "record.json", "--on-error", "skip", "--image", "1920x1080"]
    env = {"CANARY_USER": USER, "CANARY_PASSWORD": PASSWORD}
    process = start(
        "stream", "--source", f"{begin}in{behind}", "--sink", f"{begin}out{behind}", *options, env=env
    )
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end and answers.receive(0.5) is None:
        scans.send(message(0))
    for k in range(1, 60):
        scans.send(message(k, 250 if 10 <= k < 40 else 1))
    for wrong in (
        b"{",
        b"\xff",
        b'{"canary-key": 1}',
        message(3),
        message(5).replace(b'"seq": 5', b'"seq": 60'),
    ):
        scans.send(wrong)
    scans.send(message(61))
    last = None
    while time.monotonic() < end and b'"of":61' not in (last or b""):
        last = answers.receive(0.5)
        answers.commit()
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE_S) == 128 + signal.SIGTERM
    said = process.stderr.read().decode() + process.stdout.read().decode()
    for text in ("is not JSON", "larger than the broker takes", "interrupted"):
        assert text in said
    assert f"{scheme}://127.0.0.1:{server.port}/canary{way}in:" in said  # the message is named by its address
    assert secret_free(said)
    assert USER not in said
    assert not files_with(work, (*MARKS, USER))
    scans.close()
    answers.close()


@pytest.mark.parametrize("option", ["--source", "--sink"])
def test_a_refused_password_is_not_shown(option, broker, capfd):
    scheme, server = broker
    assert main(["stream", option, f"{scheme}://{USER}:canary-p-wrong@127.0.0.1:{server.port}/t"]) == 2
    said = capfd.readouterr()
    assert said.err.count("\n") == 1
    assert f"{scheme}://127.0.0.1:{server.port}/t: " in said.err
    assert "uthori" in said.err  # not authorized, Authorization Violation
    assert secret_free(said.err + said.out)


@pytest.mark.parametrize("scheme", ["mqtt", "nats", "kafka"])
def test_a_broker_that_is_not_there_is_named_without_the_password(scheme, monkeypatch, capfd):
    pytest.importorskip(f"jeat_graph.live.transport.{scheme}", reason="the client is not installed")
    monkeypatch.setattr(f"jeat_graph.live.transport.{scheme}._CONNECT_S", 1.0)
    port = brokers.free_port()
    assert main(["stream", "--source", f"{scheme}://{USER}:{QUOTED}@127.0.0.1:{port}/t"]) == 2
    said = capfd.readouterr()
    assert f"{scheme}://127.0.0.1:{port}/t" in said.err
    assert secret_free(said.err + said.out)


def test_an_unexpected_error_shows_no_password(monkeypatch):
    """A defect of ours ends in Python's own words, which have what an error says and lines of code."""
    from jeat_graph.live.transport.ends import source_address

    address = source_address(f"mqtt://{USER}:{QUOTED}@host/t")
    with pytest.raises(TypeError) as error:
        raise TypeError(address, {"address": address}, [address.password])
    assert secret_free(repr(error.value))
    assert USER not in repr(error.value)
