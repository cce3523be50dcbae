"""What shall be looked for in pictures and events, and where."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.masks import Masks
from jeat_graph.detection.named import AUTO, MOTION
from jeat_graph.detection.settings import DetectionSettings
from jeat_graph.io.files.addresses import is_live

if TYPE_CHECKING:
    from jeat_graph.io.events.layout import EventLayout
    from jeat_graph.io.events.trigger_times import TriggerChoice


@dataclass(frozen=True)
class DetectRequest:
    """What shall be looked for, and where.

    Attributes:
        frames: a video, a folder of pictures, an AEDAT 4 file, or a camera that is on now; or None.
        events: a file of events, or an event camera that is on now; or None.
        detector_frames: `motion`, a network with a name, an ONNX file, or `auto` (`automatic.resolved`).
        detector_events: the same.
        detector_fused: a network that looks at both at once, instead of the other two; or None.
        frame_times: edges of the events' triggers that say when frames were taken; None: as the frames say.
        embedder: what describes each box in the frames, `colour` or an ONNX file; None: nothing.
        rate_hz: frames per second where neither the video nor a table beside it says.
        event_size_px: width and height of the event camera's picture, where the file does not say.
        event_layout: columns, unit of time and recording, where the file of events leaves that open.
        events_later_s: what to add to the times of the events for the clock of the frames (s).
        one_picture: whether pictures and events must be of the same pixels, as who tracks them needs.
        settings: of the detectors.
        masks: where no vehicles are looked for, in pixels of the frames, or of the events without frames.
        duration_s: how long a camera that is on now is looked at (s); None: until somebody ends it.
        find_clock: whether a clock that is burnt into the frames is masked, too, for what finds what moves.
    """

    frames: str | Path | None = None
    events: str | Path | None = None
    detector_frames: str = MOTION
    detector_events: str = MOTION
    detector_fused: str | None = None
    embedder: str | None = None
    rate_hz: float | None = None
    frame_times: TriggerChoice | None = None
    event_size_px: tuple[int, int] | None = None
    event_layout: EventLayout | None = None
    events_later_s: float = 0.0
    one_picture: bool = False
    settings: DetectionSettings = field(default_factory=DetectionSettings)
    masks: Masks = field(default_factory=Masks)
    find_clock: bool = True
    duration_s: float | None = None

    def __post_init__(self) -> None:
        if self.frames is None and self.events is None:
            raise ConfigError("nothing to detect in: give --frames, --events or both")
        if self.frame_times is not None:
            self._check_frame_times()
        others = {self.detector_frames, self.detector_events}
        if self.detector_fused is not None and not others <= {AUTO, MOTION}:
            raise ConfigError("--detector-fused takes the place of --detector-frames and --detector-events")
        if self.embedder is not None and (self.frames is None or self.detector_fused is not None):
            raise ConfigError("--embedder describes boxes of --frames, found without --detector-fused")

    def _check_frame_times(self) -> None:
        if self.frames is None or self.events is None:
            raise ConfigError("--frame-times triggers are those of the events: give --frames and --events")
        if self.rate_hz is not None:
            raise ConfigError("--rate and --frame-times both say when frames were taken: leave one out")
        if any(map(is_live, (self.frames, self.events))):
            raise ConfigError("--frame-times is of recordings, not of cameras that are on")

    @property
    def detectors(self) -> tuple[str, ...]:
        """What looks, `sensor: name`, of networks by file the file's name."""
        if self.detector_fused is not None:
            return (f"fused: {Path(self.detector_fused).name}",)
        given = (("rgb", self.frames, self.detector_frames), ("evt", self.events, self.detector_events))
        return tuple(f"{sensor}: {Path(name).name}" for sensor, file, name in given if file is not None)

    @property
    def files(self) -> list[str]:
        """The inputs, each once."""
        return list(dict.fromkeys(str(path) for path in (self.frames, self.events) if path is not None))
