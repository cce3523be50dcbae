"""Topics of words with wild cards: one word, or all that follow."""

from __future__ import annotations

from collections.abc import Sequence


def matches(
    wanted: Sequence[str], given: Sequence[str], one: str, rest: str, *, rest_may_be_none: bool
) -> bool:
    """Tell whether the words of a topic are among those that words with wild cards stand for.

    Args:
        wanted: words, wild cards allowed.
        given: words without any.
        one: stands for any one word.
        rest: stands for all that follow.
        rest_may_be_none: whether it also stands for no word.
    """
    for k, word in enumerate(wanted):
        if word == rest:
            return rest_may_be_none or len(given) > k
        if k >= len(given) or word not in (one, given[k]):
            return False
    return len(wanted) == len(given)
