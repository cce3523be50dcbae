"""The normal distribution's number that intervals are made with."""

from __future__ import annotations

#: Half the width of a two-sided 95 % interval, in standard deviations.
Z95 = 1.959963984540054
