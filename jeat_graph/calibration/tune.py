"""Second stage of calibration: what matched detections cannot tell is chosen by tracking.

How far a sensor's evidence may be believed (tempering), when a track is confirmed, how long it is reported
without an update: these depend on how detections err *together*, over time and between sensors, so no
statistic of single detections gives them. A coordinate search over short grids maximises (MOTA + IDF1 +
HOTA) / 3. Each candidate is judged together with its neighbours on the grid, since the middle of a plateau
holds on other data better than the top of a peak does; and a change is made only if it wins on both halves of
the recordings: what helps one half and harms the other is chance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.calibration.cuts import folds, shorten
from jeat_graph.calibration.supervised import Recording
from jeat_graph.calibration.verdict import Verdict, better, judge, scene_error
from jeat_graph.config.schema import Config
from jeat_graph.data.errors import DataError

_TEMPERING = (0.07, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.55, 0.75, 1.0)
# A neighbour on the grid counts half as much as the candidate itself.
_NEIGHBOUR_WEIGHT = 0.5
# What a change must gain (per cent) to be made: less than this is chance.
_LEAST_GAIN = 0.1


@dataclass(frozen=True)
class TunedSetting:
    """One setting that is chosen by tracking.

    Attributes:
        name: what is set.
        values: candidates, in order.
        apply: config and value → config.
        ordered: whether neighbours in `values` are alike, so that their scores support each other.
    """

    name: str
    values: tuple[float, ...]
    apply: Callable[[Config, float], Config]
    ordered: bool = True


@dataclass(frozen=True)
class Choice:
    """What the search chose for one setting.

    Attributes:
        name: the setting.
        value: chosen.
        score: (MOTA + IDF1 + HOTA) / 3 with it, at that moment of the search (per cent).
    """

    name: str
    value: float
    score: float


def tune(
    config: Config,
    recordings: Sequence[Recording],
    *,
    passes: int = 2,
    max_scans: int = 6000,
    progress: Callable[[str], None] | None = None,
) -> tuple[Config, tuple[Choice, ...]]:
    """Choose the settings of `tuned_settings` by tracking recordings with known truth.

    Args:
        config: calibrated from matched detections; where the search starts.
        recordings: detections and truth; their metrics are pooled.
        passes: how often all settings are gone through.
        max_scans: recordings are cut so that they hold about this many scans in all.
        progress: called with the name of each setting when it is done.

    Returns:
        The configuration, and the last choice made for each setting.

    Raises:
        DataError: no recording.
    """
    if not recordings:
        raise DataError("tuning needs at least one recording with truth")
    parts = folds(shorten(recordings, max_scans))
    scatter = scene_error(recordings)
    known: dict[str, Verdict] = {}

    def verdict(candidate: Config) -> Verdict:
        key = repr(candidate)
        if key not in known:
            known[key] = replace(judge([candidate] * len(parts), parts), scene_error=scatter)
        return known[key]

    chosen: dict[str, Choice] = {}
    for _ in range(passes):
        before = config
        for setting in tuned_settings(config):
            config, choice = _choose_value(setting, config, verdict)
            if choice is not None:
                chosen[setting.name] = choice
            if progress is not None:
                progress(setting.name)
        if config == before:
            break
    if len(config.sensors) > 1:
        chosen.pop("tempering", None)  # each sensor's own has taken its place
    return config, tuple(chosen.values())


def tuned_settings(config: Config) -> list[TunedSetting]:
    """List the settings that are tuned, those first on which most depends.

    Args:
        config: names the sensors and their rates.
    """
    out = [
        TunedSetting(
            "output.max_gap_scans",
            # Half a period: only what was updated just now.
            (0.5, 1.5, 3.0),
            lambda c, v: replace(c, output=replace(c.output, max_gap_scans=v)),
            ordered=False,
        ),
        TunedSetting("tempering", _TEMPERING, _temper_all),
        TunedSetting(
            "standing.enabled",
            (1.0, 0.0),
            lambda c, v: replace(c, standing=replace(c.standing, enabled=bool(v))),
            ordered=False,
        ),
        TunedSetting(
            "lifecycle.confirm_existence",
            (0.3, 0.5, 0.7, 0.85, 0.95),
            lambda c, v: replace(c, lifecycle=replace(c.lifecycle, confirm_existence=v)),
        ),
        TunedSetting(
            "lifecycle.hidden_prior",
            (0.0, 0.05, 0.1),
            lambda c, v: replace(c, lifecycle=replace(c.lifecycle, hidden_prior=v)),
        ),
        TunedSetting(
            "lifecycle.p_detect_weight",
            (0.02, 0.05, 0.1),
            lambda c, v: replace(c, lifecycle=replace(c.lifecycle, p_detect_weight=v)),
        ),
    ]
    out.append(
        TunedSetting(
            "birth.max_overlap",
            (0.3, 0.5, 0.7),
            lambda c, v: replace(c, birth=replace(c.birth, max_overlap=v)),
        )
    )
    if len(config.sensors) > 1:
        out.append(
            TunedSetting(
                "lifecycle.disagreement",
                (0.0, 2.0, 5.0, 10.0),
                lambda c, v: replace(c, lifecycle=replace(c.lifecycle, disagreement=v)),
            )
        )
        out += [
            TunedSetting(f"sensors.{n}.tempering", _TEMPERING, _temper_one(n)) for n in config.sensor_names
        ]
    return out


def plateau(scores: Sequence[float]) -> list[float]:
    """Average each score with its neighbours on the grid, which count half; the ends have one neighbour."""
    s = np.asarray(scores, dtype=np.float64)
    total, weight = s.copy(), np.ones(len(s))
    total[1:] += _NEIGHBOUR_WEIGHT * s[:-1]
    weight[1:] += _NEIGHBOUR_WEIGHT
    total[:-1] += _NEIGHBOUR_WEIGHT * s[1:]
    weight[:-1] += _NEIGHBOUR_WEIGHT
    return [float(v) for v in total / weight]


def _choose_value(
    setting: TunedSetting, config: Config, verdict: Callable[[Config], Verdict]
) -> tuple[Config, Choice | None]:
    """Choose the best value of one setting; the present setting stays where nothing is better.

    The choice is None where the present setting, kept, is none of the setting's values.
    """
    candidates = [setting.apply(config, value) for value in setting.values]
    verdicts = [verdict(candidate) for candidate in candidates]
    scores = [one.mean for one in verdicts]
    stable = plateau(scores) if setting.ordered else scores
    best = int(np.argmax(stable))
    here = candidates.index(config) if config in candidates else None
    now = verdict(config)
    gain = stable[best] - (now.mean if here is None else stable[here])
    if gain < _LEAST_GAIN or not better(verdicts[best], now, _LEAST_GAIN):
        if here is None:
            return config, None
        best = here
    return candidates[best], Choice(setting.name, setting.values[best], scores[best])


def _temper_all(config: Config, value: float) -> Config:
    sensors = {name: replace(s, tempering=value) for name, s in config.sensors.items()}
    return replace(config, sensors=sensors)


def _temper_one(name: str) -> Callable[[Config, float], Config]:
    def apply(config: Config, value: float) -> Config:
        return replace(
            config, sensors=config.sensors | {name: replace(config.sensors[name], tempering=value)}
        )

    return apply
