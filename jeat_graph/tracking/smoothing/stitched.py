"""Join the fragments of one vehicle among the tracks of a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.data.progress import with_progress
from jeat_graph.filters.coloured_noise import MOTION
from jeat_graph.smoothers.linking import FREEDOM, FragmentEnds, link, seeing_time
from jeat_graph.smoothers.rts import smooth_ends
from jeat_graph.smoothers.size import SmoothedSize
from jeat_graph.smoothers.track_data import TrackData
from jeat_graph.tracking.smoothing.history import TrackHistory
from jeat_graph.tracking.smoothing.observation_times import ObservationTimes
from jeat_graph.tracking.smoothing.priors import ErrorStates, size_prior_of, track_data
from jeat_graph.tracking.smoothing.sizes import SizeWindow

# Longer than this without any detection of any track, and the sensors are taken to be blind.
_LONGEST_PAUSE_S = 0.2


def stitch_histories(
    histories: Sequence[TrackHistory], scan_t: FloatArray, config: Config
) -> tuple[list[TrackHistory], int]:
    """Join histories that are most likely of one vehicle; the earliest identity names the whole.

    Args:
        histories: confirmed tracks with all their measurements, nothing smoothed or handed out yet.
        scan_t: (K,) times of all steps that the table has rows at (s), ascending.
        config: the motion model and the limits of stitching.

    Returns:
        The histories after joining, in order of identity, and the number of joints.
    """
    from scipy.stats import chi2

    if len(histories) < 2:
        return list(histories), 0
    before = link(
        fragment_ends(histories, config),
        max_gap_s=config.smoother.stitch_max_gap_s,
        gate=float(chi2.ppf(config.smoother.stitch_gate_probability, FREEDOM)),
        # How a box changes while nobody sees it, nothing tells.
        size_density=config.size.hardest_density,
        hidden_s=config.smoother.stitch_hidden_s,
    )
    after = {int(a): b for b, a in enumerate(before.tolist()) if a >= 0}
    joined = []
    for head in np.flatnonzero(before < 0).tolist():
        chain = [head]
        while chain[-1] in after:
            chain.append(after[chain[-1]])
        parts = [histories[i] for i in chain]
        joined.append(parts[0] if len(parts) == 1 else _join(parts, scan_t, config))
    return sorted(joined, key=lambda h: h.track_id), len(after)


def fragment_ends(histories: Sequence[TrackHistory], config: Config) -> FragmentEnds:
    """Smooth each history by itself and return its first and last state."""
    wholes = [history.whole() for history in with_progress(histories)]
    errors = ErrorStates.of(config)
    tracks = [track_data(rows, errors) for rows in wholes]
    states = smooth_ends(tracks)
    sizes = [_smooth_sizes(rows, config.size.rate_density) for rows in wholes]
    seen_t, seen_s = seeing_time(np.concatenate([rows["t"] for rows in wholes]), _LONGEST_PAUSE_S)
    start_mean = states.start_mean[..., :MOTION]
    start_size = np.stack([size.mean[0, :, 0] for size in sizes])
    existence, worth = zip(*[history.observed.when_last_seen() for history in histories], strict=True)
    return FragmentEnds(
        start_t=np.array([track.t[0] for track in tracks]),
        start_mean=start_mean,
        start_cov=states.start_cov[..., :MOTION, :MOTION],
        start_size=start_size,
        start_size_var=np.stack([size.cov[0, :, 0, 0] for size in sizes]),
        end_t=np.array([track.t[-1] for track in tracks]),
        end_mean=states.end_mean[..., :MOTION],
        end_cov=states.end_cov[..., :MOTION, :MOTION],
        end_size=np.stack([size.mean[-1] for size in sizes]),
        end_size_cov=np.stack([size.cov[-1] for size in sizes]),
        jerk=np.array([_typical_jerk(track) for track in tracks]),
        birth_log_density=_birth_log_density(wholes, start_mean, config),
        seen_t=seen_t,
        seen_s=seen_s,
        end_existence=np.array(existence),
        end_worth=np.array(worth),
    )


def _typical_jerk(track: TrackData) -> float:
    """Root spectral density of the jerk while the track is not seen: that of its last steps."""
    return float(np.median(track.jerk[1:][-20:])) if len(track) > 1 else 1.0


def _smooth_sizes(rows: RecordArray, density: float) -> SmoothedSize:
    window = SizeWindow(size_prior_of(rows[0]), density)
    window.append(rows[1:])
    return window.smooth()


def _birth_log_density(wholes: Sequence[RecordArray], mean: FloatArray, config: Config) -> FloatArray:
    """Density (N,) with which a new vehicle appears in the states `mean` (N, 2, 3).

    Anywhere in the picture and of any size, with the prior of a new track's velocity and acceleration.
    """
    births = np.stack([rows[0] for rows in wholes])
    volume = config.image.width * config.image.height * config.association.log_size_range**2
    out = np.full(len(wholes), -np.log(volume))
    for axis in range(2):
        for order, quantity in ((1, "velocity_var"), (2, "acceleration_var")):
            var = births[quantity][:, axis]
            out -= 0.5 * (mean[:, axis, order] ** 2 / var + np.log(2.0 * np.pi * var))
    return out


def _join(parts: Sequence[TrackHistory], scan_t: FloatArray, config: Config) -> TrackHistory:
    """One history of several in order of time, with rows at all steps in between."""
    whole = TrackHistory(parts[0].track_id, config, ErrorStates.of(config), True, parts[0].given)
    observed: list[ObservationTimes] = []
    births = [float(part.measurements[0]["t"][0]) for part in parts]
    for k, part in enumerate(parts):
        for rows in part.measurements:
            whole.add_measurements(rows)
        for name, weight in part.votes.items():
            whole.votes[name] = whole.votes.get(name, 0.0) + weight
        mine = part.observed
        if k + 1 < len(parts):
            # The earlier fragment may still have coasted when the later one was born.
            mine = mine.select(mine.t < births[k + 1])
            # What it missed after its last detection, it missed because the vehicle was hidden.
            found = np.flatnonzero(mine.used)
            last = int(found[-1]) + 1 if len(found) else 0
            unseen = ObservationTimes.unseen(mine.t[last:])
            mine = ObservationTimes.concatenate([mine.select(slice(0, last)), unseen])
            # At a low output rate a fragment may have lived between two rows.
            since = mine.t[-1] if len(mine) else births[k]
            low = int(np.searchsorted(scan_t, since, side="right"))
            high = int(np.searchsorted(scan_t, births[k + 1], side="left"))
            observed += [mine, ObservationTimes.unseen(scan_t[low:high])]
        else:
            observed.append(mine)
    whole.add_steps(ObservationTimes.concatenate(observed), True)
    return whole
