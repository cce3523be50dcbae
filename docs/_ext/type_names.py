"""Types in the API pages by the names that they have in the code, not as references of Sphinx."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

_REFERENCE = re.compile(r"TypeAliasForwardRef\(['\"](\w+)['\"]\)")
#: Before autodoc puts types into descriptions (500).
_EARLIER = 400


def _rename(app: Sphinx, *_: Any) -> None:
    for types in app.env.current_document.autodoc_annotations.values():
        for name, text in types.items():
            types[name] = _REFERENCE.sub(r"\1", text)


def setup(app: Sphinx) -> dict[str, Any]:
    """Rename before types are written into descriptions."""
    app.connect("object-description-transform", _rename, priority=_EARLIER)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
