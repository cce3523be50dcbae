"""The command line: one thin file a command."""

import os

# The matrices here are small: several threads would only wait for each other, and so for whatever else runs,
# and results would depend on the number of cores in their last digits. This is before NumPy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
