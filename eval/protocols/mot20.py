"""MOT20: as MOT17, and a vehicle without a motor may be found too."""

from __future__ import annotations

from jeat_graph.data.challenge_classes import PEDESTRIAN
from jeat_graph.eval.protocols.mot17 import DISTRACTORS
from jeat_graph.eval.protocols.pedestrians import judge_beside, looks_like_challenge, prepare
from jeat_graph.eval.protocols.record import FrameBoxes, Judged, JudgingProtocol


def judge(frame: FrameBoxes, _: str | None) -> Judged:
    """Say what counts in one frame."""
    return judge_beside(frame, (*DISTRACTORS, "non_motorized_vehicle"))


PROTOCOL = JudgingProtocol(
    name="mot20",
    says="as `mot17`, and a track that is matched to a vehicle without a motor is left out too (MOT20)",
    judge=judge,
    prepare=prepare,
    classes=(PEDESTRIAN,),
    suits=looks_like_challenge,
)
