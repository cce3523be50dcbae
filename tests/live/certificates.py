"""Certificates for the tests: an authority of our own, by openssl, and what it has signed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest


def make(folder: Path) -> Path:
    """Make `ca`, `server`, `client` and a strange `other`: of each `.pem` and `.key`."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")

    def openssl(command: str, *rest: str) -> None:
        subprocess.run(["openssl", *command.split(), *rest], cwd=folder, check=True, capture_output=True)

    def key(name: str) -> str:
        return f"-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout {name}.key"

    for name in ("ca", "other"):
        openssl(f"req -x509 {key(name)} -out {name}.pem -days 30 -subj", f"/CN=jeat-graph {name}")
    (folder / "names.txt").write_text("subjectAltName=IP:127.0.0.1,DNS:localhost\n")
    for name in ("server", "client"):
        openssl(f"req {key(name)} -out {name}.csr -subj /CN={name}")
        signed = f"-CA ca.pem -CAkey ca.key -CAcreateserial -days 30 -out {name}.pem"
        openssl(f"x509 -req -in {name}.csr {signed} -extfile names.txt")
    return folder
