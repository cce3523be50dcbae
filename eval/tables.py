"""One table of results, as aligned text, CSV, Markdown, LaTeX or JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.tables.spreadsheets import guarded

Cell = str | float | int | None
FORMATS = ("text", "markdown", "csv", "latex", "json")


@dataclass(frozen=True)
class Table:
    """Results in rows and named columns.

    Attributes:
        columns: names.
        rows: one cell a column; None and NaN are shown as a dash (in CSV: left empty; in JSON: null).
        title: a line above the table, optional.
        digits: digits after the point of a column's numbers, where not 2.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    title: str = ""
    digits: Mapping[str, int] = field(default_factory=dict)

    @staticmethod
    def from_records(
        records: Sequence[Mapping[str, Cell]],
        columns: Sequence[str] | None = None,
        title: str = "",
        digits: Mapping[str, int] | None = None,
    ) -> Table:
        """Make a table of dictionaries; a key that one of them lacks is an empty cell.

        Args:
            records: one dictionary a row.
            columns: the columns to show; by default all keys in the order they first occur.
            title: a line above the table.
            digits: digits after the point, by column.
        """
        names = list(columns) if columns is not None else list(dict.fromkeys(k for r in records for k in r))
        rows = tuple(tuple(record.get(name) for name in names) for record in records)
        return Table(tuple(names), rows, title, dict(digits or {}))

    def render(self, form: str = "text") -> str:
        """Return the table as text that ends in a newline.

        Args:
            form: one of `FORMATS`.

        Raises:
            ConfigError: unknown format.
        """
        writers = {
            "text": self._text,
            "markdown": self._markdown,
            "csv": self._csv,
            "latex": self._latex,
            "json": self._json,
        }
        if form not in writers:
            raise ConfigError(f"unknown table format {form!r}; use one of {', '.join(FORMATS)}")
        return writers[form]()

    def shown(self, dash: str = "–") -> list[list[str]]:
        """Return the cells as they are shown to people, row by row."""
        return [
            [self._cell(value, name, dash) for value, name in zip(row, self.columns, strict=True)]
            for row in self.rows
        ]

    def _cell(self, value: Cell, column: str, dash: str) -> str:
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            return dash
        if isinstance(value, float):
            text = f"{value:.{self.digits.get(column, 2)}f}"
            return text[1:] if text.startswith("-") and not text.strip("-0.") else text
        return str(value)

    def is_number(self, k: int) -> bool:
        """Tell whether column `k` holds numbers, which are aligned to the right."""
        return all(not isinstance(row[k], str) for row in self.rows)

    def _text(self) -> str:
        cells = self.shown()
        widths = [max(len(n), *(len(r[k]) for r in cells), 0) for k, n in enumerate(self.columns)]
        # Known once, not for each row: it looks at all of them.
        right = [self.is_number(k) for k in range(len(self.columns))]

        def line(row: Sequence[str]) -> str:
            parts = [
                c.rjust(w) if number else c.ljust(w) for c, w, number in zip(row, widths, right, strict=True)
            ]
            return "  ".join(parts).rstrip()

        rule = "  ".join("─" * w for w in widths)
        head = [self.title] if self.title else []
        return "\n".join([*head, line(self.columns), rule, *(line(r) for r in cells)]) + "\n"

    def _markdown(self) -> str:
        def line(row: Sequence[str]) -> str:
            return "| " + " | ".join(c.replace("|", "\\|") for c in row) + " |"

        marks = ["--:" if self.is_number(k) else "---" for k in range(len(self.columns))]
        head = [f"**{self.title}**", ""] if self.title else []
        rows = [line(r) for r in self.shown()]
        return "\n".join([*head, line(self.columns), "|" + "|".join(marks) + "|", *rows]) + "\n"

    def _csv(self) -> str:
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.columns)
        # Full precision: a CSV is read by programs.
        writer.writerows(
            ["" if v is None or (isinstance(v, float) and math.isnan(v)) else _as_field(v) for v in row]
            for row in self.rows
        )
        return out.getvalue()

    def _latex(self) -> str:
        def escape(text: str) -> str:
            special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
            special |= {c: "\\" + c for c in "&%$#_{}"}
            return "".join(special.get(c, c) for c in text)

        def line(row: Sequence[str]) -> str:
            return " & ".join(escape(c) for c in row) + r" \\"

        layout = "".join("r" if self.is_number(k) else "l" for k in range(len(self.columns)))
        rows = [line(r) for r in self.shown("--")]
        head = [f"% {self.title}"] if self.title else []
        begin, end = rf"\begin{{tabular}}{{{layout}}}", r"\end{tabular}"
        return "\n".join(
            [*head, begin, r"\toprule", line(self.columns), r"\midrule", *rows, r"\bottomrule", end, ""]
        )

    def _json(self) -> str:
        records = [dict(zip(self.columns, row, strict=True)) for row in self.rows]
        return to_json(records)


def to_json(value: object) -> str:
    """JSON with full precision, two spaces of indent and a newline; NaN and infinity become null."""
    return json.dumps(_plain(value), indent=2, ensure_ascii=False) + "\n"


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _as_field(value: Cell) -> Cell:
    return guarded(value) if isinstance(value, str) else value
