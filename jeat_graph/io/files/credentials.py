"""Users and passwords that stand in no address: from the environment, or from a file."""

from __future__ import annotations

import os
import re
from pathlib import Path
from urllib.parse import unquote

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.secrets import Secret

#: The option that every address has: a file with the password in its only line.
PASSWORD_FILE = "password_file"
#: More is no password (bytes).
_PASSWORD_MOST = 4096
_VARIABLE = re.compile(r"\$\{([A-Za-z_][A-Za-z0-9_]*)\}")


def login_text(text: str | None) -> Secret | None:
    """Return a user or a password as it is meant: `%` and two digits as a sign, `${NAME}` as a variable.

    Raises:
        ConfigError: what is wrong, without the address.
    """
    if not text:
        return None
    found = []
    for k, part in enumerate(_VARIABLE.split(text)):
        if k % 2:  # the names of variables stand between what is around them
            value = os.environ.get(part, "")
            if not value:
                raise ConfigError(f"the environment variable {part} is not set")
            found.append(value)
        elif "${" in part:
            raise ConfigError("a variable is written ${NAME}")
        else:
            found.append(unquote(part))
    return Secret("".join(found))


def password_from(file: str) -> Secret:
    """Read the only line of a file; its content is in no message.

    Raises:
        ConfigError: there is no such file, or it holds something else.
    """
    try:
        with Path(file).open("rb") as stream:
            content = stream.read(_PASSWORD_MOST + 1)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "is no file"
        raise ConfigError(f"{PASSWORD_FILE}: {file}: {why}") from None
    try:
        text = content.decode().removesuffix("\n").removesuffix("\r")
    except UnicodeDecodeError:
        text = ""
    if not text or len(content) > _PASSWORD_MOST or not text.isprintable():
        raise ConfigError(f"{PASSWORD_FILE}: {file}: must hold one line, the password, in UTF-8")
    return Secret(text)
