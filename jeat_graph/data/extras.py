"""How to install what not everybody needs: the packages of each extra, so that a message can name them.

`pip install 'jeat-graph[aedat4]'` works only where the package itself can be had from an index; the packages
that an extra stands for can be installed anywhere.
"""

from __future__ import annotations

#: Packages of each extra that a message may name, as `pyproject.toml` asks for them.
PACKAGES: dict[str, tuple[str, ...]] = {
    "aedat4": ("aedat>=2.2,<3",),
    "baselines": (
        "supervision>=0.27",
        "filterpy>=1.4.5",
        "rich>=13",
        "requests>=2.28",
        "pydeprecate>=0.9,<0.14",
    ),
    "dv": ("dv-processing>=2,<3",),
    "hdf5": ("hdf5plugin>=5",),
    "kafka": ("confluent-kafka>=2.6,<3",),
    "mqtt": ("paho-mqtt>=2.1,<3",),
    "msgpack": ("msgpack>=1.1,<2",),
    "nats": ("nats-py>=2.9,<3",),
    "onnxruntime": ("onnxruntime>=1.20,<2",),
    "ray": ("ray>=2.40,<3",),
    "rerun": ("rerun-sdk>=0.28,<1",),
    "ros": ("rosbags>=0.11,<0.12",),
    "serve": ("prometheus-client>=0.21,<1",),
}


def install(*extras: str) -> str:
    """Return the command that installs what some extras stand for.

    Args:
        extras: names in `PACKAGES`.

    Raises:
        KeyError: an extra that is not known.
    """
    return "pip install " + " ".join(f"'{package}'" for name in extras for package in PACKAGES[name])
