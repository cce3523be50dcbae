"""The online tracker: scans in, the tracks of the moment out, nothing kept that grows."""

from __future__ import annotations

from pathlib import Path

from jeat_graph.config.schema import Config, Preset
from jeat_graph.config.tracker import Engine
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.tracking.model_tracker import ModelTracker


class Tracker(ModelTracker):
    """Joint tracker of all objects over any number of asynchronous sensors.

    Feed it scans in time order. Each step sees only what has arrived: the table it returns is causal. Memory
    does not grow with time, if the smoother has a fixed lag and its rows are fetched (`drain_smoothed`).
    Sensors may have any names and are known from their first scan on.

    Args:
        config: sensors and settings, from `load_config`; or the name of a preset (`default`, `paper`), or of
            a YAML file.
        image: width and height of the picture (px), also as "1920x1080", if not those of the configuration.
        diagnostics: take down how well each detection fitted its track, for `last_updates`.
        engine: "core", "reference" or "paper", if not that of the configuration.
        constants: of the model, if not the usual ones; not for "paper".

    Example:
        >>> from jeat_graph import Tracker
        >>> tracker = Tracker(image=(1920, 1080))
        >>> table = tracker.step((0.0, "rgb", [[100, 100, 40, 30]], [0.9]))
        >>> tracker.num_tracks
        1
    """

    def __init__(
        self,
        config: Config | Preset | str | Path = "default",
        *,
        image: tuple[float, float] | str | None = None,
        diagnostics: bool = False,
        engine: Engine | None = None,
        constants: ModelConstants | None = None,
    ) -> None:
        super().__init__(config, image=image, diagnostics=diagnostics, engine=engine, constants=constants)
