"""Compile the tracker ahead of its first use; numba keeps the machine code beside the sources.

Run `python -m jeat_graph.tracking.warm_up` after an installation or an update, so that no user waits for it.
"""

from __future__ import annotations

import os
import sys

from jeat_graph.tracking import notice


def warm_up() -> None:
    """Track a vehicle for a second with each preset, smoother included, which compiles all they need."""
    from jeat_graph.config.reading import load_config
    from jeat_graph.tracking.tracker import Tracker

    for preset in ("default", "highway", "paper"):
        tracker = Tracker(load_config(preset))
        for k in range(20):
            box = [100.0 + 5.0 * k, 100.0, 40.0, 30.0]
            tracker.step([(0.05 * k, name, [box], [0.9]) for name in tracker.sensor_names])
        tracker.finish()


def main(arguments: list[str]) -> None:
    """Compile all, or with `--help-out K/N` what the other processes have not come to."""
    from jeat_graph.tracking.compiling import end_with_pipe, get_help, help_out

    if arguments[:1] == ["--help-out"]:
        from jeat_graph.config.reading import load_config

        end_with_pipe()
        if hasattr(os, "nice"):
            os.nice(10)  # who waits for it goes first
        k, _, number = arguments[1].partition("/")
        help_out(int(k), int(number), load_config("default"))
        return
    notice.when_cold = get_help
    notice.notice_if_cold()
    warm_up()


if __name__ == "__main__":
    main(sys.argv[1:])
