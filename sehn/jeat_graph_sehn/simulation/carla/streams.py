"""Sensor data of CARLA's callbacks, tick by tick, without ever waiting for what does not come.

An RGB or depth camera calls back once each tick. The event camera calls back only in ticks that had an event,
so nothing can be waited for: what it sent is collected, and a frame is given out one frame later, when the
data of its ticks have had their time to arrive. Data that come later still are an error, not a silent loss.
"""

from __future__ import annotations

import queue
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray

# Layout of `raw_data` of carla.DVSEventArray: packed, time in ns.
# Source: https://carla.readthedocs.io/en/0.9.16/ref_sensors/#dvs-camera
_DVS = np.dtype([("x", "<u2"), ("y", "<u2"), ("t", "<i8"), ("pol", "?")])
_FAR_M = 1000.0  # of the depth camera
_NS_PER_US = 1000


class TickStream:
    """Data of a sensor that calls back in every tick.

    Args:
        sensor: `carla.Sensor`.
        name: for messages.
        timeout_s: longest wait.
    """

    def __init__(self, sensor: Any, name: str, timeout_s: float) -> None:
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._name = name
        self._timeout_s = timeout_s
        sensor.listen(self._queue.put)

    def of_tick(self, tick: int) -> Any:
        """Return the data of a tick; those of earlier ticks are dropped.

        Raises:
            DataError: they did not come in time, or were passed over.
        """
        while True:
            try:
                data = self._queue.get(timeout=self._timeout_s)
            except queue.Empty:
                raise DataError(
                    f"CARLA: no {self._name} data of tick {tick} within {self._timeout_s:g} s; does the "
                    "server still run?"
                ) from None
            if data.frame == tick:
                return data
            if data.frame > tick:
                raise DataError(f"CARLA: {self._name} data of tick {data.frame} came without those of {tick}")


class EventStream:
    """Data of the event camera, which calls back only where there are events.

    Args:
        sensor: `carla.Sensor`.
    """

    def __init__(self, sensor: Any) -> None:
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._start_ns = 0
        self._first_tick = 0
        self._done_tick = -1
        self._waiting: list[Any] = []
        sensor.listen(self._queue.put)

    def begin(self, start_ns: int, first_tick: int) -> None:
        """Drop all before `first_tick`; times count from `start_ns` (ns)."""
        self._start_ns, self._first_tick, self._done_tick = start_ns, first_tick, first_tick - 1

    def until_tick(self, last_tick: int, t_us: int) -> EventArray:
        """Return, without waiting, the events of the ticks since the call before, up to `last_tick`.

        Args:
            last_tick: the last of these ticks.
            t_us: time of that tick (µs); an event may lie beyond by rounding, and is put there.

        Raises:
            DataError: data of a tick came after its events had been given out.
        """
        while True:
            try:
                self._waiting.append(self._queue.get_nowait())
            except queue.Empty:
                break
        self._waiting = [data for data in self._waiting if data.frame >= self._first_tick]
        late = [data.frame for data in self._waiting if data.frame <= self._done_tick]
        if late:
            raise DataError(
                f"CARLA: events of tick {late[0]} came more than a frame late; give the server fewer pixels "
                "or ticks to render"
            )
        ready = [data for data in self._waiting if data.frame <= last_tick]
        self._waiting = [data for data in self._waiting if data.frame > last_tick]
        self._done_tick = last_tick
        raw = [np.frombuffer(data.raw_data, dtype=_DVS) for data in ready]
        rows = np.concatenate([np.zeros(0, dtype=_DVS), *raw])
        t = np.clip((rows["t"] - self._start_ns) // _NS_PER_US, 0, t_us)
        # The server's sort leaves equal times in any order; ours does not.
        order = np.lexsort((rows["pol"], rows["x"], rows["y"], t))
        return EventArray(t[order], rows["x"][order], rows["y"][order], rows["pol"][order].astype(np.uint8))


def rgb_of(image: Any) -> npt.NDArray[np.uint8]:
    """Return the picture (H, W, 3) of a `carla.Image`, whose bytes are blue, green, red, alpha."""
    pixels = np.frombuffer(image.raw_data, dtype=np.uint8).reshape(image.height, image.width, 4)
    return np.ascontiguousarray(pixels[..., 2::-1])


def depth_of(image: Any) -> FloatArray:
    """Return the distances (H, W) along the optical axis (m) of a depth camera's `carla.Image`.

    Source: https://carla.readthedocs.io/en/0.9.16/ref_sensors/#depth-camera
    """
    pixels = np.frombuffer(image.raw_data, dtype=np.uint8).reshape(image.height, image.width, 4)
    blue, green, red = (pixels[..., k].astype(np.float64) for k in range(3))
    return np.asarray((red + 256.0 * green + 65536.0 * blue) / (2**24 - 1) * _FAR_M, dtype=np.float64)
