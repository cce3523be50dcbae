"""Small recordings in the layouts of Gen1, 1 Megapixel and eTraM: events and arrays of boxes."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.events import EventArray
from jeat_graph.io.events.converting import event_writer

SIZE = (64, 48)
END_S, LABEL_S = 2.0, 0.25
#: Fields of Prophesee's newer arrays of boxes; the older ones call the time `ts`.
BOX = np.dtype(
    [
        *(("t", "<i8"), ("x", "<f4"), ("y", "<f4"), ("w", "<f4"), ("h", "<f4")),
        *(("class_id", "u1"), ("track_id", "<u4"), ("class_confidence", "<f4")),
    ]
)


def car_at(t, seed=0):
    """Left, top, width, height of the car, which drives to and fro."""
    return np.array([8.0 + seed + 14.0 * (1.0 + np.sin(3.0 * t)), 14.0, 18.0, 14.0])


def walker_at(t):
    """The same of somebody who walks."""
    return np.array([4.0 + 6.0 * t, 34.0, 5.0, 10.0])


def events(seed=0, end_s=END_S):
    """Events along the sides of both."""
    rng = np.random.default_rng(seed)
    parts = []
    for start in range(0, round(end_s * 1e6), 2500):
        for box, count in ((car_at(start / 1e6, seed), 14), (walker_at(start / 1e6), 3)):
            left, top, width, height = box
            right = rng.random(count) < 0.5
            x = np.where(right, left + width - 1, left).astype(int)
            y = rng.integers(int(top), int(top + height), count)
            parts.append(np.column_stack([rng.integers(start, start + 2500, count), x, y, right]))
    table = np.concatenate(parts)
    table = table[(table[:, 1] >= 0) & (table[:, 1] < SIZE[0]) & (table[:, 2] < SIZE[1])]
    t, x, y, p = table[np.argsort(table[:, 0], kind="stable")].T
    return EventArray(t, x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8))


def boxes(car=0, walker=1, seed=0, end_s=END_S, every_s=LABEL_S, old=False):
    """Labels of both, by the numbers of their classes."""
    rows = []
    for t in np.arange(every_s, end_s, every_s):
        rows.append((round(t * 1e6), *car_at(t, seed), car, 1, 1.0))
        rows.append((round(t * 1e6), *walker_at(t), walker, 2, 1.0))
    found = np.array(rows, dtype=BOX)
    return found.astype([("ts" if name == "t" else name, BOX[name]) for name in BOX.names]) if old else found


def write_events(path, found, size=SIZE):
    """Write events as the suffix says; HDF5 in plain columns, as eTraM and RVT have it."""
    if path.suffix != ".h5":
        with event_writer(path, None, size) as writer:
            writer.append(found)
        return path
    import h5py

    with h5py.File(path, "w") as file:
        columns = {"t": found.t_us, "x": found.x, "y": found.y, "p": found.polarity}
        for name, values in columns.items():
            file[f"events/{name}"] = values
        file["events/width"], file["events/height"] = size
    return path


def write_recording(folder, name, ending="_td.dat", seed=0, **labels):
    """Write a recording and its labels."""
    folder.mkdir(parents=True, exist_ok=True)
    write_events(folder / f"{name}{ending}", events(seed))
    np.save(folder / f"{name}_bbox.npy", boxes(seed=seed, **labels))
