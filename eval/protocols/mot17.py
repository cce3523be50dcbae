"""MOT16 and MOT17: a person on a vehicle or standing still, a distractor and a reflection may be found."""

from __future__ import annotations

from jeat_graph.data.challenge_classes import PEDESTRIAN
from jeat_graph.eval.protocols.pedestrians import judge_beside, looks_like_challenge, prepare
from jeat_graph.eval.protocols.record import FrameBoxes, Judged, JudgingProtocol

DISTRACTORS = ("person_on_vehicle", "static_person", "distractor", "reflection")


def judge(frame: FrameBoxes, _: str | None) -> Judged:
    """Say what counts in one frame."""
    return judge_beside(frame, DISTRACTORS)


PROTOCOL = JudgingProtocol(
    name="mot17",
    says="pedestrians alone are to be found; a track that is matched to a person on a vehicle, a static "
    "person, a distractor or a reflection is left out, one on anything else is false (MOT16, MOT17)",
    judge=judge,
    prepare=prepare,
    classes=(PEDESTRIAN,),
    suits=looks_like_challenge,
)
