"""How a network of the user's is fed and read; what is left open is recognised from its file."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, choice, flag, number
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.models.layouts.registry import all_layouts

#: Overlap (IoU) above which one of two boxes goes, and from which on boxes are averaged: of networks that
#: `train` made (chosen on two of theirs, of pictures and of events, in seeds 1001 and 3001), and of others.
OWN_OVERLAPS = (0.55, 0.65)
_OTHERS_OVERLAPS = (0.5, 1.0)
#: Above this two boxes of different classes are one thing.
_ACROSS = 0.65
#: Scores below are left out of networks that `train` made, whose scores the tracker knows; of others a layout
#: says it (`layouts.record`).
_OWN_SCORE = 0.1
AUTO = "auto"
#: What becomes of boxes of parts.
DISCOUNT, KEEP = "discount", "keep"


@dataclass(frozen=True)
class ModelSettings(Section):
    """A network from an ONNX file."""

    layout: str = choice(
        AUTO,
        (AUTO, *all_layouts()),
        "what its outputs mean; auto: by the notes of its file, the shapes and the names of the outputs",
    )
    backend: str = choice(
        "auto", ("auto", "opencv", "onnxruntime"), "what runs it; auto: onnxruntime if installed, else OpenCV"
    )
    threads: int = number(0, "1", "threads that run it; 0: as many as the backend takes", 0, 1024)
    color: str = choice("auto", ("auto", "bgr", "rgb"), "order of the colours that it was trained with")
    fit: str = choice(
        "auto",
        ("auto", "letterbox", "letterbox-centre", "stretch"),
        "how a picture gets its size: filled up at the right and below, on all sides, or stretched",
    )
    scale: float | None = number(
        None, "1", "a grey level of 0 to 255 is multiplied by it; null: as usual for the layout"
    )
    mean: tuple[float, ...] = number(
        (), "grey levels", "taken off each colour, in its order; empty: as usual", -1e4
    )
    std: tuple[float, ...] = number((), "grey levels", "then divided by; empty: as usual", open_low=True)
    pad: float = number(114.0, "grey levels", "what letterboxes are filled with", 0.0, 255.0)
    width: int = number(
        0,
        "px",
        "of the network's input where its file leaves it open; 0: as its notes say, else 640",
        0,
        8192,
    )
    height: int = number(
        0,
        "px",
        "of the network's input where its file leaves it open; 0: as its notes say, else 640",
        0,
        8192,
    )
    classes: tuple[str, ...] = ()
    score: float | None = number(
        None,
        "1",
        "detections below are left out; null: as fits the layout, .1 for files of `train`",
        0.0,
        1.0,
    )
    overlap: float | None = number(
        None,
        "1",
        "of two boxes of a class that overlap by more (IoU) the better stays; null: .55 for files of "
        "`train`, else .5",
        0.0,
        1.0,
    )
    overlap_classes: float = number(
        _ACROSS,
        "1",
        "of two boxes of different classes that overlap by more the better stays; people stay beside what "
        "they ride",
        0.0,
        1.0,
    )
    average: float | None = number(
        None,
        "1",
        "and becomes the mean of all that overlap it by so much or more, weighed by scores; 1: it stays "
        "as it is; null: .65 for files of `train`, else 1",
        0.0,
        1.0,
    )

    parts: str = choice(
        AUTO,
        (AUTO, DISCOUNT, KEEP),
        "what becomes of a box that a better one covers, as it covers lamps and wheels of a near vehicle; "
        "discount: its score times 1 - c², c the share that is covered; keep: nothing; auto: discount for "
        "networks of events that `train` made, else keep",
    )
    tiles: int = number(
        1,
        "1",
        "a picture larger than the network's input is shown in at most so many tiles, which overlap; each "
        "takes as long as a whole one; 0: as many as its own size needs; 1: as a whole, made smaller",
        0,
        64,
    )
    noise_filter: bool = flag(
        False,
        "whether a network of events is spared those that stand alone, and hot pixels (events.noise); most "
        "were trained with all events",
    )

    channels: str = choice(
        "auto",
        ("auto", "polarity", "time"),
        "order in a histogram of events: by polarity (all bins of the darker ones, then of the brighter), or "
        "by time (both polarities of each bin); auto: by time for files of `train`, else by polarity (RVT)",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, values in (("mean", self.mean), ("std", self.std)):
            if len(values) not in (0, _COLOURS):
                raise ConfigError(f"{name}: must be {_COLOURS} numbers, one a colour, or none")

    def overlaps(self, *, own: bool) -> tuple[float, float]:
        """Return `overlap` and `average` of a network that `train` made, or of another."""
        overlap, average = OWN_OVERLAPS if own else _OTHERS_OVERLAPS
        return (
            overlap if self.overlap is None else self.overlap,
            average if self.average is None else self.average,
        )

    def least_score(self, layout: str, *, own: bool) -> float:
        """Return `score` of a network that `train` made, or of another with outputs of a layout."""
        if self.score is not None:
            return self.score
        return _OWN_SCORE if own else all_layouts()[layout].least_score

    def discounts(self, *, own_events: bool) -> bool:
        """Return whether boxes of parts count less, of a network of events that `train` made, or another."""
        return self.parts == DISCOUNT or (self.parts == AUTO and own_events)

    def open_side(self, noted: tuple[int, int] | None) -> tuple[int, int]:
        """Return width and height (px) where the shapes leave them open; `noted` is what the notes say."""
        width, height = noted or (OPEN_SIDE, OPEN_SIDE)
        return self.width or width, self.height or height

    @property
    def declared_side(self) -> bool:
        """Whether the user says the size of the input."""
        return bool(self.width or self.height)


#: Width and height of an input that its file leaves open (px).
OPEN_SIDE = 640
_COLOURS = 3
