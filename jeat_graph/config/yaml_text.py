"""YAML from anybody, read so that no text can take more time or memory than its length deserves.

Only plain values are made (`safe` loading: no tag runs anything). A text may name a part of itself (`&a`) and
repeat it (`*a`); lists of such repetitions double with every line, so what they stand for is counted before
anything is made of it.
"""

from __future__ import annotations

from typing import Any

import yaml

#: Values that a text may stand for, its repetitions written out; the largest preset has some hundreds.
MOST_VALUES = 20_000


def load_yaml(text: str) -> Any:
    """Read one YAML document as nested mappings, lists, texts and numbers.

    Raises:
        yaml.YAMLError: not valid YAML, nested too deeply, or more than `MOST_VALUES` by repetition.
    """
    try:
        loader = yaml.SafeLoader(text)
    except yaml.reader.ReaderError as error:
        mark = yaml.Mark("", error.position, text.count("\n", 0, error.position), 0, None, 0)
        raise yaml.MarkedYAMLError(problem=error.reason, problem_mark=mark) from None
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _count(node, {})
        return loader.construct_document(node)
    except RecursionError:
        raise yaml.YAMLError("is nested too deeply") from None
    except (ValueError, OverflowError, AttributeError) as error:
        # A date such as 2026-99-99, a number of too many digits, or a tag of what it is not.
        raise yaml.YAMLError(str(error)) from None
    finally:
        loader.dispose()


def _count(node: yaml.Node, known: dict[int, int]) -> int:
    """Count the values a node stands for; `known` has those of the nodes counted before, 0 while at it."""
    if not isinstance(node, yaml.CollectionNode):
        return 1
    if id(node) in known:
        if not known[id(node)]:
            raise yaml.YAMLError("holds itself (an alias within what it names)")
        return known[id(node)]
    known[id(node)] = 0
    parts = node.value
    if isinstance(node, yaml.MappingNode):
        _check_once(node)
        parts = [part for pair in node.value for part in pair]
    total = 1 + sum(_count(part, known) for part in parts)
    if total > MOST_VALUES:
        raise yaml.YAMLError(f"stands for more than {MOST_VALUES} values; its aliases repeat too much")
    known[id(node)] = total
    return total


def _check_once(node: yaml.MappingNode) -> None:
    """Refuse a key that comes twice: the last value would count, and nobody would know."""
    seen: set[str] = set()
    for key, _ in node.value:
        if isinstance(key, yaml.ScalarNode) and key.value in seen:
            raise yaml.MarkedYAMLError(problem=f"{key.value} comes twice", problem_mark=key.start_mark)
        seen.add(str(key.value))
