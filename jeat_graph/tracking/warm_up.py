"""Compile the tracker ahead of its first use; numba keeps the machine code beside the sources.

Run `python -m jeat_graph.tracking.warm_up` after an installation or an update, so that no user waits for it.
"""

from __future__ import annotations

import sys

from jeat_graph.tracking import notice


def main(arguments: list[str]) -> None:
    """Compile all that the presets need, or as a helper what other processes have not come to."""
    from jeat_graph.tracking.compiling import compile_all, help_out, wait_with_help
    from jeat_graph.tracking.helpers import part_of

    if (part := part_of(arguments)) is not None:
        help_out(*part)
        return
    notice.when_cold = wait_with_help
    notice.notice_if_cold()
    compile_all()


if __name__ == "__main__":
    main(sys.argv[1:])
