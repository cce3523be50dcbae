"""What `explain` says of decided identities: of which causal tracks they are made, and what joined them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jeat_graph.data.identity_links import IdentityLinks
    from jeat_graph.runs.run_identities import IdentityPart, RunIdentities

# So many parts are named.
_MOST_PARTS = 12
# A link within a causal track is shown if its probability is less.
_SURE = 0.9


def identity_texts(identities: RunIdentities, number: int) -> list[str]:
    """Return lines on an identity and a causal track of one number.

    Args:
        identities: of the run.
        number: the identity.
    """
    lines = []
    parts = identities.of_identity(number)
    if parts:
        named = _named(parts, lambda one: f"causal track {one.causal_id}")
        lines.append(f"identity {number} of smoothed.csv is {named}")
        links = identities.links_of(number)
        if links is None:
            lines.append("a person has said so (--identities)")
        else:
            lines += _text_of_links(links)
    away = [one for one in identities.of_causal(number) if one.track_id != number]
    if away:
        named = _named(away, lambda one: f"identity {one.track_id}")
        lines.append(f"causal track {number} of causal.csv went to {named}")
    return lines


def _named(parts: Sequence[IdentityPart], name: Callable[[IdentityPart], str]) -> str:
    lines = [f"{name(one)} ({one.first:.3f} to {one.last:.3f} s)" for one in parts[:_MOST_PARTS]]
    if len(parts) > _MOST_PARTS:
        lines.append(f"{len(parts) - _MOST_PARTS} more parts")
    return ", ".join(lines)


def _text_of_links(links: IdentityLinks) -> list[str]:
    joined = links.tail != links.head
    lines = [_text_of_link(links, k) for k in range(len(joined)) if joined[k] or links.probability[k] < _SURE]
    if not joined.any():
        lines.insert(0, "no other causal track was joined to it")
    left = len(joined) - len(lines) + (not joined.any())
    if left:
        lines.append(f"{left} more links within one causal track, each of probability {_SURE:g} or more")
    return lines


def _text_of_link(links: IdentityLinks, k: int) -> str:
    tail, head = int(links.tail[k]), int(links.head[k])
    who = f"joins {tail} to {head}" if tail != head else f"keeps {tail} together"
    terms = ", ".join(f"{name} {values[k]:+.1f}" for name, values in links.shown_terms().items())
    return (
        f"a link {who} over {links.t_head[k] - links.t_tail[k]:.3f} s ({links.t_tail[k]:.3f} to "
        f"{links.t_head[k]:.3f} s): probability {links.probability[k]:.2f}, log ratio "
        f"{links.log_ratio[k]:+.1f} ({terms})"
    )
