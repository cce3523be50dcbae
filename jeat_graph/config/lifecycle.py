"""Settings of the life of a track: association, birth, confirmation, merging and end."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from jeat_graph.association.methods import METHODS, SLOTS
from jeat_graph.config.fields import Section, choice, flag, number

# Costs of the paper's problem are d² <= gate; leaving a row out must cost more than any sum of them, so that
# as many pairs as possible are taken. Small enough that sums keep ten digits behind the point.
_TAKE_ALL = 1.0e5


def _chi2_bound(probability: float) -> float:
    """Bound below which a χ² variable of 2 degrees of freedom lies with this probability, −2 ln(1 − p)."""
    return -2.0 * math.log1p(-probability)


@dataclass(frozen=True)
class AssociationConfig(Section):
    """How detections are given to tracks."""

    method: str = choice(
        "slots",
        METHODS,
        "slots: one joint problem with a slot per track and sensor; joint: the paper's, one match a track "
        "and a second pass; sequential: sensor after sensor in the order of `priority`",
    )
    cost: str = choice("likelihood", ("likelihood", "mahalanobis"), "cost of a pair")
    gate_probability: float = number(
        1.0 - 1e-12,
        "1",
        "probability mass of the χ² gates; wide, for the likelihood decides",
        0.5,
        1.0 - 1e-13,
    )
    size_gate: bool = flag(True, "gate ln size too")
    priority: tuple[str, ...] = field(
        default=(), metadata={"doc": "order of sensors for `sequential`; those not named follow by name"}
    )
    second_pass: bool = flag(True, "joint and sequential: a matched track takes another sensor's leftover")
    tail_freedom: float = number(
        0.0,
        "1",
        "likelihoods of pairs have the tails of Student's t with so many degrees of freedom (> 2); 0: normal",
    )
    log_size_range: float = number(
        3.0, "ln px", "range of ln width and of ln height over which false boxes spread", open_low=True
    )
    most_alike: float = number(
        4.0,
        "1",
        "greatest ln likelihood ratio by how alike embeddings are; 0: they do not count",
        0.0,
        30.0,
    )

    @property
    def method_code(self) -> int:
        """The number of `method`, see `association.methods`."""
        return METHODS.index(self.method)

    @property
    def by_likelihood(self) -> bool:
        """Whether pairs are judged by their likelihood ratio and not by their distance."""
        return self.cost == "likelihood"

    @property
    def second_views(self) -> bool:
        """Whether there is a second pass; slots leave nothing to it."""
        return self.second_pass and METHODS.index(self.method) != SLOTS

    @property
    def gate_bound(self) -> float:
        """Bound (χ², 2 degrees of freedom) on the squared Mahalanobis distance of the centre."""
        return _chi2_bound(self.gate_probability)

    @property
    def size_gate_bound(self) -> float:
        """Bound (χ², 2 degrees of freedom) on that of ln width and ln height; +inf for none."""
        return _chi2_bound(self.gate_probability) if self.size_gate else math.inf

    @property
    def unassigned_cost(self) -> float:
        """Cost of a track without detection: with distances as many pairs as possible are taken."""
        return 0.0 if self.by_likelihood else _TAKE_ALL


@dataclass(frozen=True)
class LifecycleConfig(Section):
    """When a track is confirmed, reported and given up."""

    method: str = choice("existence", ("existence", "hits"), "Bernoulli existence, or the paper's hit counts")
    confirm_existence: float = number(0.95, "1", "confirmed at this probability of existence", 0.0, 1.0)
    min_worth: float = number(
        0.0,
        "1",
        "what one sensor alone has seen is confirmed and reported only while boxes of such scores are found "
        "to last with at least this probability (`filters.worth`); 0: not asked",
        0.0,
        0.999,
    )
    worth_of_usual: float = number(
        0.8,
        "1",
        "or with this share of the probability for the usual box of what lasts, if that is less",
        0.0,
        1.0,
    )
    lasting_s: float = number(1.0, "s", "what is tracked for so long has lasted", open_low=True)
    worth_half: float = number(
        0.65,
        "1",
        "probability that boxes of score one half last, before it is learnt, of a sensor whose scores nobody "
        "has measured (`score_precision`)",
        0.001,
        0.999,
    )
    worth_slope: float = number(
        1.0, "1", "how its log odds rise with those of the score, before it is learnt, of such a sensor"
    )
    worth_std: float = number(1.0, "1", "standard deviation of both assumptions", open_low=True)
    usual_vain: float = number(
        0.02,
        "1",
        "a sensor that no other looks beside is believed in full if none of its repeated detections came to "
        "nothing, and from this share on as little as one of which nothing is known",
        0.0,
        1.0,
        open_low=True,
    )
    worth_memory_s: float = number(
        1000.0, "s", "time after which what was learnt of them is as uncertain as at first", open_low=True
    )
    witness_odds: float = number(
        0.0,
        "ln",
        "by existence: a sensor no longer counts among those that saw a track once it has missed it so often "
        "that this speaks against it more than its detections for it, by so much; 0: it counts for good",
    )
    least_move: float = number(
        0.0, "1", "what none saw but sensors blind to what stands must move by this share of its size; 0: not"
    )
    delete_existence: float = number(0.001, "1", "deleted below this probability of existence", 0.0, 1.0)
    lifetime_s: float = number(
        20.0, "s", "mean time a vehicle stays in the picture (decay of existence)", open_low=True
    )
    hidden_prior: float = number(
        0.1,
        "1",
        "share of the time for which a vehicle is hidden from a sensor, whatever the reason",
        0.0,
        0.9,
    )
    hidden_memory_s: float = number(
        0.3, "s", "time after which a hidden vehicle may be visible again", open_low=True
    )
    sight_scans: float = number(
        1000.0,
        "scans",
        "mean number of scans until a sensor goes blind as a whole (dazzled, covered, failed), a broad "
        "guess; 0: never, its misses are independent",
    )
    blind_scans: float = number(
        50.0, "scans", "mean number of scans for which it then finds nothing, a broad guess", 1.0
    )
    unproven: float = number(
        0.9,
        "1",
        "as long as a sensor has found nothing at all, an empty scan of it says so much less that no vehicle "
        "waits to be found",
        0.0,
        0.999,
    )
    scene_memory_s: float = number(
        10.0, "s", "memory of the running estimates of each sensor's clutter and P_D; 0 keeps the configured"
    )
    disagreement: float = number(
        0.0,
        "1",
        "power of the share of a sensor's lasting tracks that others see too, as factor on its evidence",
    )
    agreement_prior: float = number(
        0.7, "1", "that share before anything is known, and where there is no other sensor", 0.01, 1.0
    )
    disagreement_memory_s: float = number(30.0, "s", "memory of that share", open_low=True)
    field_doubt: float = number(
        0.0,
        "1",
        "of several sensors each is taken to look as far to the left and right as its boxes reach, once it "
        "has seen more than so many vehicles there; 0: each looks at all of it",
    )
    field_boxes: float = number(1.0, "1", "for so many independent boxes each further vehicle counts in that")
    p_detect_weight: float = number(0.05, "1", "weight of one look in a track's own P_D per sensor", 0.0, 1.0)
    p_detect_min: float = number(0.05, "1", "least P_D of a track", 0.001, 0.999)
    p_detect_max: float = number(0.98, "1", "greatest P_D of a track", 0.001, 0.999)
    confirm_age_s: float = number(0.5, "s", "paper: age before confirmation")
    confirm_hits: int = number(5, "1", "paper: hits before confirmation", low=1)
    max_gap_confirmed_s: float = number(
        1.0, "s", "a confirmed track without update is deleted after this (paper .5)"
    )
    max_silence_s: float = number(
        300.0,
        "s",
        "after so long without any scan all tracks are over (longer predictions outgrow a double's digits)",
        high=1000.0,
        open_low=True,
    )
    leave_picture: bool = flag(True, "a track whose centre leaves the picture ends")
    max_gap_tentative_s: float = number(
        0.3, "s", "a tentative track without update is deleted after this (paper .2)"
    )

    @property
    def by_existence(self) -> bool:
        """Whether the probability of existence decides, and not hit counts."""
        return self.method == "existence"

    @property
    def judges_sight(self) -> bool:
        """Whether a sensor may be found blind as a whole."""
        return self.by_existence and self.sight_scans > 0.0

    @property
    def usual_blindness(self) -> float:
        """Probability that a sensor is blind as a whole where nothing is known: its share of the time."""
        return self.blind_scans / (self.sight_scans + self.blind_scans) if self.judges_sight else 0.0

    @property
    def judges_worth(self) -> bool:
        """Whether tracks of one sensor alone have to be worth something."""
        return self.by_existence and self.min_worth > 0.0

    @property
    def first_doubt(self) -> float:
        """Probability that a sensor finds nothing, before it has found anything."""
        return self.unproven if self.judges_sight else 0.0


@dataclass(frozen=True)
class BirthConfig(Section):
    """When a detection that no track took starts a new one."""

    arrival_rate_hz: float = number(2.0, "1/s", "rate at which vehicles enter the scene")
    initial: float = number(10.0, "1", "expected number of vehicles in the scene at the start")
    min_existence: float = number(
        0.002, "1", "least probability of existence with which a detection starts a track", 0.0, 1.0
    )
    max_overlap: float = number(
        0.5,
        "1",
        "no birth where the IoU with a track, or with another birth of this batch, is above",
        0.0,
        1.0,
    )
    max_picture_share: float = number(
        0.8,
        "1",
        "no birth of a box that touches three edges of the picture and covers more of it: where the light "
        "changes, detectors of change see that everywhere",
        0.0,
        1.0,
    )


@dataclass(frozen=True)
class MergeConfig(Section):
    """When two tracks are one vehicle, the older one; what one sensor has seen apart stays two."""

    enabled: bool = flag(True, "merge duplicates")
    min_overlap: float = number(0.7, "1", "IoU above which two tracks may be one", 0.0, 1.0)
    gate_probability: float = number(
        0.99, "1", "χ² mass within which their velocities agree", 0.5, 1.0 - 1e-12
    )
    apart_overlap: float = number(0.0, "1", "IoU up to which tracks are seen apart; 0: not asked", 0.0, 1.0)

    @property
    def gate_bound(self) -> float:
        """Bound (χ², 2 degrees of freedom) on the difference of two velocities."""
        return _chi2_bound(self.gate_probability)
