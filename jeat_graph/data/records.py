"""Records that stand in the modules of a package, one file each: found there, and named nowhere else."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any


def records_in(package: str, attribute: str) -> list[Any]:
    """Return what the modules of a package have by a name, in the order of the modules' names.

    Args:
        package: dotted name of the package.
        attribute: the name; modules without it are passed over.
    """
    path = importlib.import_module(package).__path__
    names = sorted(one.name for one in pkgutil.iter_modules(path))
    modules = [importlib.import_module(f"{package}.{name}") for name in names]
    return [getattr(module, attribute) for module in modules if hasattr(module, attribute)]
