"""What pieces of tracks look like where they end and where they begin, and what that says of links.

The embeddings of one sensor are compared with each other. How much more similar one object looks than two is
learnt for each sensor from the links, by the probabilities that these have without appearance.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.association.appearance import MOST_RATIO, centred, learn_appearance
from jeat_graph.association.path_cover import Links
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.embeddings import EmbeddingArray


def link_cosines(
    embeddings: EmbeddingArray, sensor: IntArray, last: IntArray, first: IntArray, links: Links
) -> FloatArray:
    """Return the cosines (S, L) of the pieces that each link joins, for each sensor; NaN where unknown.

    Args:
        embeddings: (N, E) of the detections, NaN where there is none.
        sensor: (N,) that each is of.
        last: (P, K) detections at the end of each piece, -1 for none.
        first: (P, K) those at its beginning.
        links: between these pieces.
    """
    found = []
    for one in range(int(sensor.max(initial=-1)) + 1):
        own = np.where((sensor == one)[:, None], embeddings, np.nan)
        both = centred(np.concatenate([_means(own, last), _means(own, first)]))
        found.append(np.einsum("le,le->l", both[links.tail], both[len(last) + links.head]))
    return np.array(found).reshape(len(found), len(links.tail))


def learnt_similarity(cosine: FloatArray, probability: FloatArray) -> FloatArray:
    """Return ln of the ratio (L,) of "one object" to "two" that appearance gives links; 0: it says nothing.

    Args:
        cosine: (S, L) of each link, for each sensor.
        probability: (L,) that it joins one object, by all but its appearance.
    """
    out = np.zeros(len(probability))
    for one in cosine:
        model = learn_appearance(one, probability)
        if model is not None:
            out += model.log_ratio(one)
    return np.clip(out, -MOST_RATIO, MOST_RATIO)


def _means(embeddings: FloatArray, rows: IntArray) -> FloatArray:
    """Return the mean (P, E) of the embeddings of rows (P, K), NaN where none is known."""
    total = np.zeros((len(rows), embeddings.shape[1]))
    count = np.zeros(len(rows))
    for column in rows.T:
        found = np.where((column >= 0)[:, None], embeddings[column], np.nan)
        known = np.isfinite(found).all(axis=1)
        total[known] += found[known]
        count += known
    return np.where(count[:, None] > 0, total / np.maximum(count, 1.0)[:, None], np.nan)
