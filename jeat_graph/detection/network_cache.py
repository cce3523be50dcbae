"""Files of known networks on this machine: fetched once, checked each time, usable without a network.

They lie in `jeat-graph/networks` of the user's cache (`XDG_CACHE_HOME`, else `~/.cache`), or where
`JEAT_GRAPH_NETWORKS` says. `JEAT_GRAPH_MIRROR` is the address of a folder that has the same files.
A file without a pinned SHA-256 is trusted at its first use, if it is an ONNX file at all and came by https;
its hash is kept beside it (`FILE.sha256`). A redirect never leads from https to anything else.
"""

from __future__ import annotations

import http.client
import os
import sys
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import DataError
from jeat_graph.data.notes import note
from jeat_graph.data.private_folder import is_private
from jeat_graph.data.secrets import shown_url, without_logins
from jeat_graph.detection.known_networks import KnownNetwork
from jeat_graph.detection.models.onnx_head import read_onnx_head
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.io.files.locking import hold_file

FOLDER, MIRROR = "JEAT_GRAPH_NETWORKS", "JEAT_GRAPH_MIRROR"
_MARK = ".sha256"
_PIECE = 1 << 18
# No detector that runs beside a camera is larger (bytes).
_LARGEST = 1 << 30
_PATIENCE_S = 30.0
#: Hosts to which there is no way that somebody else could change.
_THIS_MACHINE = ("127.0.0.1", "localhost", "::1")


def cache_folder() -> Path:
    """Return the folder of the files; it need not be there."""
    given = os.environ.get(FOLDER)
    if given:
        return Path(given)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "jeat-graph" / "networks"


def cached(network: KnownNetwork) -> Path | None:
    """Return the file of a network, if it is on this machine and the one that it should be.

    Raises:
        DataError: another file lies there, or others can write the folder.
    """
    path = cache_folder() / network.file
    if not path.is_file():
        return None
    if not is_private(path.parent):
        raise DataError("others can write this folder: networks are not taken from it", path.parent)
    _check(network, path, sha256_of(path))
    return path


def fetched(network: KnownNetwork) -> Path:
    """Return the file of a network; it is fetched where it is not on this machine.

    Raises:
        DataError: it cannot be fetched, is another file than it should be, or has no address: says what to
            put where.
    """
    path = cached(network)
    if path is not None:
        return path
    if not network.address:
        raise DataError(
            f"{network.name} is not on this machine, and its page gives no ONNX file: {network.how}; then "
            f"{_put(network)}"
        )
    mirror = os.environ.get(MIRROR)
    address = f"{_folder_of(mirror)}/{network.file}" if mirror else network.address
    place = cache_folder() / network.file
    with hold_file(place):
        path = cached(network)  # another process may have fetched it meanwhile
        if path is None:
            _fetch(network, address, place)
            path = cached(network)
    assert path is not None
    return path


def _folder_of(mirror: str) -> str:
    """Return the address of the mirror's folder, without a slash at its end.

    Raises:
        DataError: it is no address of a folder on the web.
    """
    try:
        parts = urllib.parse.urlsplit(mirror)
        place = parts.hostname, parts.port  # a port that is none raises
        good = parts.scheme in ("https", "http") and bool(place[0]) and not (parts.query or parts.fragment)
    except ValueError:
        good = False
    if not good or not mirror.isprintable() or " " in mirror:
        raise DataError(
            f"{MIRROR} must be the address of a folder, as https://host/folder, not {shown_url(mirror)!r}"
        )
    return mirror.rstrip("/")


def _fetch(network: KnownNetwork, address: str, place: Path) -> None:
    shown = without_logins(address)
    note(f"{network.name}: fetched once from {shown} ({network.licence}, {network.page})")
    place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    if not is_private(place.parent):
        raise DataError("others can write this folder: networks are not kept in it", place.parent)
    try:
        _check_way(address, pinned=bool(network.sha256))
        with _opened(address) as answer, atomic_path(place) as temporary:
            _copy(answer, temporary)
            _check_network(network, temporary, shown)
            _check(network, temporary, sha256_of(temporary), shown)
    except DataError:
        raise
    except (OSError, http.client.HTTPException, ValueError) as error:
        reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or error
        raise DataError(
            f"{network.name} cannot be fetched from {shown} ({without_logins(str(reason))}): {_put(network)}"
        ) from None


def _check_way(address: str, *, pinned: bool) -> None:
    """Refuse an address of which anybody on the way can change what comes, where nothing else would tell."""
    scheme, host = urllib.parse.urlsplit(address).scheme, urllib.parse.urlsplit(address).hostname
    if scheme not in ("https", "http"):
        raise ValueError("no address of the web")
    if scheme == "http" and not pinned and host not in _THIS_MACHINE:
        raise ValueError("no SHA-256 of it is known, so it is fetched by https only")


def _check_network(network: KnownNetwork, path: Path, source: str) -> None:
    """Refuse what is no ONNX file, such as a page that asks to log in: it is not kept."""
    try:
        read_onnx_head(path)
    except DataError as error:
        raise DataError(f"what came from {source} {error.message}: it is not {network.name}") from None


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Follows redirects, but from https to https only."""

    def redirect_request(self, req: Any, fp: Any, code: int, msg: str, headers: Any, newurl: str) -> Any:
        if req.full_url.startswith("https:") and not newurl.startswith("https:"):
            raise ValueError("it is redirected from https to another way")
        return super().redirect_request(req, fp, code, msg, headers, newurl)


@contextmanager
def _opened(address: str) -> Iterator[Any]:
    request = urllib.request.Request(address, headers={"User-Agent": "jeat-graph"})
    with urllib.request.build_opener(_Redirects).open(request, timeout=_PATIENCE_S) as answer:
        yield answer


def _copy(answer: Any, place: Path) -> None:
    """Write what comes, and show how far it is."""
    from tqdm import tqdm

    length = answer.headers.get("Content-Length")
    total = int(length) if length and length.isdecimal() else None
    if total is not None and total > _LARGEST:
        raise ValueError("it is larger than any network")
    hidden = not sys.stderr.isatty()
    count = 0
    with (
        place.open("wb") as file,
        tqdm(total=total, desc="fetch", unit="B", unit_scale=True, disable=hidden, leave=False) as bar,
    ):
        while piece := answer.read(_PIECE):
            count += len(piece)
            if count > _LARGEST:
                raise ValueError("it is larger than any network")
            file.write(piece)
            bar.update(len(piece))
    if total is not None and count != total:
        raise ValueError(f"only {count} of {total} bytes came")


def _check(network: KnownNetwork, path: Path, found: str, source: str = "") -> None:
    """Check a file against what is pinned, or what it was at its first use, which is kept."""
    mark = cache_folder() / f"{network.file}{_MARK}"
    known = network.sha256
    if not known and mark.is_file():
        known = tuple(mark.read_text(encoding="ascii", errors="replace").split()[:1])
    if known and found not in known:
        where = f"what came from {source}" if source else str(path)
        then = _put(network) if source else f"remove it and {_put(network)}"
        raise DataError(
            f"{where} is not {network.name}: its SHA-256 is {found}, not {' or '.join(known)}; {then}"
        )
    if not known:
        with atomic_path(mark) as temporary:
            temporary.write_text(f"{found}  {network.file}\n", encoding="ascii")
        note(f"{network.name}: SHA-256 {found} is kept: another file of this name will not be taken for it")


def _put(network: KnownNetwork) -> str:
    pinned = f" (SHA-256 {' or '.join(network.sha256)})" if network.sha256 else ""
    return f"put {network.file}{pinned} into {cache_folder()}"
