"""Networks of other people that can be asked for by name: where their files come from, and how good they are.

Only networks with permissive licences of code and weights. An address is one that the network's own README
or release page gives; where none of them gives an ONNX file, `how` says how one is made. `average_precision`
is that of COCO (AP50:95, per cent), from the same page. The SHA-256 of all files with an address are pinned,
as several independent public projects that fetch the same files pin them.
"""

from __future__ import annotations

from typing import NamedTuple

_YOLOX = "https://github.com/Megvii-BaseDetection/YOLOX"
_YOLOX_FILES = f"{_YOLOX}/releases/download/0.1.1rc0"
_NANODET = "https://github.com/RangiLyu/nanodet"
_APACHE = "Apache-2.0"


class KnownNetwork(NamedTuple):
    """A network of other people.

    Attributes:
        name: what `--detector-frames` takes.
        file: name of its file in the cache.
        page: the network's own page.
        licence: of code and weights.
        side: width and height of its input (px).
        average_precision: AP50:95 on COCO (per cent).
        parameters: how many it has (millions).
        address: of its file; empty where the page gives none.
        sha256: of files that are known to be it; empty where none is: then that of the first is kept.
        how: how its file is made or found, where there is no address.
    """

    name: str
    file: str
    page: str
    licence: str
    side: int
    average_precision: float
    parameters: float
    address: str = ""
    sha256: tuple[str, ...] = ()
    how: str = ""


KNOWN = {
    network.name: network
    for network in (
        # Addresses and AP: demo/ONNXRuntime/README.md of its repository.
        KnownNetwork(
            "yolox-nano",
            "yolox_nano.onnx",
            _YOLOX,
            _APACHE,
            416,
            25.8,
            0.91,
            f"{_YOLOX_FILES}/yolox_nano.onnx",
            (
                # The file of the release, as several public projects give it.
                "c789161ed43c8269fcd4e67c67eeeb4e80c622da2eb296a20bc6007bd18a0b7d",
                # The one with which this package was measured: another export of the same weights, from
                # github.com/Kazuhito00/MOT-Tracking-by-Detection-Pipeline.
                "695e750a5d5754bb5a8d5325643b59282191a7e7a564e435a415fd3c578eab14",
            ),
        ),
        KnownNetwork(
            "yolox-tiny",
            "yolox_tiny.onnx",
            _YOLOX,
            _APACHE,
            416,
            32.8,
            5.06,
            f"{_YOLOX_FILES}/yolox_tiny.onnx",
            ("427cc366d34e27ff7a03e2899b5e3671425c262ea2291f88bb942bc1cc70b0f7",),
        ),
        KnownNetwork(
            "yolox-s",
            "yolox_s.onnx",
            _YOLOX,
            _APACHE,
            640,
            40.5,
            9.0,
            f"{_YOLOX_FILES}/yolox_s.onnx",
            ("c5c2d13e59ae883e6af3b45daea64af4833a4951c92d116ec270d9ddbe998063",),
        ),
        # AP: README.md of its repository, which gives checkpoints, and its releases for all else.
        KnownNetwork(
            "nanodet-m-416",
            "nanodet_m_416.onnx",
            _NANODET,
            _APACHE,
            416,
            23.5,
            0.95,
            sha256=("08b62b9ee4a7878e7a64d6ef4faf3074322c033a0252c83a20f41b86c76e8146",),
            how="export its checkpoint (tools/export_onnx.py), or take the export of "
            "github.com/Kazuhito00/MOT-Tracking-by-Detection-Pipeline, with which this package was measured",
        ),
        KnownNetwork(
            "nanodet-plus-m-416",
            "nanodet-plus-m_416.onnx",
            _NANODET,
            _APACHE,
            416,
            30.4,
            1.17,
            f"{_NANODET}/releases/download/v1.0.0-alpha-1/nanodet-plus-m_416.onnx",
            ("59d2f166088889c902f523bf08079391993491324f0d84847e3c4016a8f7cc3d",),
        ),
        # AP and checkpoints: rtdetrv2_pytorch/README.md.
        KnownNetwork(
            "rtdetrv2-s",
            "rtdetrv2_r18vd.onnx",
            "https://github.com/lyuwenyu/RT-DETR",
            _APACHE,
            640,
            47.9,
            20.0,
            how="export the checkpoint of its README (tools/export_onnx.py)",
        ),
        # AP and checkpoints: README.md.
        KnownNetwork(
            "dfine-s",
            "dfine_s_coco.onnx",
            "https://github.com/Peterande/D-FINE",
            _APACHE,
            640,
            48.5,
            10.0,
            how="export the checkpoint of its README (tools/deployment/export_onnx.py)",
        ),
    )
}
