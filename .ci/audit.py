"""Look up known weaknesses of everything installed here, where an index answers; fail where there is one.

pip-audit calls a set of packages sound, too, of which the index knew none. So the index is asked first
whether it answers at all, and how many packages were looked up is said.
"""

from __future__ import annotations

import json
import subprocess
import sys
import urllib.error
import urllib.request
from importlib.metadata import version

_PROBE = "numpy"
_PATIENCE_S = 10.0
#: A whole look-up takes about a minute; an index that stops answering on the way must not hold up everything.
_QUERY_S = 600.0
#: Findings that are known and do no harm here, by their number, and why.
ACCEPTED: dict[str, str] = {}


def index_answers() -> bool:
    """Whether the index knows of a package that it must know of."""
    address = f"https://pypi.org/pypi/{_PROBE}/{version(_PROBE)}/json"
    try:
        with urllib.request.urlopen(address, timeout=_PATIENCE_S) as answer:
            return "vulnerabilities" in json.load(answer)
    except (urllib.error.URLError, OSError, ValueError):
        return False


def main() -> int:
    """Print what was found; 1 where a package has a weakness that is not accepted."""
    if not index_answers():
        print("audit: no index answers here; nothing was looked up")
        return 0
    command = [sys.executable, "-m", "pip_audit", "--local", "--format", "json", "--progress-spinner", "off"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_QUERY_S)
        packages = json.loads(done.stdout)["dependencies"]
    except subprocess.TimeoutExpired:
        print("audit: the index stopped answering; nothing was looked up")
        return 0
    except (ValueError, KeyError):
        print(f"audit: pip-audit failed: {done.stderr.strip()[-300:]}")
        return 1 if index_answers() else 0  # what failed without an index says nothing of the packages
    checked = [package for package in packages if "vulns" in package]
    bad = [
        f"{package['name']} {package['version']}: {weakness['id']}, mended in {weakness['fix_versions']}"
        for package in checked
        for weakness in package["vulns"]
        if not ACCEPTED.keys() & {weakness["id"], *weakness.get("aliases", [])}
    ]
    print(*bad, f"audit: {len(checked)} of {len(packages)} packages looked up", sep="\n")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
