"""Encrypted connections to a broker: who is believed, and how one shows who one is."""

from __future__ import annotations

import ssl
from dataclasses import dataclass
from pathlib import Path

from jeat_graph.data.errors import ConfigError

#: Options of an encrypted address: certificates of authorities (default: the system's), one's own certificate
#: and its key, and `insecure=yes`, which believes anybody.
OPTIONS = ("ca", "cert", "key", "insecure")
_FILES = ("ca", "cert", "key")


@dataclass(frozen=True)
class Tls:
    """How a connection is encrypted.

    Attributes:
        ca: file with the certificates of the authorities that are believed (PEM); None: the system's.
        cert: file with one's own certificate, for a broker that asks for it; or None.
        key: file with its key; or None.
        insecure: the broker's certificate and name are not looked at.
    """

    ca: str | None = None
    cert: str | None = None
    key: str | None = None
    insecure: bool = False

    @staticmethod
    def of(options: dict[str, str]) -> Tls:
        """Take it out of the options of an address.

        Raises:
            ConfigError: a file that is not there, or options that do not go together.
        """
        files = {name: options.pop(name, None) for name in _FILES}
        for name, file in files.items():
            if file is not None and not Path(file).is_file():
                raise ConfigError(f"{name}: {file}: no such file")
        if (files["cert"] is None) != (files["key"] is None):
            raise ConfigError("cert and key go together: give both")
        insecure = options.pop("insecure", "no")
        if insecure not in ("yes", "no"):
            raise ConfigError(f"insecure is yes or no, not {insecure!r}")
        if insecure == "yes" and files["ca"] is not None:
            raise ConfigError("insecure=yes looks at no certificate: leave it out, or ca")
        return Tls(**files, insecure=insecure == "yes")

    def context(self) -> ssl.SSLContext:
        """Return it as Python's clients take it.

        Raises:
            ConfigError: a file that holds no certificate or key.
        """
        try:
            made = ssl.create_default_context(cafile=self.ca)
            if self.cert is not None:
                made.load_cert_chain(self.cert, self.key, password=_no_password)
        except (OSError, ValueError) as error:
            names = ", ".join(file for file in (self.ca, self.cert, self.key) if file is not None)
            raise ConfigError(f"{names}: no certificate, or no key of it ({error})") from None
        if self.insecure:
            made.check_hostname, made.verify_mode = False, ssl.CERT_NONE
        return made

    def librdkafka(self) -> dict[str, str | bool]:
        """Return it as the client of Kafka takes it."""
        files = {
            "ssl.ca.location": self.ca,
            "ssl.certificate.location": self.cert,
            "ssl.key.location": self.key,
        }
        given: dict[str, str | bool] = {name: file for name, file in files.items() if file is not None}
        if self.insecure:
            given |= {
                "enable.ssl.certificate.verification": False,
                "ssl.endpoint.identification.algorithm": "none",
            }
        return given


def _no_password() -> str:
    """A key with a password would have the process wait for somebody to type it."""
    raise ValueError("the key has a password")
