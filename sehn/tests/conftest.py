"""What all tests share."""

from __future__ import annotations

import os

from hypothesis import settings

# The tests share the cores: the threads of one's linear algebra would only wait for those of the others.
# This is before anything that loads it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The first call of a compiled function compiles it, which no deadline of a test should include; examples
# follow from the test, not from a clock.
settings.register_profile("jeat-graph-sehn", deadline=None, derandomize=True)
settings.load_profile("jeat-graph-sehn")
