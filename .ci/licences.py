"""List the licences of everything that is installed with jeat-graph; fail where one would bind its users.

Runs over the base install and over every extra that a user may ask for, with all that they pull in; what only
tests, linters or the documentation need is no part of what is handed on. Read from the packages' own
metadata: the licence expression, else the classifiers, else the first line of the licence.
"""

from __future__ import annotations

import re
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution

from packaging.requirements import Requirement

PROJECTS = ("jeat-graph", "jeat-graph-sehn")
#: Extras whose packages work on the project and are never part of a user's install.
OURS_ONLY = ("test", "lint", "docs")
#: GPL and AGPL, by short name or in words; the Lesser GPL binds the library alone.
BINDING = re.compile(
    r"(?<![LA-Za-z])A?GPL(?!.*exception)|(?<!Lesser )General Public Licen[cs]e", re.IGNORECASE
)
#: Packages that are allowed although their wheels hold more than their own licence says, and why.
REASONS = {
    "av": "its own code is BSD, its wheels hold codecs under the GPL (x264, x265); comes with supervision in "
    "the extra of the peers, is not imported by jeat-graph, and is not handed on with it",
    "carla": "MIT, with assets under CC-BY; an extra of its own, for the recorder alone",
}


def canonical(name: str) -> str:
    """Name of a package as the index compares it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def licence(package: Distribution) -> str:
    """What a package says of its licence, in one line."""
    data = package.metadata
    classified = [
        line.split(" :: ")[-1] for line in data.get_all("Classifier") or [] if line.startswith("License ::")
    ]
    text = (data["License"] or "").strip().splitlines()
    licence_text = data["License-Expression"] or ", ".join(classified) or (text[0] if text else "")
    if not licence_text:
        files = [
            file for file in package.files or [] if re.search(r"licen[cs]e|copying", file.name, re.IGNORECASE)
        ]
        lines = [line.strip() for file in files for line in file.read_text(encoding="utf-8").splitlines()[:3]]
        licence_text = next((line for line in lines if line), "")
    return licence_text


def needed(project: str, extras: frozenset[str]) -> tuple[dict[str, Distribution], set[str]]:
    """Everything that a project with these extras pulls in here, and what of it is not installed."""
    found: dict[str, Distribution] = {}
    missing: set[str] = set()
    seen: set[tuple[str, frozenset[str]]] = set()
    waiting = [(project, extras)]
    while waiting:
        name, wanted = waiting.pop()
        if (name, wanted) in seen:
            continue
        seen.add((name, wanted))
        try:
            package = found[name] = distribution(name)
        except PackageNotFoundError:
            missing.add(name)
            continue
        for line in package.requires or []:
            requirement = Requirement(line)
            conditions = [{"extra": extra} for extra in ("", *wanted)]
            if requirement.marker is None or any(map(requirement.marker.evaluate, conditions)):
                waiting.append((canonical(requirement.name), frozenset(requirement.extras)))
    del found[project]
    return found, missing


def asked_for() -> list[tuple[str, str]]:
    """Each project with each extra that a user may ask for, "" for none."""
    return [
        (project, extra)
        for project in PROJECTS
        for extra in ("", *(distribution(project).metadata.get_all("Provides-Extra") or []))
        if extra not in OURS_ONLY
    ]


def main() -> int:
    """Print one line a package; 1 where one is forbidden or says nothing of its licence."""
    bad = 0
    shown: set[str] = set()
    for project, extra in asked_for():
        packages, missing = needed(project, frozenset([extra] if extra else []))
        print(f"\n{project}{f'[{extra}]' if extra else ''}:")
        for name in sorted(set(packages) - shown):
            licence_text = licence(packages[name])
            reason = REASONS.get(name)
            forbidden = reason is None and (not licence_text or bool(BINDING.search(licence_text)))
            bad += forbidden
            mark = "FORBIDDEN " if forbidden else ""
            print(f"  {mark}{name} {packages[name].version}: {licence_text or 'says nothing'}")
            if reason:
                print(f"      {reason}")
        for name in sorted(missing):
            print(f"  {name}: not installed here, {REASONS.get(name, 'not checked')}")
            bad += name not in REASONS
        shown |= set(packages)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
