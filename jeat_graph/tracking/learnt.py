"""What a tracker has learnt of its sensors, as settings; and a scene that begins with such settings.

What is learnt of a scene (how hard its tracks move, for how long what nobody sees stays there) may be wrong
in the next. How far a detector's scores and its agreement with others are to be believed goes with the
detector.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.config.fields import SMALLEST
from jeat_graph.config.learnt import LearntConfig
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.field_of_view import in_field
from jeat_graph.tracking.state import SceneState

# A factor on evidence is above 0, however little is left of it.
_LEAST_FACTOR = 1e-9
_SUMS = {
    "agreed_s": "agreed",
    "agreed_high_s": "agreed_high",
    "lonely_high_s": "lonely_high",
    "score_spread": "score_spread",
    "score_square": "score_square",
    "score_kept": "score_kept",
}


def learnt_of(scene: SceneState, config: Config) -> dict[str, LearntConfig]:
    """Return what has been learnt of each sensor that has looked; of none where nothing is learnt.

    Claims are counted by strips of the picture. Where all sensors look in the next recording is learnt there,
    so that those of the strips at which another looks are summed.

    Args:
        scene: what is learnt.
        config: what the tracker runs with.
    """
    lifecycle, names = config.lifecycle, config.sensor_names
    if not lifecycle.judges_worth:
        return {}
    out = {}
    for s, name in enumerate(names):
        if not np.isfinite(scene.first_look[s]):
            continue
        weights = _others_look(s, scene, config)
        sums = {key: _told(weights @ scene.claims[s][column]) for key, column in _SUMS.items()}
        cov = scene.worth_cov[s]
        out[name] = LearntConfig(
            worth=(_told(scene.worth_mean[s, 0]), _told(scene.worth_mean[s, 1])),
            worth_cov=(float(cov[0, 0]), _told(cov[0, 1]), float(cov[1, 1])),
            lasting_odds=_told(scene.lasting_odds[s]),
            lasting_s=_told(scene.lasting_seen[s]),
            vain=_told(scene.vain[s]),
            vain_s=_told(scene.vain_seen[s]),
            lonely_s=max(_told(weights @ scene.claims[s]["all"] - sums["agreed_s"]), sums["lonely_high_s"]),
            agreed_odds=_told(scene.agreed_odds[s]),
            agreed_without=tuple(
                (other, float(scene.agreed_without[s, o]))
                for o, other in enumerate(names)
                if o != s and scene.agreed_without[s, o] > SMALLEST
            ),
            borne_out=max(float(scene.borne_out[s]), _LEAST_FACTOR),
            trust=max(float(scene.trust[s]), _LEAST_FACTOR),
            **sums,
        )
    return out


def _told(value: float) -> float:
    """Return a sum as a setting can have it: what is left of nothing by rounding is nothing."""
    return 0.0 if abs(value) < SMALLEST else float(value)


def _others_look(s: int, scene: SceneState, config: Config) -> FloatArray:
    """Chance (G,) that another sensor than `s` looks at each strip of the picture, as far as is known."""
    strips, lifecycle = scene.claims.shape[1], config.lifecycle
    chance = np.zeros(strips)
    for o in range(len(scene.trust)):
        if o == s or not np.isfinite(scene.first_look[o]):
            continue
        # As `stages.looking.known_fields` has it; of none or less, `in_field` says 1.
        known = lifecycle.field_boxes * (scene.field_witnesses[o] - lifecycle.field_doubt)
        low, high = scene.field[o]
        for g in range(strips):
            x = (g + 0.5) * config.image.width / strips
            chance[g] = max(chance[g], in_field(x, low, high, known))
    return chance


def begin_with(scene: SceneState, config: Config) -> SceneState:
    """Let a new scene begin with what its configuration says was learnt of the sensors; in place.

    Claims are spread over all strips of the picture: which of them the others look at is learnt anew.

    Args:
        scene: of `start_scene`.
        config: what the tracker runs with.

    Returns:
        The same scene.
    """
    names = config.sensor_names
    if not config.lifecycle.judges_worth:
        return scene
    for s, name in enumerate(names):
        known = config.sensors[name].learnt
        if known is None:
            continue
        a, ab, b = known.worth_cov
        scene.worth_mean[s] = known.worth
        scene.worth_cov[s] = ((a, ab), (ab, b))
        scene.lasting_odds[s], scene.lasting_seen[s] = known.lasting_odds, known.lasting_s
        scene.vain[s], scene.vain_seen[s] = known.vain, known.vain_s
        claims, strips = scene.claims[s], scene.claims.shape[1]
        for key, column in _SUMS.items():
            claims[column] = getattr(known, key) / strips
        claims["all"] = (known.agreed_s + known.lonely_s) / strips
        scene.agreed_seen[s], scene.agreed_odds[s] = known.agreed_s, known.agreed_odds
        without = dict(known.agreed_without)
        scene.agreed_without[s] = [without.get(other, 0.0) for other in names]
        scene.borne_out[s], scene.trust[s] = known.borne_out, known.trust
    return scene
