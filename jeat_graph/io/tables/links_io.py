"""What the smoother joined: `links.csv` in a run's directory, one row a link."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns

if TYPE_CHECKING:
    from jeat_graph.data.identity_links import IdentityLinks

#: Columns of the file.
LINK_COLUMNS = (
    "from",
    "to",
    "gap",
    "log_ratio",
    "probability",
    "track_id",
    "t_from",
    "t_to",
)
_DECIMALS = 6


def write_links(links: IdentityLinks, path: str | Path) -> None:
    """Write links: causal identities before and behind a gap (s), ln of the ratio, and the probability."""
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
    write_columns(columns, path)
