"""What the smoother joined: `links.csv` in a run's directory, one row a link."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.association.linking import TERMS
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns


def _column(term: str) -> str:
    return term.replace(" ", "_")


*_TERM_COLUMNS, _APPEARANCE = map(_column, TERMS)
#: Columns of each file; that of appearance may follow.
LINK_COLUMNS = (
    "from",
    "to",
    "gap",
    "log_ratio",
    "probability",
    "track_id",
    "t_from",
    "t_to",
    *_TERM_COLUMNS,
)
_DECIMALS = 6


def write_links(links: IdentityLinks, path: str | Path) -> None:
    """Write links: causal identities at both ends of a gap (s), ln of the ratio, its terms, probability."""
    columns: dict[str, Any] = {
        "from": links.tail,
        "to": links.head,
        "gap": round_decimals(links.t_head - links.t_tail, _DECIMALS),
        "log_ratio": round_decimals(links.log_ratio, _DECIMALS),
        "probability": round_decimals(links.probability, _DECIMALS),
        "track_id": links.track_id,
        "t_from": links.t_tail + 0.0,
        "t_to": links.t_head + 0.0,
    }
    for name, values in links.shown_terms().items():
        columns[_column(name)] = round_decimals(values, _DECIMALS)
    write_columns(columns, path)


def read_links(path: str | Path) -> IdentityLinks:
    """Read links, as `write_links` writes them.

    Raises:
        DataError: the file cannot be read, or lacks a column.
    """
    table = read_table(path, LINK_COLUMNS, (_APPEARANCE,))
    whole = {name: table.whole(name) for name in ("track_id", "from", "to")}
    real = {name: table.number(name) for name in LINK_COLUMNS if name not in whole}
    appearance = table.number(_APPEARANCE) if _APPEARANCE in table else np.zeros(len(table))
    terms = np.stack([*(real[name] for name in _TERM_COLUMNS), appearance], axis=1)
    return IdentityLinks(
        *(whole["track_id"], whole["from"], whole["to"], real["t_from"], real["t_to"]),
        *(real["log_ratio"], real["probability"], terms),
    )
