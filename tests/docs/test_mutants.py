"""Small faults for a mutation score: each changes one place of a function, and nothing else."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

MADE = runpy.run_path(str(Path(__file__).parents[2] / ".ci" / "mutants.py"))
SOURCE = '''LIMIT = 3.0

def nearest(a: float, b: float = 2.0) -> float:
    """Return 1 if a is below b."""
    if not a < b:
        return -a * 2.0
    return np.minimum(a, b)
'''


def test_every_place_of_a_body_is_changed_once_and_no_constant_or_default() -> None:
    changes = []
    for number in range(6):
        tree, line, before, after = MADE["mutated"](SOURCE, number)
        text = ast.unparse(tree)
        assert "LIMIT = 3.0" in text
        assert "b: float=2.0" in text
        changes.append((line, before, after))
    assert changes == [
        (5, "not a < b", "not not a < b"),
        (5, "a < b", "a >= b"),
        (6, "-a * 2.0", "-a / 2.0"),
        (6, "-a", "+a"),
        (6, "2.0", "3.0"),
        (7, "np.minimum", "np.maximum"),
    ]
