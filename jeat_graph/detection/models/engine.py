"""Runs an ONNX file, by ONNX Runtime where it is installed, else by OpenCV."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.extras import install
from jeat_graph.detection.models.onnx_head import OnnxHead


class Engine(Protocol):
    """Runs a network.

    Attributes:
        name: what runs it.
    """

    name: str

    def run(self, inputs: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
        """Return all outputs by their names."""
        ...


def open_engine(path: str | Path, head: OnnxHead, backend: str, threads: int) -> Engine:
    """Load a network.

    Args:
        path: the ONNX file.
        head: what it says of itself.
        backend: `auto`, `opencv` or `onnxruntime`.
        threads: at most so many; 0: the backend's own choice.

    Raises:
        ConfigError: `onnxruntime` is asked for and not installed.
        DataError: the backend cannot run it.
    """
    if backend != "opencv":
        try:
            import onnxruntime  # noqa: F401
        except ImportError:
            if backend == "onnxruntime":
                raise ConfigError(f"backend onnxruntime needs {install('onnxruntime')}") from None
        else:
            return _OnnxRuntime(Path(path), threads)
    return _OpenCv(Path(path), head, threads)


class _OnnxRuntime:
    name = "ONNX Runtime"

    def __init__(self, path: Path, threads: int) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.log_severity_level = 3
        self._path = path
        try:
            self._session = onnxruntime.InferenceSession(
                str(path), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            raise DataError(f"cannot be run by ONNX Runtime: {_short(error)}", path) from None
        self._names = [port.name for port in self._session.get_outputs()]

    def run(self, inputs: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
        try:
            found = self._session.run(self._names, dict(inputs))
        except Exception as error:
            raise DataError(f"fails in ONNX Runtime: {_short(error)}", self._path) from None
        return {name: np.asarray(value) for name, value in zip(self._names, found, strict=True)}


class _OpenCv:
    name = "OpenCV"

    def __init__(self, path: Path, head: OnnxHead, threads: int) -> None:
        import cv2

        self._path = path
        self._names = [port.name for port in head.outputs]
        if threads:
            cv2.setNumThreads(threads)
        try:
            self._net = cv2.dnn.readNetFromONNX(str(path))
        except Exception as error:
            raise DataError(
                f"cannot be run by OpenCV: {_short(error)}; {install('onnxruntime')} runs more",
                path,
            ) from None

    def run(self, inputs: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
        try:
            for name, value in inputs.items():
                self._net.setInput(value, name)
            found = self._net.forward(self._names)
        except Exception as error:
            raise DataError(
                f"fails in OpenCV: {_short(error)}; {install('onnxruntime')} runs more",
                self._path,
            ) from None
        return {name: np.asarray(value) for name, value in zip(self._names, found, strict=True)}


#: What OpenCV says before and after the reason: version, file, line and code; the function.
_AROUND = re.compile(r"^OpenCV\(\S*\) .*?: error: \(.*?\) | in function '[^']*'$")
_SENTENCE = re.compile(r"(?<=\w{2})\. (?=[A-Z])")


def _short(error: Exception) -> str:
    """Return the first sentence of what an engine says."""
    return _SENTENCE.split(_AROUND.sub("", " ".join(str(error).split())))[0]
