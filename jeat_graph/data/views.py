"""Ways to look at a table of trajectories: data frame, one track, a span of time, a plot, a short summary."""

from __future__ import annotations

import html
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self, Unpack

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray, TextArray
from jeat_graph.data.class_columns import rows_of_class
from jeat_graph.data.column_names import BOX, MEAN, SIZE_VAR, VAR
from jeat_graph.data.errors import DataError
from jeat_graph.data.interop import to_xyxy
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.tables.trajectory_table import fields_of_frame
from jeat_graph.data.to_supervision import OwnDetections, supervision_of

if TYPE_CHECKING:
    import pandas as pd

_SHOWN_ROWS = 8


class TrajectoryViews:
    """What `Trajectories` offers beside its columns; see there for the attributes."""

    if TYPE_CHECKING:
        t: FloatArray
        track_id: IntArray
        boxes: FloatArray
        existence: FloatArray
        mean: FloatArray
        var: FloatArray
        size_var: FloatArray
        used: IntArray
        sensors: tuple[str, ...]
        classes: TextArray | None
        class_probability: FloatArray | None
        class_ids: Mapping[str, int] | None
        own: OwnDetections | None
        causal_id: IntArray | None
        identity_probability: FloatArray | None

        def take(self, rows: npt.ArrayLike) -> Self:
            """Return some rows."""
            ...

        def sensor_text(self) -> list[str]:
            """Names of the sensors used in each row."""
            ...

        def __len__(self) -> int: ...

    @property
    def xyxy(self) -> FloatArray:
        """Boxes (N, 4) as left, top, right, bottom (px)."""
        return to_xyxy(self.boxes)

    @property
    def center(self) -> FloatArray:
        """Centres of the boxes (N, 2), not clipped to the picture (px)."""
        return self.mean[:, :2]

    @property
    def velocity(self) -> FloatArray:
        """Velocities of the centres (N, 2) (px/s)."""
        return self.mean[:, 2:4]

    @property
    def covariance(self) -> FloatArray:
        """Covariances (N, 2, 2) of the centres (px²); the two axes are independent in the model."""
        return self.var[:, :2, None] * np.eye(2)

    def of(self, track_id: int) -> Self:
        """Return the rows of one track, in their order; none if there is no such track."""
        return self.take(self.track_id == track_id)

    def between(self, t0: float, t1: float) -> Self:
        """Return the rows with t0 <= t <= t1 (s)."""
        return self.take((self.t >= t0) & (self.t <= t1))

    def of_class(self, *names: str, final: bool = False) -> Self:
        """Return the rows whose class is one of some.

        Args:
            names: of classes.
            final: go by the class that each track ends with, so that tracks stay whole; otherwise by that of
                each row, which knows nothing that came later.

        Raises:
            DataError: the table has no classes, or no row is of one of these.
        """
        classes = self.classes
        if final and classes is not None:
            last = self.final_classes()
            classes = np.array([last[track_id] for track_id in self.track_id.tolist()], dtype=np.str_)
        return self.take(rows_of_class(classes, names, unknown=False))

    def final_classes(self) -> dict[int, str]:
        """Return the class of each track at the end of its life; empty text where it is unknown."""
        if self.classes is None:
            return {}
        order = np.argsort(self.t, kind="stable")
        return dict(zip(self.track_id[order].tolist(), self.classes[order].tolist(), strict=True))

    def to_pandas(self) -> pd.DataFrame:
        """Return the table as a data frame with the columns of `causal.csv`, not rounded."""
        import pandas as pd

        columns: dict[str, Any] = {"t": self.t, "track_id": self.track_id}
        columns |= {name: self.boxes[:, k] for k, name in enumerate(BOX)}
        columns["existence"] = self.existence
        columns |= {name: self.mean[:, k] for k, name in enumerate(MEAN)}
        columns |= {name: self.var[:, k] for k, name in enumerate(VAR)}
        columns["sensors"] = self.sensor_text()
        if self.classes is not None:
            columns |= {"class": self.classes, "class_probability": self.class_probability}
        columns |= {name: self.size_var[:, k] for k, name in enumerate(SIZE_VAR)}
        if self.causal_id is not None:
            columns |= {"causal_id": self.causal_id, "identity_probability": self.identity_probability}
        return pd.DataFrame(columns)

    @classmethod
    def from_pandas(cls, frame: pd.DataFrame, **options: Unpack[ReadingOptions]) -> Self:
        """Read a data frame as `read_trajectories` reads a file of the same columns.

        Args:
            frame: the columns of `causal.csv`, such as `to_pandas` gives; or another tracker's result: `t` or
                frame numbers, `track_id` and a box, which may go by the other names that files may have.
            options: what a result does not say itself, as `tables.reading.Reading` has it.

        Raises:
            DataError: a column is missing, or a row (from 0) is no track, or there twice.
        """
        how = Reading(**options)
        return cls(**fields_of_frame(frame, how, how.listed_classes())[0])

    def to_supervision(self, *, own: bool = True) -> Any:
        """Return `supervision.Detections` with `tracker_id`, for its annotators.

        After `Tracker.update` with `supervision.Detections` these come back, all of them, with their masks,
        data and other fields; of what no reported track took `tracker_id` is -1. Else, and with `own` false,
        the tracks themselves are the rows, those too that nobody saw in this picture: the existence
        probability stands in `confidence`, the class in `data["class_name"]`, its number as it came in
        `class_id` (-1 where it is unknown). Take the rows of one moment: a step's table, or `between(t, t)`.

        Args:
            own: whether the user's detections come back where there are such.

        Raises:
            ImportError: the package `supervision` is not installed.
        """
        if own and self.own is not None:
            return self.own.with_tracks(self.track_id)
        return supervision_of(self.boxes, self.existence, self.classes, self.track_id, self.class_ids)

    def plot(self, kind: str = "picture", ax: Any = None, picture: npt.ArrayLike | None = None) -> Any:
        """Draw the tracks with matplotlib.

        Args:
            kind: `picture` for the paths in the picture plane, `timeline` for the life of each track, `speed`
                for the image speed over time.
            ax: axes to draw into; new ones by default.
            picture: (H, W, 3) or (H, W) what to draw over, as matplotlib takes it (red, green, blue); then
                the boxes of the table's last moment are drawn too, with their numbers.

        Returns:
            The axes.

        Raises:
            DataError: no such kind, or a picture for another one than `picture`.
        """
        from matplotlib import pyplot as plt

        if kind not in ("picture", "timeline", "speed"):
            raise DataError(f"kind {kind!r}: there are picture, timeline and speed")
        if picture is not None and kind != "picture":
            raise DataError(f"kind {kind!r} goes over no picture")
        ax = plt.subplots()[1] if ax is None else ax
        if picture is not None:
            ax.imshow(picture, cmap="gray")
            ax.autoscale(False)
        for track_id in np.unique(self.track_id):
            rows = self.of(int(track_id))
            if kind == "picture":
                (path,) = ax.plot(*rows.center.T, linewidth=1, label=str(track_id))
                if picture is not None:
                    _draw_box(ax, rows.take(rows.t == self.t.max()), path.get_color())
            elif kind == "timeline":
                ax.plot(rows.t, np.full(len(rows), track_id), linewidth=3)
            else:
                ax.plot(rows.t, np.hypot(*rows.velocity.T), linewidth=1, label=str(track_id))
        names = {"picture": ("x (px)", "y (px)"), "timeline": ("t (s)", "track"), "speed": ("t (s)", "px/s")}
        ax.set_xlabel(names[kind][0])
        ax.set_ylabel(names[kind][1])
        if kind == "picture":
            if not ax.yaxis_inverted():
                ax.invert_yaxis()  # y points down in a picture
            ax.set_aspect("equal")
        return ax

    def __repr__(self) -> str:
        if not len(self):
            return "Trajectories: no tracks"
        tracks = len(np.unique(self.track_id))
        head = f"Trajectories: {len(self)} rows, {tracks} track{'s' * (tracks != 1)}, "
        lines = [head + f"{self.t.min():g} to {self.t.max():g} s"]
        for k in range(min(len(self), _SHOWN_ROWS)):
            box = " ".join(f"{v:.1f}" for v in self.boxes[k])
            speed = float(np.hypot(*self.mean[k, 2:4]))
            kind = "track" if self.classes is None or not self.classes[k] else str(self.classes[k])
            text = f"{kind} {self.track_id[k]} at [{box}] px, {speed:.1f} px/s"
            lines.append(f"  {self.t[k]:.3f} s  {text}, existence {self.existence[k]:.2f}")
        if len(self) > _SHOWN_ROWS:
            lines.append(f"  … {len(self) - _SHOWN_ROWS} more rows")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return a short table for notebooks."""
        head: tuple[str, ...] = ("t (s)", "track", "box (px)", "velocity (px/s)", "existence", "seen by")
        head += () if self.classes is None else ("class",)
        rows = []
        texts = self.take(np.arange(min(len(self), _SHOWN_ROWS))).sensor_text()
        for k, seen in enumerate(texts):
            box = ", ".join(f"{v:.1f}" for v in self.boxes[k])
            vx, vy = self.mean[k, 2:4]
            cells: tuple[str, ...] = (
                f"{self.t[k]:.3f}",
                str(self.track_id[k]),
                box,
                f"{vx:.1f}, {vy:.1f}",
                f"{self.existence[k]:.2f}",
                html.escape(seen),
            )
            if self.classes is not None:
                cells += (html.escape(str(self.classes[k])),)
            rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
        tracks = len(np.unique(self.track_id))
        note = f"{len(self)} rows, {tracks} tracks"
        header = "".join(f"<th>{name}</th>" for name in head)
        return f"<table><tr>{header}</tr>{''.join(rows)}</table><p>{note}</p>"


def _draw_box(ax: Any, rows: TrajectoryViews, colour: str) -> None:
    """Draw the box of one track, if it is there, with its number."""
    from matplotlib.patches import Rectangle

    for track_id, (left, top, width, height) in zip(rows.track_id, rows.boxes, strict=True):
        ax.add_patch(Rectangle((left, top), width, height, fill=False, edgecolor=colour))
        ax.text(left, top, str(track_id), color=colour, verticalalignment="bottom", clip_on=True)
