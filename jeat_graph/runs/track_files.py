"""Files of detections in, a run directory out: what `track` does once, and `batch` for each recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from jeat_graph.runs.beside import Facts, facts_beside, facts_of_frames, with_picture
from jeat_graph.runs.inputs import check_distinct, describe_inputs
from jeat_graph.runs.run_options import RunOptions, RunRecord
from jeat_graph.runs.tracking_run import write_run

if TYPE_CHECKING:
    from jeat_graph.config.schema import Config
    from jeat_graph.io.tables.sensor_columns import Declared


@dataclass(frozen=True)
class TrackRequest:
    """What shall be tracked, and how.

    Attributes:
        detections: files of one scene, say one a sensor; `NAME=path` names a sensor.
        out: the run directory.
        config: name of a preset or path of a YAML file.
        overrides: `key=value` texts over it.
        rate_hz: frame rate of files that count frames, or None.
        input_format: format of the files if it shall not be recognised.
        score_scale: how their scores are to be read, see `read_detections`.
        images: COCO data set with the times of COCO results, or None.
        time_unit: unit of the column `t`, of `data.time_units`.
        classes: classes of detections to be taken, and those without one; None takes all.
        first_frame: number of the first frame of files that count frames, or None for the usual rule.
        video: the one that is read of a file's several videos, or None.
        class_names: names of classes that files number, as `io.tables.class_names` takes them from a command.
        image: size of the picture (px) for boxes in shares of it; None for that of the configuration.
        frames: pictures that tell the picture's size and the frame rate, or None.
        rig: file with the pictures and clocks of the sensors, or None.
        identities: file of tracks that a person has corrected, for the smoothed table to follow; or None.
        detectors: what made the detections, `sensor: name` or a file's name; for the record.
        options: how the run is written.
    """

    detections: tuple[str, ...]
    out: str
    config: str = "default"
    overrides: tuple[str, ...] = ()
    rate_hz: float | None = None
    input_format: str | None = None
    score_scale: str = "unit"
    images: str | None = None
    time_unit: str = "s"
    classes: tuple[str, ...] | None = None
    first_frame: int | None = None
    video: str | None = None
    class_names: str | None = None
    image: tuple[float, float] | None = None
    frames: str | None = None
    rig: str | None = None
    identities: str | None = None
    detectors: tuple[str, ...] = ()
    options: RunOptions = field(default_factory=RunOptions)

    @property
    def files(self) -> list[str]:
        """Paths of the detections, without the sensors' names."""
        from jeat_graph.io.tables.detections_io import split_name

        return [str(split_name(item)[1]) for item in self.detections]

    @property
    def all_files(self) -> list[str]:
        """Paths of the detections and of the corrected identities."""
        return [*self.files, *([] if self.identities is None else [self.identities])]

    def with_facts(self) -> tuple[TrackRequest, Facts | None]:
        """Complete the frame rate by what files beside the detections say, and return what they say.

        Raises:
            DataError: a file cannot be read.
        """
        if self.frames is None:
            return self, facts_beside(self.files)
        facts = facts_of_frames(self.frames)
        beside = facts_beside(self.files)
        if self.rate_hz is not None or (beside is not None and beside.rate_hz is not None):
            return self, facts
        return replace(self, rate_hz=facts.rate_hz), facts

    def declared(self) -> Declared:
        """Return what the detections' own tables say of their detectors (`sensor_columns`).

        Nothing where the configuration is not one that takes it.

        Raises:
            DataError: a table cannot be read, or says two things of one sensor.
        """
        from jeat_graph.io.tables.detections_io import split_name
        from jeat_graph.io.tables.sensor_columns import declared_by_all, takes_declared

        return declared_by_all(map(split_name, self.detections)) if takes_declared(self.config) else {}

    def configured(self) -> tuple[Config, list[str]]:
        """Load the configuration, with what the detections say, and what files beside them say.

        Returns:
            The configuration, and a line for each thing that was found out.

        Raises:
            ConfigError: it is not valid.
            DataError: a file cannot be read.
        """
        from jeat_graph.config.reading import load_config
        from jeat_graph.io.tables.sensor_columns import as_settings

        declared = self.declared()
        notes = [
            f"sensor {name!r}: {_words(keys)}, as the detections say (--set sensors.{name}.… otherwise)"
            for name, keys in declared.items()
            if not self.detectors  # what has just detected has said it
        ]
        config = load_config(self.config, [*as_settings(declared), *self.overrides], self.rig)
        if self.rig is not None and config.input.picture == "given":
            return config, notes  # the frames are one sensor's picture
        config, more = with_picture(config, self.overrides, self.with_facts()[1])
        return config, [*notes, *more]

    def load_config(self) -> Config:
        """Return the configuration as `configured` does, alone."""
        return self.configured()[0]

    def source(self) -> dict[str, Any]:
        """Describe the inputs as `run.json` has them.

        Raises:
            DataError: a file cannot be read.
        """
        return {
            "config_name": self.config,
            "overrides": list(self.overrides),
            "inputs": describe_inputs(self.files),
            "reading": {"detections": list(self.detections), **self._reading()},
            **({} if self.images is None else {"images": describe_inputs([self.images])[0]}),
            **({} if self.rig is None else {"rig": describe_inputs([self.rig])[0]}),
            **({} if self.identities is None else {"identities": describe_inputs([self.identities])}),
            **({"detectors": list(self.detectors)} if self.detectors else {}),
        }

    def following(self, config: Config) -> tuple[Config, TrackRequest]:
        """Return the configuration, and the request with the corrected identities, that go along these.

        Raises:
            ConfigError: there is no smoother, or the engine takes no identities.
            DataError: the file cannot be read.
        """
        from jeat_graph.data.errors import ConfigError
        from jeat_graph.data.tables.reading import Reading
        from jeat_graph.io.tables.corrected_io import read_corrected

        if self.identities is None:
            return config, self
        if config.smoother.engine == "none" or config.tracker.engine == "paper":
            lacking = "smoother.engine=none" if config.smoother.engine == "none" else "tracker.engine=paper"
            raise ConfigError(f"--identities does not go with {lacking}: nothing smooths along them")
        # Its times are seconds, and its frames count as its format does, however the detections' do.
        how = Reading(rate_hz=self.rate_hz, image=self.image, images=self.images)
        options = replace(self.options, corrected=read_corrected(self.identities, how))
        config = replace(config, smoother=replace(config.smoother, identities="whole"))
        return config, replace(self, options=options)

    def _reading(self) -> dict[str, Any]:
        more = {
            "classes": None if self.classes is None else list(self.classes),
            "first_frame": self.first_frame,
            "video": self.video,
            "class_names": self.class_names,
            "image": self.image,
        }
        return {
            "rate_hz": self.rate_hz,
            "fmt": self.input_format,
            "score_scale": self.score_scale,
            "images": self.images,
            "time_unit": self.time_unit,
            **{name: value for name, value in more.items() if value is not None},
        }


def _words(keys: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in keys.items())


def track_files(
    request: TrackRequest,
    warn: Callable[[str], object] = lambda _: None,
    say: Callable[[str], object] = lambda _: None,
) -> RunRecord:
    """Read, check, track, and write the run directory; the folder is as it was if that fails.

    Args:
        request: what to do.
        warn: called with each warning about the input before the tracking begins.
        say: called with each thing that was found out, such as the picture's size.

    Returns:
        What `run.json` says of the run.

    Raises:
        JeatGraphError: the configuration or a file is not valid, or they do not fit together.
    """
    from jeat_graph.io.formats.registry import recognise
    from jeat_graph.io.tables.detections_io import of_class_in, read_many_counted
    from jeat_graph.rig.common_picture import in_common, recorded_ways
    from jeat_graph.runs.clock_pass import find_clocks
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.directory import RunDirectory
    from jeat_graph.runs.input_checks import check_detections, check_units
    from jeat_graph.runs.latency import at_measurement

    begin = time.perf_counter()
    config, notes = request.configured()
    check_distinct(request.detections)
    directory = RunDirectory(request.out, inputs=request.all_files)
    config, request = request.with_facts()[0].following(config)
    if config.input.picture == "given" and any(recognise(path).in_shares for path in request.files):
        request = replace(request, image=(config.image.width, config.image.height))
    for note in notes:
        say(note)
    how = request._reading()
    classes = how.pop("classes", None)
    detections, counted = read_many_counted(request.detections, **how)
    names = " + ".join(request.files)
    ways = {name: one for name, one in recorded_ways(config).items() if name in detections.sensors}
    detections, config, notes = in_common(detections, config)
    for note in notes:
        say(note)
    detections, clocks, notes = find_clocks(detections, config, names)
    for note in notes:
        say(note)
    check_units(detections, config, names)  # before rates are taken for what they seem
    config, notes = fit_input(config, detections)
    for note in notes:
        say(note)
    if classes is not None:  # the picture is as large as the boxes of all classes reach
        detections = of_class_in(detections, classes, request.files[0])
    found = {"ways": ways, "clocks": clocks}
    source = request.source() | {name: one for name, one in found.items() if one}
    if counted is not None:
        source["frames"] = {key: getattr(counted, key) for key in ("first", "lowest", "highest", "fixed")}
    record = RunRecord(source=source, warnings=check_detections(detections, config, names))
    for warning in record.warnings:
        warn(warning)
    detections = at_measurement(detections, config)
    record.timings["read_s"] = round(time.perf_counter() - begin, 4)
    record.counts = {"scans": detections.num_scans, "detections": len(detections)}
    with directory:
        write_run(detections, config, directory, record, request.options)
    return record
