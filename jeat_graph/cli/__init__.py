"""The command line: one thin file a command."""

import os
import sys

# The matrices here are small: several threads would only wait for each other, and so for whatever else runs,
# and results would depend on the number of cores in their last digits. This is before NumPy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def leave_current_folder() -> None:
    """Take the current folder off the places of modules, where `python -m` puts it first.

    There lie the user's data and what came with them; a checkout of the package itself is no such folder.
    """
    try:
        here = os.getcwd()
    except OSError:  # it has been removed: nothing can be found there
        return
    package = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if not sys.flags.safe_path and sys.path[:1] in ([here], [""]) and os.path.dirname(package) != here:
        del sys.path[0]
