"""Numbers as JSON has them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def nan_as_null(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with None for each that is not a number, which JSON cannot hold."""
    return {
        name: None if isinstance(value, float) and math.isnan(value) else value
        for name, value in values.items()
    }
