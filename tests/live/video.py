"""Cameras for the tests: Motion JPEG by HTTP from this process, RTSP by GStreamer where it is installed."""

from __future__ import annotations

import base64
import shutil
import subprocess
import threading
import time
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np
from live_tests import brokers

SIZE_PX = (320, 240)
SYSTEM_PYTHON = "/usr/bin/python3"


@cache
def pictures(count: int = 40) -> list[bytes]:
    """JPEGs of a bright square that goes to and fro before a textured wall."""
    wall = np.random.default_rng(3).integers(60, 120, (SIZE_PX[1] // 8, SIZE_PX[0] // 8, 3), np.uint8)
    wall = cv2.resize(wall, SIZE_PX, interpolation=cv2.INTER_NEAREST)
    made = []
    for k in range(count):
        picture = wall.copy()
        x = 20 + 6 * min(k, count - k)
        cv2.rectangle(picture, (x, 100), (x + 40, 130), (250, 250, 250), -1)
        made.append(cv2.imencode(".jpg", picture)[1].tobytes())
    return made


class MjpegCamera:
    """A camera that can be switched off and on again at the same port."""

    def __init__(self, rate_hz: float = 20.0, login: str | None = None, port: int | None = None) -> None:
        self.rate_hz, self._login = rate_hz, login
        self.port = port or brokers.free_port()
        self.given = 0
        self.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/video"

    def start(self) -> None:
        camera = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                camera.serve(self)

            def log_message(self, *_: object) -> None:
                pass

        class Server(ThreadingHTTPServer):
            allow_reuse_address, daemon_threads = True, True

            def handle_error(self, *_: object) -> None:
                pass  # a reader that goes away

        self._off = threading.Event()
        self._server = Server(("127.0.0.1", self.port), Handler)
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    def stop(self) -> None:
        self._off.set()
        self._server.shutdown()
        self._server.server_close()

    def serve(self, request: BaseHTTPRequestHandler) -> None:
        if self._login is not None:
            wanted = "Basic " + base64.b64encode(self._login.encode()).decode()
            if request.headers.get("Authorization") != wanted:
                request.send_response(401)
                request.send_header("WWW-Authenticate", 'Basic realm="camera"')
                request.end_headers()
                return
        request.send_response(200)
        request.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        request.end_headers()
        begin, k, off = time.monotonic(), 0, self._off
        while not off.is_set():
            jpeg = pictures()[k % len(pictures())]
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            request.wfile.write(head.encode() + jpeg + b"\r\n")
            self.given += 1
            k += 1
            time.sleep(max(begin + k / self.rate_hz - time.monotonic(), 0.0))
        request.connection.close()


_RTSP = """
import sys, gi
gi.require_version("Gst", "1.0"); gi.require_version("GstRtspServer", "1.0")
from gi.repository import Gst, GstRtspServer, GLib
Gst.init(None)
port, rate, user, password = sys.argv[1:5]
server = GstRtspServer.RTSPServer()
server.set_address("127.0.0.1"); server.set_service(port)
factory = GstRtspServer.RTSPMediaFactory()
factory.set_launch("( videotestsrc is-live=true pattern=ball ! "
    f"video/x-raw,format=I420,width=320,height=240,framerate={rate}/1 ! jpegenc ! rtpjpegpay name=pay0 )")
factory.set_shared(True)
if user:
    auth = GstRtspServer.RTSPAuth()
    token = GstRtspServer.RTSPToken()
    token.set_string("media.factory.role", "user")
    auth.add_basic(GstRtspServer.RTSPAuth.make_basic(user, password), token)
    server.set_auth(auth)
    allowed = "user, media.factory.access=(boolean)true, media.factory.construct=(boolean)true"
    factory.add_role_from_structure(Gst.Structure.from_string(allowed)[0])
server.get_mount_points().add_factory("/road", factory)
server.attach(None)
GLib.MainLoop().run()
"""


@cache
def has_rtsp() -> bool:
    """Whether the system's Python has GStreamer's RTSP server."""
    if shutil.which(SYSTEM_PYTHON) is None:
        return False
    ask = 'import gi; gi.require_version("GstRtspServer", "1.0"); from gi.repository import GstRtspServer'
    return subprocess.run([SYSTEM_PYTHON, "-c", ask], capture_output=True).returncode == 0


def rtsp_camera(rate_hz: int = 20, user: str = "", password: str = "") -> brokers.Server:
    """A real RTSP server with a ball that flies about, to be stopped and started."""
    port = brokers.free_port()
    return brokers.Server([SYSTEM_PYTHON, "-c", _RTSP, str(port), str(rate_hz), user, password], port)
