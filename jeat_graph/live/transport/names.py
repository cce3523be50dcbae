"""Names for what a broker keeps, made of what they stand for, so that no two things share one."""

from __future__ import annotations

import hashlib
import re

_PREFIX = "jeat-graph"
#: So much of a name is there to be read (characters); the rest tells names apart.
_READABLE = 32
#: Digits of the hash: two of a million names are the same once in 10^7 times.
_DIGITS = 16


def distinct_name(*parts: str) -> str:
    """Return a name of letters, digits, `-` and `_` that no other parts give.

    Signs that brokers do not allow in names become `-`; a hash of the parts keeps `a/b` and `a-b`, `a` and
    `A`, and texts in other alphabets apart.

    Args:
        parts: what the name stands for, say a stream and a subject.
    """
    readable = re.sub(r"[^A-Za-z0-9_]+", "-", parts[-1])[:_READABLE].strip("-")
    digest = hashlib.sha256("\0".join(parts).encode("utf-8", "surrogatepass")).hexdigest()[:_DIGITS]
    return "-".join(part for part in (_PREFIX, readable, digest) if part)
