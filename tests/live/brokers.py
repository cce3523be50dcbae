"""Real brokers for the tests, each on a free port: Mosquitto, nats-server, that of librdkafka."""

from __future__ import annotations

import ctypes
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

#: Below those that a system gives to outgoing connections by itself: one of these could take the port of a
#: server that is being restarted, and a connection to a port where nobody listens could meet itself.
PORTS = (20_000, 32_000)


def free_port() -> int:
    while True:
        port = random.SystemRandom().randrange(*PORTS)  # not repeated by whoever seeds `random`
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                continue
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port


def program(name: str) -> str | None:
    """Path of a server's program, beside this Python, on the path, or where Debian puts it."""
    beside = Path(sys.executable).with_name(name)
    if beside.exists():
        return str(beside)
    return shutil.which(name) or shutil.which(name, path="/usr/sbin:/usr/local/sbin")


class Server:
    """A server that can be stopped and started again with what it has stored."""

    def __init__(self, command: list[str], port: int) -> None:
        self.port = port
        self._command = command
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(
            self._command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL
        )
        for _ in range(500):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.02)
        raise AssertionError(f"{self._command[0]} does not answer")

    def stop(self) -> None:
        self._process.terminate()
        self._process.wait()

    def kill(self) -> None:
        """End it as a crash would."""
        self._process.kill()
        self._process.wait()

    def freeze(self) -> None:
        """Have it keep its connections and say nothing more, as behind a network that is gone."""
        self._process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, self._process.pid, os.WSTOPPED | os.WNOWAIT)  # it stops soon, not at once

    def thaw(self) -> None:
        self._process.send_signal(signal.SIGCONT)


def mosquitto(folder: Path, *settings: str) -> Server | None:
    """Mosquitto, with further lines of its configuration; None if this machine has none."""
    path = program("mosquitto")
    if path is None:
        return None
    port = free_port()
    (folder / "mosquitto.conf").write_text(
        f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence true\n"
        f"persistence_location {folder}/\nmax_queued_messages 100000\nuser root\n"
        + "".join(f"{line}\n" for line in settings)
    )
    return Server([path, "-c", str(folder / "mosquitto.conf")], port)


def nats_server(folder: Path, *options: str) -> Server | None:
    """A nats-server with JetStream; None if this machine has none."""
    path = program("nats-server")
    if path is None:
        return None
    port = free_port()
    return Server([path, "-a", "127.0.0.1", "-p", str(port), "-js", "-sd", str(folder), *options], port)


class MockKafka:
    """The cluster that librdkafka brings for tests.

    Made through its C interface, because only there a group can be told not to wait for its third member:
    with the usual 3 s every source would take that long to open.
    """

    _PRODUCER = 0
    _GROUP_WAITS_MS = 50

    def __init__(self) -> None:
        from confluent_kafka import cimpl

        # The client's extension is linked to the library, so its names are found there too.
        self._library = library = ctypes.CDLL(cimpl.__file__)
        for name in ("rd_kafka_conf_new", "rd_kafka_new", "rd_kafka_mock_cluster_new"):
            getattr(library, name).restype = ctypes.c_void_p
        library.rd_kafka_mock_cluster_bootstraps.restype = ctypes.c_char_p
        conf = ctypes.c_void_p(library.rd_kafka_conf_new())
        for key, value in ((b"bootstrap.servers", b"unused"), (b"log_level", b"0")):
            assert library.rd_kafka_conf_set(conf, key, value, None, ctypes.c_size_t(0)) == 0
        self._client = ctypes.c_void_p(library.rd_kafka_new(self._PRODUCER, conf, None, ctypes.c_size_t(0)))
        self._cluster = ctypes.c_void_p(library.rd_kafka_mock_cluster_new(self._client, 1))
        library.rd_kafka_mock_group_initial_rebalance_delay_ms(self._cluster, self._GROUP_WAITS_MS)
        address = library.rd_kafka_mock_cluster_bootstraps(self._cluster).decode()
        self.port = int(address.rpartition(":")[2])

    def stop(self) -> None:
        self._library.rd_kafka_mock_cluster_destroy(self._cluster)
        self._library.rd_kafka_destroy(self._client)
