"""Settings of a training: the network, what it is shown, and how it learns."""

from __future__ import annotations

from dataclasses import dataclass, field

from jeat_graph.config.fields import Section, choice, flag, number
from jeat_graph.data.errors import ConfigError

FRAMES, EVENTS, FUSED = "frames", "events", "fused"
KINDS = (FRAMES, EVENTS, FUSED)
FLOAT32, BFLOAT16 = "float32", "bfloat16"
#: Channels of the first layer by the name of a size.
WIDTHS = {"tiny": 8, "small": 16, "medium": 32, "large": 48}
#: Data sets with boxes as arrays, by the names of their classes' numbers.
LABEL_SETS = ("gen1", "1mpx", "etram")
#: Channels of a picture: red, green, blue.
COLOURS = 3
#: What of a network that another starts from stays as it is.
HOLD_NOTHING, HOLD_FIRST, HOLD_BOXES = "nothing", "first", "boxes"
#: What a memory's forgetting goes by.
BY_WINDOWS, BY_TIME = "windows", "time"


@dataclass(frozen=True)
class NetSettings(Section):
    """What a network looks like."""

    kind: str = choice(FRAMES, KINDS, "what it looks at; one that sees events has a memory")
    width: int = number(32, "1", "channels of its first layer; the others follow", 2, 512)
    bins: int = number(10, "1", "bins of a window of events; each has two polarities", 1, 100)
    bin_s: float = number(0.005, "s", "length of a bin", 1e-4, 1.0)

    memory_keep: float = number(
        0.8,
        "1",
        "share of a memory by windows that is left at the next one: what learned from short sequences would "
        "drift in long ones",
        0.0,
        1.0,
    )
    memory: str = choice(
        BY_WINDOWS,
        (BY_WINDOWS, BY_TIME),
        "what forgetting goes by; windows: memory_keep; time: each channel of what is remembered of events "
        "has a time constant of its own, which is learnt, changes only where events come, and leaky counts "
        "of 0.1, 0.5 and 2 s are shown beside the bins",
    )

    spreads: bool = flag(True, "whether it says, beside each box, how far off each of its sides may be")

    @property
    def channels(self) -> int:
        """Channels of the input; of one that sees both those of its events."""
        return COLOURS if self.kind == FRAMES else 2 * self.bins

    @property
    def has_memory(self) -> bool:
        """Whether states are carried from window to window."""
        return self.kind != FRAMES

    @property
    def by_time(self) -> bool:
        """Whether what is remembered of events lasts by time."""
        return self.has_memory and self.memory == BY_TIME


@dataclass(frozen=True)
class PictureChanges(Section):
    """How pictures are changed so that the network sees more than there is."""

    mirror_share: float = number(0.5, "1", "so many are mirrored", 0.0, 1.0)
    zoom: float = number(1.6, "1", "sizes are drawn from 1/zoom to zoom, evenly in the logarithm", 1.0, 8.0)
    on_box_share: float = number(
        0.7, "1", "so many cut-outs lie about a vehicle, the others anywhere", 0.0, 1.0
    )
    exposure: float = number(1.8, "1", "light is multiplied by 1/exposure to exposure", 1.0, 16.0)
    gamma: float = number(1.3, "1", "and put to a power of 1/gamma to gamma", 1.0, 4.0)
    grey_share: float = number(
        0.2, "1", "so many lose their colours, as a camera without them sees", 0.0, 1.0
    )
    noise: float = number(8.0, "grey levels", "noise of up to this deviation is added", 0.0, 128.0)
    clutter_share: float = number(
        0.0,
        "1",
        "in so many shapes that are no vehicles are drawn beside the vehicles, where data show little else",
        0.0,
        1.0,
    )


@dataclass(frozen=True)
class EventChanges(Section):
    """How events are changed so that the network sees more than there is."""

    mirror_share: float = number(0.5, "1", "so many sequences are mirrored", 0.0, 1.0)
    zoom: float = number(1.4, "1", "sizes are drawn from 1/zoom to zoom, evenly in the logarithm", 1.0, 8.0)
    on_box_share: float = number(
        0.7, "1", "so many cut-outs lie about a vehicle, the others anywhere", 0.0, 1.0
    )
    drop_share: float = number(0.5, "1", "up to this share of the events is left out", 0.0, 0.99)
    time_scale: float = number(1.4, "1", "time runs slower or faster by up to this", 1.0, 4.0)
    noise_hz_px: float = number(0.2, "Hz/px", "up to so many events from nowhere are added", 0.0, 100.0)
    swap_share: float = number(
        0.0,
        "1",
        "so many have darker and brighter exchanged, as dark and bright vehicles have",
        0.0,
        1.0,
    )
    hot_pixels: int = number(0, "pixels", "up to so many pixels fire all the time", 0, 10_000)
    lamps: int = number(0, "lamps", "up to so many lamps flicker, at 100 or 120 Hz", 0, 1000)


@dataclass(frozen=True)
class FusedChanges(Section):
    """How what a network of both sensors is shown lacks one of them, so that it learns to do without."""

    no_picture_share: float = number(0.1, "1", "so many sequences have no picture", 0.0, 1.0)
    no_events_share: float = number(0.1, "1", "so many, of the others, have no events", 0.0, 1.0)
    stale_share: float = number(0.3, "1", "in so many the pictures come late", 0.0, 1.0)
    stale_s: float = number(0.15, "s", "by up to so much", 0.0, 10.0)
    hold_pictures: bool = flag(
        False,
        "whether what was taken from a network of pictures stays as it is: only events, and how both are "
        "summed, are learned, and little data of both do not spoil what much data of pictures have taught",
    )


@dataclass(frozen=True)
class LabelSettings(Section):
    """How the labels of Prophesee's data sets and of eTraM are read."""

    classes: str = choice(
        "auto",
        ("auto", *LABEL_SETS),
        "what the numbers of classes mean; auto: as label_map_dictionary.json says, and of 304 x 240 px gen1",
    )
    usual_filter: bool = flag(
        False,
        "whether what the sets' own evaluation leaves out is neither asked for nor wrong: the first 0.5 s, "
        "and boxes with a diagonal below 60 px or a side below 20 px (gen1: 30 px, 10 px)",
    )
    moving_only: bool = flag(
        False,
        "whether vehicles that have hardly moved (least_way_px) are neither asked for nor wrong: where the "
        "camera stands still they leave no events (eTraM); labels must come at least four times a second",
    )


@dataclass(frozen=True)
class TrainSettings(Section):
    """How a network learns."""

    crop_px: tuple[int, int] = (320, 192)
    batch: int = number(8, "1", "cut-outs, or sequences, a step", 1, 4096)
    epochs: float = number(
        30.0, "1", "times that all pictures, or as much time of events, are seen", open_low=True
    )
    minutes: float | None = number(None, "min", "train for so long instead of `epochs`", open_low=True)
    precision: str = choice(
        FLOAT32,
        (FLOAT32, BFLOAT16),
        "of the layers while learning; bfloat16 halves the time where the processor has AVX512-BF16 or AMX",
    )
    seed: int = number(0, "1", "of first weights, order and changes", 0, 2**31)
    learning_rate: float = number(2e-3, "1", "the highest, of AdamW", 0.0, 1.0, open_low=True)
    memory_rate: float = number(
        50.0,
        "1",
        "times that rate for how long a memory by time lasts and where it may change, which begin far from "
        "where they must get",
        0.0,
        1000.0,
        open_low=True,
    )
    final_share: float = number(0.02, "1", "share of it at the end of the cosine", 0.0, 1.0)
    warm_up_share: float = number(0.03, "1", "share of the training in which the rate rises", 0.0, 0.5)
    settled_share: float = number(
        0.4,
        "1",
        "share of the training, its last part, in which layers are normalised as in use: by what was seen on "
        "the way, not by the few cut-outs of a step, whose light may be of all kinds",
        0.0,
        1.0,
    )
    weight_decay: float = number(0.02, "1", "of AdamW", 0.0, 1.0)
    box_weight: float = number(
        2.5, "1", "what boxes that do not fit cost beside scores that are wrong", 0.0, open_low=True
    )
    by_segment: bool = flag(
        False,
        "whether each segment of pictures is shown equally often, not each picture: worlds of many pictures, "
        "which are very similar, do not outweigh those of few",
    )
    hold: str = choice(
        HOLD_NOTHING,
        (HOLD_NOTHING, HOLD_FIRST, HOLD_BOXES),
        "what stays as it is in the start; first: the layers up to the finest level (4 px), so that a step "
        "takes half of the time, and what is learned is what to remember; boxes: all but how far off sides "
        "may be",
    )
    second_look: bool = flag(
        False,
        "whether the finished network looks twice, the second time at half the size, for vehicles that are "
        "large in its input",
    )
    clip: float = number(10.0, "1", "longest gradient", open_low=True)
    average_steps: float = number(500.0, "1", "steps that the averaged weights go back", 1.0)
    kept_mb: float = number(2000.0, "MB", "so much of the pictures is kept in memory once it was read")
    steps: int = number(8, "1", "windows of a sequence of events", 1, 1000)
    back: int = number(4, "1", "windows through which a gradient goes back", 1, 1000)
    stream_share: float = number(
        0.0,
        "1",
        "share of a step's sequences that go on where those of the step before ended, with what is "
        "remembered; the others start over",
        0.0,
        1.0,
    )
    stream_steps: int = number(8, "1", "steps for which such a one goes on", 1, 1000)
    least_step_bins: int = number(2, "bins", "shortest step from window to window (10 ms)", 1, 1000)
    most_step_bins: int = number(10, "bins", "longest (50 ms)", 1, 1000)
    least_way_px: float = number(
        1.0, "px", "who has gone less since a sequence began left hardly an event and is not asked for"
    )
    far_px: float | None = number(
        None,
        "px",
        "learn also those vehicles that the truth leaves out, as far ones are, where a third of them is seen "
        "and width and height have so much; judged is by the truth",
        open_low=True,
    )
    judge_every: float = number(
        0.1, "1", "share of the training between two looks at what it has learned", 0.001, 1.0
    )
    judged: int = number(300, "1", "at most so many pictures or windows are judged then", 1)
    pictures: PictureChanges = field(default_factory=PictureChanges)
    events: EventChanges = field(default_factory=EventChanges)
    fused: FusedChanges = field(default_factory=FusedChanges)
    labels: LabelSettings = field(default_factory=LabelSettings)

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(side % COARSEST or side < COARSEST for side in self.crop_px):
            raise ConfigError(f"crop_px: {self.crop_px} must be whole multiples of {COARSEST} px")
        if self.least_step_bins > self.most_step_bins:
            raise ConfigError("least_step_bins: must not be more than most_step_bins")


#: Strides at which vehicles are looked for (px): half of those far away are smaller than 12 px.
STRIDES = (4, 8, 16)
COARSEST = STRIDES[-1]


def padded(size_px: tuple[int, int]) -> tuple[int, int]:
    """Return the smallest width and height (px) that the network takes and that hold a picture."""
    width, height = (-(-side // COARSEST) * COARSEST for side in size_px)
    return width, height
