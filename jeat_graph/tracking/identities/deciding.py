"""Who is who in a recording, decided with all of it in view.

passes → pieces on which they agree → ln p(joined)/p(apart) of each pair → best path cover → identities
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.association import agreement
from jeat_graph.association.linking import TERMS, Joined, Past, Pieces, join
from jeat_graph.association.path_cover import Links, chains, preferring, sampled_covers, shares
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.embeddings import EmbeddingArray
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.joining import LearntScene, MeasuredBoxes, beginnings_of, ends_of, log_ratio
from jeat_graph.tracking.identities.passes import Pass
from jeat_graph.tracking.identities.piece_appearance import learnt_similarity, link_cosines

#: Share of the passes that make a link, from which on it stands.
AGREED = 0.8
#: Longest gap that identities are joined over (s).
LONGEST_GAP_S = 10.0
#: A piece is left out of the cover whose posterior is less than this, in log odds.
LEAST_LOG_ODDS = 0.0
#: A piece of fewer detections goes with its causal track: what joins it tells next to nothing. Measured.
LEAST_DETECTIONS = 10
#: Parts of covers that lose less than this (nats) are taken as the causal identities have them. Measured.
TIE = 3.0
# Posteriors are kept from 0 and 1.
_LEAST = 0.005
# Detections at the end of a piece that its state there is estimated from.
_HITS = 30
# Pairs of pieces that could be one object: distance (sizes, and sizes/s of the gap), difference of ln size.
_REACH, _REACH_PER_S, _MOST_LOG_SIZE = 1.0, 4.0, 1.5
# Less gain is no link, before births, gaps and votes count; causal ones stay, and gain at least the second.
_LEAST_RATIO, _LEAST_CAUSAL = -12.0, -30.0
# Less gain is not drawn.
_LEAST_DRAWN = -8.0
# A box lies at the rim of the picture that is nearer to the edge than so much of its size.
_RIM = 0.5
_SAMPLES, _SWEEPS = 200, 10
# Covers are drawn with probabilities that go as exp(gain / this): gains are too sure by as much. Measured.
_OVERCONFIDENCE = 2.0


class SoFar(NamedTuple):
    """What was decided of a recording before the pieces that are to be joined.

    Attributes:
        decided: (P,) pieces whose beginning is: nothing precedes them.
        past: of those that are in view no more.
        begun: time of the first scan (s).
        times: how many times of scans there have been.
    """

    decided: BoolArray
    past: Past
    begun: float
    times: int


class Recording(NamedTuple):
    """What is known of the detections of a recording, in order of time.

    Attributes:
        measured: the detections.
        scan_t: (T,) all times of scans (s).
        scene: what was learnt of the scene.
        embeddings: (N, V) what each looks like, NaN where that is not known; None where none has any.
    """

    measured: MeasuredBoxes
    scan_t: FloatArray
    scene: LearntScene
    embeddings: EmbeddingArray | None = None


@dataclass(frozen=True, eq=False)
class IdentityDecision:
    """Who is who.

    Attributes:
        owner: (N,) identity of each detection, 0 of those that are nobody's.
        causal: (N,) identity that the causal pass gave each.
        probability: (N,) that the detection is of the object that its identity is mostly of.
        tail, head: (K,) detections that the cover joins.
        log_ratio: (K,) ln p(joined)/p(apart).
        joined: (K,) probability.
        terms: (K, 6) what `log_ratio` is the sum of, in the order of `linking.TERMS`.
    """

    owner: IntArray
    causal: IntArray
    probability: FloatArray
    tail: IntArray
    head: IntArray
    log_ratio: FloatArray
    joined: FloatArray
    terms: FloatArray

    @classmethod
    def without_links(cls, owner: IntArray, causal: IntArray) -> IdentityDecision:
        """Return a decision that joins nothing and is sure of it.

        Args:
            owner: (N,) identity of each detection.
            causal: (N,) the causal one.
        """
        nothing, none = np.zeros(0), np.zeros(0, dtype=np.int64)
        sure, no_terms = np.ones(len(owner)), np.zeros((0, len(TERMS)))
        return cls(owner, causal, sure, none, none, nothing, nothing, no_terms)


class BestChains(NamedTuple):
    """The best cover of pieces.

    Attributes:
        chain: (N,) chain of each detection, -1 where it is of no piece.
        probability, tail, head, log_ratio, joined, terms: as `IdentityDecision` has them.
    """

    chain: IntArray
    probability: FloatArray
    tail: IntArray
    head: IntArray
    log_ratio: FloatArray
    joined: FloatArray
    terms: FloatArray


def decide(recording: Recording, passes: list[Pass], backward: Pass, c: ModelConstants) -> IdentityDecision:
    """Decide who is who.

    Args:
        recording: the detections.
        passes: of which the first is causal.
        backward: that of them with the same constants backward in time.
        c: constants.
    """
    seen, causal = recording.measured, passes[0].assigned
    assigned = np.stack([one.assigned for one in passes])
    piece = agreement.pieces(agreement.SeenBoxes(seen.t, seen.sensor), assigned, AGREED)
    odds = np.full(int(piece.max(initial=-1)) + 1, -np.inf)
    np.maximum.at(odds, piece, 0.5 * (log_odds(passes[0].real) + log_odds(backward.real)))
    decided = (odds > LEAST_LOG_ODDS) & (np.bincount(piece, minlength=len(odds)) >= LEAST_DETECTIONS)
    number = np.full(len(odds), -1)
    number[decided] = np.arange(decided.sum())
    piece = number[piece] if len(piece) else piece
    if not (piece >= 0).any():
        return IdentityDecision.without_links(np.zeros_like(causal), causal)
    best = best_chains(recording, piece, assigned, c)
    owner = np.zeros(len(causal), dtype=np.int64)
    of = with_weak(seen, causal, piece, best.chain)
    owner[of >= 0] = _named(of[of >= 0], causal[of >= 0], int(causal.max()))
    return IdentityDecision(owner, causal, *best[1:])


def best_chains(
    recording: Recording, piece: IntArray, assigned: IntArray, c: ModelConstants, so_far: SoFar | None = None
) -> BestChains:
    """Return the best cover of pieces, ties as the causal pass has them.

    Args:
        recording: the detections.
        piece: (N,) piece of each, -1 for none.
        assigned: (R, N) who took them in every pass, of which the first is causal.
        c: constants.
        so_far: what was decided before; None for a whole recording.
    """
    used, of, probability = piece >= 0, np.full(len(piece), -1), np.ones(len(piece))
    if not used.any():
        none, nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
        return BestChains(of, probability, none, none, nothing, nothing, np.zeros((0, len(TERMS))))
    members = _members(piece)
    found, causal_cover = _joined(recording, members, piece, assigned, c, so_far)
    cover = preferring(found.links, found.cover, causal_cover, TIE)
    chain = chains(found.links, cover)
    of[used] = chain[piece[used]]
    made = cover[cover >= 0]
    drawn, share = _drawn(found.links, cover)
    probability[used] = _together(drawn, found.links, chain, members)[piece[used]]
    tail = np.array([members[k][-1] for k in found.links.tail[made]], dtype=np.int64)
    head = np.array([members[k][0] for k in found.links.head[made]], dtype=np.int64)
    return BestChains(of, probability, tail, head, found.links.gain[made], share[made], found.terms[made])


def _joined(
    recording: Recording,
    members: list[IntArray],
    piece: IntArray,
    assigned: IntArray,
    c: ModelConstants,
    so_far: SoFar | None = None,
) -> tuple[Joined, IntArray]:
    """Return the best cover of pieces, and the one (P,) that the causal pass made.

    Args:
        recording: the detections.
        members: those of each piece, in order of time.
        piece: (N,) piece of each, -1 for none.
        assigned: (R, N) who took them in every pass, of which the first is causal.
        c: constants.
        so_far: what was decided before; None for a whole recording.
    """
    seen, picture = recording.measured, recording.scene.picture
    first, last = (np.array([one[k] for one in members]) for k in (0, -1))
    pieces = Pieces(seen.t[first], seen.t[last], *(at_rim(seen.boxes[k], picture) for k in (first, last)))
    made = agreement.votes_between(piece, assigned[:1], first)[:2]
    tail, head = _with_causal(_candidates(seen, first, last), made, seen.t[first], seen.t[last])
    scan_t, past = recording.scan_t, None
    step = float(np.median(np.diff(scan_t))) if len(scan_t) > 1 else c.first_period_s
    span = float(scan_t[0]), float(scan_t[-1])
    if so_far is not None:
        free = ~so_far.decided[head]
        tail, head, past = tail[free], head[free], so_far.past
        span = so_far.begun, span[1]
        step = (span[1] - span[0]) / max(so_far.times - 1, 1) or step
        pieces = pieces._replace(begins=np.where(so_far.decided, span[0], pieces.begins))
    ratio = _log_ratios(recording, members, tail, head, c)
    links = Links(tail, head, ratio)
    causal = _of_pairs(links, *made, np.ones(len(made[0]), dtype=np.int64), len(members)) > 0
    links = links._replace(gain=np.where(causal, np.maximum(links.gain, _LEAST_CAUSAL), links.gain))
    possible = causal | (links.gain > _LEAST_RATIO)
    links, causal = links.where(possible), causal[possible]
    voted = agreement.votes_between(piece, assigned, first)
    votes = _of_pairs(links, *voted, len(members)) / len(assigned)
    similarity = None
    if recording.embeddings is not None:
        # By links that neither appearance nor the passes decide, which weighed appearance, too.
        plain = join(pieces, links, np.zeros(len(votes)), span, step, past)
        ends = (_columns(members, from_end=True), _columns(members, from_end=False))
        cosine = link_cosines(recording.embeddings, seen.sensor, *ends, links)
        similarity = learnt_similarity(cosine, _drawn(plain.links, plain.cover)[1])
    found = join(pieces, links, votes, span, step, past, similarity)
    return found, _only_links(links, causal, len(members))


def _log_ratios(
    recording: Recording, members: list[IntArray], tail: IntArray, head: IntArray, c: ModelConstants
) -> FloatArray:
    """Return ln p(joined)/p(apart) (E,) of links between pieces; what no link is of is not filtered."""
    if not len(tail):
        return np.zeros(0)
    (tails, i), (heads, j) = (np.unique(nodes, return_inverse=True) for nodes in (tail, head))
    seen, scene = recording.measured, recording.scene
    ends = ends_of(seen, _columns([members[k] for k in tails], from_end=True), scene, c)
    begun = beginnings_of(seen, _columns([members[k] for k in heads], from_end=False), scene, c)
    return log_ratio(ends, i.reshape(-1), begun, j.reshape(-1), scene, c)


def _with_causal(
    near: tuple[IntArray, IntArray], made: tuple[IntArray, IntArray], begins: FloatArray, ends: FloatArray
) -> tuple[IntArray, IntArray]:
    """Return pairs of pieces, and those that follow each other on a causal track, in order, each once."""
    follows = begins[made[1]] > ends[made[0]]
    tail, head = (np.concatenate([a, b[follows]]) for a, b in zip(near, made, strict=True))
    code = np.unique(tail * len(begins) + head)
    return code // len(begins), code % len(begins)


def _only_links(links: Links, chosen: BoolArray, nodes: int) -> IntArray:
    """Return a cover (P,) of chosen links: of a node's several into one the first in time counts."""
    cover, entered = np.full(nodes, -1, dtype=np.int64), np.zeros(nodes, dtype=bool)
    for k in np.flatnonzero(chosen).tolist():
        if cover[links.tail[k]] < 0 and not entered[links.head[k]]:
            cover[links.tail[k]], entered[links.head[k]] = k, True
    return cover


def log_odds(p: FloatArray) -> FloatArray:
    """Return ln p/(1 − p) (N,) of posteriors (N,), which are kept from 0 and 1."""
    p = np.clip(p, _LEAST, 1.0 - _LEAST)
    return np.log(p / (1.0 - p))


def _members(piece: IntArray) -> list[IntArray]:
    """Return the detections of each piece in order of time; those below 0 are none."""
    order = np.argsort(piece, kind="stable")
    bounds = np.searchsorted(piece[order], np.arange(int(piece.max(initial=-1)) + 2))
    return np.split(order[bounds[0] :], bounds[1:-1] - bounds[0])


def _columns(members: list[IntArray], *, from_end: bool) -> IntArray:
    """Return the last, or the first, detections (P, K) of each piece, -1 where there are fewer."""
    width = min(_HITS, max(len(one) for one in members))
    out = np.full((len(members), width), -1, dtype=np.int64)
    for row, one in zip(out, members, strict=True):
        few = one[-width:] if from_end else one[:width]
        if from_end:
            row[width - len(few) :] = few
        else:
            row[: len(few)] = few
    return out


def at_rim(boxes: FloatArray, picture: tuple[float, float]) -> BoolArray:
    """Tell of boxes (N, 4), left, top, right, bottom, whether they lie at the rim of a picture (N,)."""
    rim = _RIM * (boxes[:, 2:] - boxes[:, :2]).min(axis=1)[:, None]
    near: BoolArray = (boxes[:, :2] < rim) | (boxes[:, 2:] > np.asarray(picture) - rim)
    return np.asarray(near.any(axis=1))


def _candidates(seen: MeasuredBoxes, first: IntArray, last: IntArray) -> tuple[IntArray, IntArray]:
    """Return pairs of pieces that follow each other in time, and lie near enough to be one."""
    begins, ends = seen.t[first], seen.t[last]
    centre = (seen.boxes[:, :2] + seen.boxes[:, 2:]) / 2.0 - seen.camera
    lengths = seen.boxes[:, 2:] - seen.boxes[:, :2]
    size, log_size = np.sqrt(lengths.prod(axis=1)), np.log(lengths)
    order = np.argsort(begins, kind="stable")
    low = np.searchsorted(begins[order], ends + 1e-6, side="right")
    high = np.searchsorted(begins[order], ends + LONGEST_GAP_S, side="right")
    tails, heads = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for i in range(len(first)):
        j = order[low[i] : high[i]]
        a, b = last[i], first[j]
        reach = np.maximum(size[a], size[b]) * (_REACH + _REACH_PER_S * (begins[j] - ends[i]))
        near = np.abs(centre[b] - centre[a]).max(axis=1) < reach
        near &= np.abs(log_size[b] - log_size[a]).max(axis=1) < _MOST_LOG_SIZE
        heads.append(j[near])
        tails.append(np.full(int(near.sum()), i))
    return np.concatenate(tails), np.concatenate(heads)


def with_weak(seen: MeasuredBoxes, causal: IntArray, piece: IntArray, chain: IntArray) -> IntArray:
    """Return the chain (N,) of each detection, with those of weak pieces as the causal pass has them.

    They go with the detection before them on their causal track, or where there is none with the one behind;
    not where the chain has a detection of the same sensor then, or a piece that goes on meanwhile.
    """
    order = np.lexsort((np.arange(len(causal)), causal))
    track, of = causal[order], chain[order]
    at = np.arange(len(of))
    before = np.maximum.accumulate(np.where(of >= 0, at, -1))
    behind = np.minimum.accumulate(np.where(of >= 0, at, len(of))[::-1])[::-1]
    filled = np.full(len(of), -1)
    for place in (np.minimum(behind, len(of) - 1), np.maximum(before, 0)):  # the one before counts for more
        good = (of[place] >= 0) & (track[place] == track)
        filled[good] = of[place][good]
    out = np.full(len(of), -1)
    out[order] = filled
    weak = (chain < 0) & (out >= 0)
    out[np.flatnonzero(weak)[_busy(seen, causal, piece, weak, out)]] = -1
    return out


def _busy(
    seen: MeasuredBoxes, causal: IntArray, piece: IntArray, weak: BoolArray, wanted: IntArray
) -> BoolArray:
    """Tell of weak detections (K,) whether the chain that each would go to is busy then.

    It is where it has a detection of the same sensor at that time, where a piece of it goes on meanwhile, or
    where neither neighbour of that sensor is of the same causal track.
    """
    there = np.flatnonzero(wanted >= 0)
    group = wanted[there] * (int(seen.sensor.max(initial=0)) + 1) + seen.sensor[there]
    order = np.lexsort((weak[there], seen.t[there], group))
    hit, group, is_weak = there[order], group[order], weak[there[order]]
    at = np.arange(len(hit))
    before = np.maximum.accumulate(np.where(is_weak, -1, at))
    behind = np.minimum.accumulate(np.where(is_weak, len(hit), at)[::-1])[::-1]
    known = []
    for place in (before, behind):
        inside = np.clip(place, 0, len(hit) - 1)
        known.append(np.where((place == inside) & (group[inside] == group), hit[inside], -1))
    one, other = known
    same_time = np.r_[False, (group[1:] == group[:-1]) & (seen.t[hit[1:]] == seen.t[hit[:-1]])]
    spans = (one >= 0) & (other >= 0) & (piece[one] == piece[other])
    strange = ((one >= 0) | (other >= 0)) & ~(
        ((one >= 0) & (causal[one] == causal[hit])) | ((other >= 0) & (causal[other] == causal[hit]))
    )
    out = np.zeros(len(weak), dtype=bool)
    out[hit] = same_time | spans | strange
    return out[weak]


def _of_pairs(links: Links, tail: IntArray, head: IntArray, value: IntArray, count: int) -> FloatArray:
    """Return values (E,) of links from those of pairs (K,), 0 for the others."""
    code, wanted = tail * count + head, links.tail * count + links.head
    if not len(code):
        return np.zeros(len(wanted))
    at = np.minimum(np.searchsorted(code, wanted), len(code) - 1)
    return np.where(code[at] == wanted, value[at], 0).astype(np.float64)


def _named(chain: IntArray, causal: IntArray, most: int) -> IntArray:
    """Return identities (N,): of each chain the first causal one that begins in it.

    Args:
        chain: (N,) chain of each detection, in order of time.
        causal: (N,) causal identity of each.
        most: the largest of these; a chain in which none begins gets a larger one.
    """
    identities, first = np.unique(causal, return_index=True)
    order = np.argsort(first)
    chains_begun, earliest = np.unique(chain[first[order]], return_index=True)
    known, code = np.unique(chain, return_inverse=True)
    name = np.zeros(len(known), dtype=np.int64)
    name[np.searchsorted(known, chains_begun)] = identities[order[earliest]]
    name[name == 0] = most + 1 + np.arange((name == 0).sum())
    return name[code.reshape(-1)]


def _drawn(links: Links, cover: IntArray) -> tuple[IntArray, FloatArray]:
    """Return covers drawn by their probability, and the share (E,) of them that has each link."""
    if not len(links.gain):
        return cover[None], np.zeros(0)
    numbers = np.full(len(links.gain), -1)
    likely = links.gain > _LEAST_DRAWN
    likely[cover[cover >= 0]] = True
    kept = np.flatnonzero(likely)
    numbers[kept] = np.arange(len(kept))
    start = np.full(len(cover), -1)
    start[cover >= 0] = numbers[cover[cover >= 0]]
    tempered = links.where(likely)
    tempered = tempered._replace(gain=tempered.gain / _OVERCONFIDENCE)
    drawn = sampled_covers(tempered, start, samples=_SAMPLES, sweeps=_SWEEPS)
    whole = np.where(drawn >= 0, kept[drawn], -1) if len(kept) else drawn
    return whole, shares(whole, len(links.gain))


def _together(drawn: IntArray, links: Links, chain: IntArray, members: list[IntArray]) -> FloatArray:
    """Return how often each piece (P,) is drawn in one chain with the longest piece of its own chain."""
    length = np.array([len(one) for one in members])
    order = np.lexsort((np.arange(len(length)), -length, chain))
    begins = np.r_[True, np.diff(chain[order]) != 0]
    anchor = np.empty(len(length), dtype=np.int64)
    anchor[order] = order[begins][np.cumsum(begins) - 1]
    out = np.zeros(len(length))
    for one in drawn:
        of = chains(links, one)
        out += of == of[anchor]
    return out / max(len(drawn), 1)
