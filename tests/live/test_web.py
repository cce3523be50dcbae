"""`/health` and `/metrics`: clients that go early, and HEAD."""

from __future__ import annotations

import http.client
import socket
import struct
import time

import pytest

pytest.importorskip("prometheus_client", reason="the extra `serve` is not installed")

from jeat_graph.io.streams.web_server import WebHandler, WebServer
from jeat_graph.live.service.status import Status
from jeat_graph.live.service.web import Web


@pytest.fixture
def told():
    return []


@pytest.fixture
def web(told):
    with Web("127.0.0.1", 0, Status("gantry7", 10.0), told.append) as web:
        yield web


def ask(port, method, path):
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    link.request(method, path)
    answer = link.getresponse()
    content = answer.read()
    link.close()
    return answer, content


@pytest.mark.parametrize("path", ["/health", "/metrics", "/nothing"])
def test_head_is_get_without_content(web, path):
    got, content = ask(web.port, "GET", path)
    head, nothing = ask(web.port, "HEAD", path)
    assert (head.status, nothing) == (got.status, b"")
    assert head.headers["Content-Type"] == got.headers["Content-Type"]
    assert content
    assert int(head.headers["Content-Length"]) > 0


def gone_before_the_answer(port, path):
    """Ask, and reset the connection at once."""
    link = socket.create_connection(("127.0.0.1", port))
    link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    link.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n".encode())
    link.close()


def test_clients_that_go_early_leave_no_trace(web, told, capfd):
    for _ in range(20):
        for path in ("/health", "/metrics"):
            gone_before_the_answer(web.port, path)
    assert ask(web.port, "GET", "/metrics")[0].status == 200
    time.sleep(0.1)
    assert capfd.readouterr().err == ""
    assert told == []


def test_what_cannot_be_answered_is_one_line(told, capfd):
    class Broken(WebHandler):
        def get(self):
            raise ValueError("no such sensor")

    with WebServer("127.0.0.1", 0, Broken, told.append) as server:
        link = socket.create_connection(server.server_address)
        link.sendall(b"GET / HTTP/1.0\r\n\r\n")
        server.timeout = 5
        server.handle_request()
        assert link.recv(10) == b""
        link.close()
    assert told == ["warning: a request could not be answered: ValueError: no such sensor"]
    assert capfd.readouterr().err == ""
