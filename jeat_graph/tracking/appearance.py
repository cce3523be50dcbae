"""What living tracks look like, by the embeddings of their detections, and how much that tells them apart.

A track is remembered, for each sensor, by the fading mean of the embeddings that it took in; a detection is
compared with it by the cosine between them. What a cosine is worth is learnt from the stream itself: cosines
between tracks and the detections they took, and between tracks and what others took, are held to be normal,
with means of their own and one variance. The logarithm of their likelihood ratio is then linear in the
cosine (Fisher, "The use of multiple measurements in taxonomic problems", Annals of Eugenics 7, 1936).
Embeddings that tell nothing come to count for nothing.

The ratio speaks for one vehicle against another. It says nothing of false boxes, which look similar too: so
it decides who takes a detection, and not whether there is a vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.embeddings import EmbeddingArray, join_embeddings
from jeat_graph.data.errors import DataError
from jeat_graph.data.scan import Scan
from jeat_graph.tracking.by_track import carried_over, places

_KEPT = 0.9  # of a track's mean from one detection to the next
# Before anything was seen, cosines of one vehicle and of two are the same: this many of each, spread so
# widely.
_PRIOR_WEIGHT, _PRIOR_STD = 20.0, 0.2
_MOST_WEIGHT = 4096.0  # of cosines that are remembered; then all count half
_SAME, _OTHER = 0, 1


class Appearances(NamedTuple):
    """What has been seen so far. Its arrays are never written to: a step makes others.

    Attributes:
        track_id: (N,) the living tracks, ascending.
        mean: (N, S, E) what each looks like to each sensor; 0 where it has not been seen.
        moments: (S, 2, 3) weight, sum and sum of squares of the cosines of one vehicle and of two.
    """

    track_id: IntArray
    mean: FloatArray
    moments: FloatArray

    @staticmethod
    def start(num_sensors: int, numbers: int) -> Appearances:
        """Return what is known before the first embedding of so many numbers."""
        none = np.zeros(0, dtype=np.int64)
        return Appearances(none, np.zeros((0, num_sensors, numbers)), np.zeros((num_sensors, 2, 3)))

    def of(self, living: IntArray) -> Appearances:
        """Return the same of the tracks that live now (N,), ascending."""
        if np.array_equal(living, self.track_id):
            return self
        living = living.copy()
        return Appearances(living, carried_over(self.mean, self.track_id, living), self.moments)

    def of_track(self, identity: int) -> FloatArray | None:
        """Return what a track looks like (E,), the mean over the sensors that have seen it; or None."""
        seen = self.mean[self.track_id == identity].reshape(-1, self.mean.shape[2])
        seen = seen[seen.any(axis=1)]
        return seen.mean(axis=0) if len(seen) else None

    def among(self, num_sensors: int) -> Appearances:
        """Return the same where there are more sensors, which have seen nothing yet."""
        more = num_sensors - len(self.moments)
        if not more:
            return self
        mean = np.pad(self.mean, ((0, 0), (0, more), (0, 0)))
        return Appearances(self.track_id, mean, np.pad(self.moments, ((0, more), (0, 0), (0, 0))))

    def ratio(self) -> tuple[FloatArray, FloatArray]:
        """Return the slope (S,) of ln of the likelihood ratio over the cosine, and where (S,) that is 0."""
        weight, total, squares = np.moveaxis(self.moments, -1, 0)  # (S, 2) each
        both = weight.sum(axis=1, keepdims=True)
        middle = total.sum(axis=1, keepdims=True) / np.maximum(both, 1.0)
        mean = (total + _PRIOR_WEIGHT * middle) / (weight + _PRIOR_WEIGHT)
        within = squares - total**2 / np.maximum(weight, 1.0)
        var = (within.sum(axis=1) + _PRIOR_WEIGHT * _PRIOR_STD**2) / (both[:, 0] + _PRIOR_WEIGHT)
        return np.maximum(mean[:, _SAME] - mean[:, _OTHER], 0.0) / var, mean.mean(axis=1)


class Compared(NamedTuple):
    """The detections of one time beside the tracks before it.

    Attributes:
        appearance: of these tracks.
        embeddings: (M, E) of the detections; 0 where there is none.
        sensor: (M,) their sensors.
        cosine: (N, M) of each pair, NaN where one of both is unknown.
        log_ratio: (N, M) ln of the likelihood ratio, 0 where it is unknown.
    """

    appearance: Appearances
    embeddings: FloatArray
    sensor: IntArray
    cosine: FloatArray
    log_ratio: FloatArray


def embeddings_of(appearance: Appearances | None, batch: Sequence[Scan]) -> EmbeddingArray | None:
    """Return the embeddings (M, E) of the detections of a batch, None if none has any.

    Raises:
        DataError: they have more or fewer numbers than those before.
    """
    found = join_embeddings([scan.embeddings for scan in batch], [len(scan) for scan in batch])
    if found is None or appearance is None or found.shape[1] == appearance.mean.shape[2]:
        return found
    before = appearance.mean.shape[2]
    raise DataError(f"embeddings must have {before} numbers as those before, not {found.shape[1]}")


def compare(appearance: Appearances, embeddings: EmbeddingArray, sensor: IntArray, most: float) -> Compared:
    """Compare detections with the living tracks.

    Args:
        appearance: of these tracks.
        embeddings: (M, E) of unit length, NaN where there is none.
        sensor: (M,) sensor index of each.
        most: greatest absolute value of ln of the ratio.
    """
    found = np.nan_to_num(embeddings.astype(np.float64))
    length = np.sqrt(np.einsum("nse,nse->ns", appearance.mean, appearance.mean))[:, sensor]
    known = (length > 0.0) & found.any(axis=1)
    cosine = np.full(known.shape, np.nan)
    for s in np.unique(sensor):
        columns = sensor == s
        cosine[:, columns] = appearance.mean[:, s] @ found[columns].T
    cosine = np.where(known, cosine / np.where(known, length, 1.0), np.nan)
    slope, middle = appearance.ratio()
    ratio = np.where(known, slope[sensor] * (np.where(known, cosine, 0.0) - middle[sensor]), 0.0)
    return Compared(appearance, found, sensor, cosine, np.clip(ratio, -most, most))


def remember(compared: Compared, assigned: IntArray, detection: IntArray, living: IntArray) -> Appearances:
    """Return what is known after a step.

    Args:
        compared: its detections beside the tracks before it.
        assigned: (K,) tracks that took a detection each.
        detection: (K,) its index among all.
        living: (N,) the tracks after it, ascending.
    """
    now = compared.appearance.of(living)
    mean, found = now.mean.copy(), compared.embeddings
    row, there = places(assigned, living)
    use = np.flatnonzero(there & found[detection].any(axis=1))
    row, used = row[use], detection[use]
    sensor = compared.sensor[used]
    known: BoolArray = np.any(mean[row, sensor], axis=1, keepdims=True)
    mean[row, sensor] = np.where(known, _KEPT * mean[row, sensor] + (1.0 - _KEPT) * found[used], found[used])
    return Appearances(now.track_id, mean, _learnt(compared, assigned, detection))


def _learnt(compared: Compared, assigned: IntArray, detection: IntArray) -> FloatArray:
    """The moments with this step's cosines; all tracks that did not take a detection weigh as one."""
    moments = compared.appearance.moments.copy()
    row, there = places(assigned, compared.appearance.track_id)
    row, detection = row[there], detection[there]
    place = np.arange(len(row))
    cosine = compared.cosine[:, detection]
    same = cosine[row, place]
    cosine[row, place] = np.nan
    number = np.maximum((~np.isnan(cosine)).sum(axis=0), 1)
    others = np.stack([np.nansum(cosine, axis=0) / number, np.nansum(cosine**2, axis=0) / number], axis=-1)
    known = ~np.isnan(same)
    alone = np.isnan(cosine).all(axis=0)
    s = compared.sensor[detection]
    one = np.ones(len(same))
    np.add.at(moments[:, _SAME], s[known], np.column_stack([one, same, same**2])[known])
    np.add.at(moments[:, _OTHER], s[~alone], np.column_stack([one, others])[~alone])
    full = moments[:, :, 0].max(axis=1) > _MOST_WEIGHT
    moments[full] *= 0.5
    return moments
