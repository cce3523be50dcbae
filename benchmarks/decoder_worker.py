"""Times one package's decoder on files of events; run by the Python of the environment that has the package.

Arguments: the package, repetitions, the stream's columns (.npz), then FORMAT=FILE each. Prints JSON: by
format the least processor time (s), or why there is none. Nothing but NumPy and the package is imported.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

#: Formats that each package reads.
READS = {"jeat-graph": ("evt3", "evt2", "dat"), "evt3": ("evt3",), "expelliarmus": ("evt3", "evt2", "dat")}


def decoder(package: str, form: str, path: str, size_px: tuple[int, int]) -> Callable[[], Sequence[Any]]:
    """Return a function that reads a file to its end and gives parts of columns t, x, y, polarity."""
    if package == "evt3":
        import evt3

        return lambda: [evt3.decode_file(path)]
    if package == "expelliarmus":
        from expelliarmus import Wizard  # type: ignore[import-not-found]

        wizard = Wizard(encoding=form)
        return lambda: [wizard.read(path)]
    from jeat_graph.io.events.opening import open_events

    def ours() -> Sequence[Any]:
        with open_events(path, size_px) as reader:
            return list(reader.pieces())

    return ours


def columns_of(package: str, parts: Sequence[Any]) -> list[Any]:
    """Return t (µs), x, y and polarity of what a decoder gave."""
    if package == "expelliarmus":
        return [parts[0][name] for name in ("t", "x", "y", "p")]
    names = ("timestamp", "x", "y", "polarity") if package == "evt3" else ("t_us", "x", "y", "polarity")
    return [np.concatenate([getattr(part, name) for part in parts]) for name in names]


def timed(package: str, form: str, path: str, stream: Any, repeats: int) -> float | str:
    """Return the least processor time (s) of several repetitions, or why there is none."""
    try:
        do = decoder(package, form, path, tuple(stream["size"].tolist()))
        found = columns_of(package, do())
        wanted = [stream[name] for name in ("t", "x", "y", "p")]
        pairs = zip(("times", "columns", "rows", "polarities"), found, wanted, strict=True)
        wrong = [name for name, a, b in pairs if not np.array_equal(a, b)]
        times = []
        for _ in range(repeats):
            begin = time.process_time()
            made = do()
            times.append(time.process_time() - begin)
            del made
    except Exception as error:  # whatever a package that is only looked at raises
        return f"fails ({type(error).__name__})"
    return f"gives other {wrong[0]}" if wrong else min(times)


def main(arguments: Sequence[str]) -> None:
    """Time what the command line names."""
    package, repeats, columns, *files = arguments
    stream = np.load(columns)
    named = [one.split("=", 1) for one in files]
    out = {f: timed(package, f, p, stream, int(repeats)) for f, p in named if f in READS[package]}
    print(json.dumps(out))


if __name__ == "__main__":
    main(sys.argv[1:])
