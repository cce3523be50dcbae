"""Write a configuration as a YAML file that can be read back."""

from __future__ import annotations

from pathlib import Path

import yaml

from jeat_graph.config.reading import config_to_dict
from jeat_graph.config.schema import Config
from jeat_graph.io.files.atomic import open_atomic


def save_config(config: Config, path: str | Path, comment: str = "") -> None:
    """Write a configuration as YAML that `load_config` reads back to an equal one.

    Args:
        config: what to write.
        path: the file; it appears when it is complete.
        comment: lines put before it.
    """
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    with open_atomic(path) as file:
        file.write(head + yaml.safe_dump(config_to_dict(config), sort_keys=False, allow_unicode=True))
