"""Converts tables, rows and files to text that the service reads. A file is passed on unchanged, a table row by row.
Nothing here imports pandas, polars, pyarrow or NumPy.

An index that does more than number the rows becomes a column of dates. The service parses these dates as it parses
those of files, so the client drops none that it does not know."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

#: A DataFrame, a two-dimensional array or a list of rows, with a column for each asset; or a text, or a path of a file.
Table: TypeAlias = Any

#: A line with one of these endings is the path of a file, not returns.
_FILES = (".csv", ".tsv", ".txt")
#: How the packages write a missing number.
_MISSING = {"nan", "NaN", "NaT", "<NA>", "None"}
#: A midnight after a day, with or without an offset, which adds nothing to the day.
_MIDNIGHT = re.compile(r"(?<=\d)[ T]00:00:00(\.0+)?([+-]\d\d:?\d\d|Z)?$")
#: Whole numbers that may be years.
_YEARS = range(1700, 2201)
#: The heading of a column of dates. The service recognises it whatever the cells contain.
_DATE = "date"


@dataclass(frozen=True)
class Sheet:
    """A table of text, cell by cell."""

    #: A row for each entry, with the cells of the columns but without the index.
    rows: list[list[str]]
    #: Headings of the columns, or default names; ``None`` if nothing has a name.
    names: list[str] | None
    #: Whether the columns have headings, which may show what the numbers are.
    is_headed: bool
    #: A cell for each row, if the index does more than number the rows.
    index: list[str] | None

    def blank(self) -> tuple[int, int]:
        """Counts the empty rows before and after the numbers, such as the first row of ``pct_change()``."""
        held = [any(row) for row in self.rows]
        return (held.index(True), held[::-1].index(True)) if any(held) else (0, 0)

    def text(self, names: Sequence[str] | None = None) -> str:
        """Returns lines of cells separated by tabs, under ``names`` or the headings of the table."""
        places = range(1 + (self.index is not None), len(self.rows[0]) + 2) if self.rows else ()
        own = self.names if self.is_headed else None
        if names is None and (own is not None or self.index is not None):
            names = own or [f"column {place}" for place in places]
        if self.index is None:
            # The service skips blank lines, which would hide a gap in the record.
            before, after = self.blank()
            held = self.rows[before : len(self.rows) - after]
            rows = [row if any(row) else ["NaN"] * len(row) for row in held]
        else:
            rows = [[date, *row] for date, row in zip(self.index, self.rows, strict=True)]
        heading = [] if names is None else [[*([_DATE] if self.index is not None else []), *names]]
        return "".join("\t".join(map(_quoted, row)) + "\n" for row in [*heading, *rows])


def sheet_of(source: Table | Sheet | str | PathLike[str], name: str = "returns") -> Sheet | str:
    """Returns a text unchanged, the text of a file, and the rows of anything else.

    A file is in UTF-8, in UTF-16 with a byte order mark, or in the encoding of Windows. A single line that ends like
    the name of a file is a path. Raises ``ValueError``, which names the argument, for other types and for an index that
    is ambiguous or has several levels.
    """
    if isinstance(source, str) and "\n" not in source and source.lower().endswith(_FILES):
        source = Path(source)
    if isinstance(source, PathLike):
        return _decoded(Path(source).read_bytes())
    if isinstance(source, str | Sheet):
        return source
    if hasattr(source, "to_csv"):
        return _of_pandas(source, name)
    if hasattr(source, "column_names"):
        names, columns = list(source.column_names), [column.to_pylist() for column in source.columns]
        # A column that was the index of a DataFrame.
        names = [_DATE if each.startswith("__index_level_") else each for each in names]
    elif hasattr(source, "get_columns"):
        names, columns = list(source.columns), [column.to_list() for column in source.get_columns()]
    elif hasattr(source, "to_list") or hasattr(source, "to_pylist"):
        named = getattr(source, "name", "")
        names = [named] if isinstance(named, str) and named else []
        columns = [source.to_list() if hasattr(source, "to_list") else source.to_pylist()]
    elif isinstance(source, Mapping) or not isinstance(source, Iterable):
        raise ValueError(f"{name} is of type {type(source).__name__}: must be a table, rows, numbers, a text or a file")
    else:
        held = [row if isinstance(row, Iterable) and not isinstance(row, str) else [row] for row in source]
        return Sheet([[_cell(value) for value in row] for row in held], None, False, None)
    rows = [[_cell(value) for value in row] for row in zip(*columns, strict=True)]
    return Sheet(rows, names or None, bool(names), None)


def heading(name: object) -> str:
    """Returns a name as a heading. A bare number would be read as data, so it gets a prefix."""
    text = str(name)
    return text if any(letter.isalpha() for letter in text) else f"asset {text}"


def counts_rows(index: Any, name: str) -> bool:
    """Tells whether an index of pandas only numbers the rows, from 0 or, for a part of a record, from another number.

    Raises ``ValueError`` if the numbers could also be years.
    """
    if getattr(index, "inferred_type", None) != "integer" and len(index):
        return False
    if any(later != earlier + 1 for earlier, later in pairwise(index)):
        return False
    if not is_years(index):
        return True
    # Years are given as separate numbers; rows are counted by a range.
    if hasattr(index, "step") and index.name is None:
        raise ValueError(
            f"the index of {name} goes from {index[0]} to {index[-1]}, which may be years or row numbers: "
            "must have the name 'year', or start from 0 (reset_index(drop=True))"
        )
    return False


def is_years(numbers: Any) -> bool:
    """Tells whether consecutive whole numbers may be years."""
    return len(numbers) > 0 and numbers[0] in _YEARS and numbers[-1] == numbers[0] + len(numbers) - 1 in _YEARS


def _of_pandas(source: Any, name: str) -> Sheet:
    if getattr(source.index, "nlevels", 1) > 1:
        raise ValueError(
            f"the index of {name} has {source.index.nlevels} levels: must have one, of dates (unstack, or reset_index)"
        )
    index = None
    if not counts_rows(source.index, name):
        ends = source.index
        if hasattr(ends, "to_timestamp"):
            days = ends.asfreq("D", how="end")
            ends = days if days.is_unique else ends.to_timestamp()
        index = [_cell(date) for date in ends]
    if not hasattr(source, "columns"):
        own = " ".join(source.name) if isinstance(source.name, tuple) else source.name
        names = [own] if isinstance(own, str) and own else None
        return Sheet([[_cell(value)] for value in source], names, names is not None, index)
    columns = [[_cell(value) for value in source.iloc[:, place]] for place in range(len(source.columns))]
    rows = [list(row) for row in zip(*columns, strict=True)]
    return Sheet(rows, names_of(source), list(source.columns) != list(range(len(columns))), index)


def names_of(frame: Any) -> list[str]:
    """Returns the names of the columns of a DataFrame. Of several levels it uses those in which the columns differ."""
    if getattr(frame.columns, "nlevels", 1) == 1:
        return [str(name) for name in frame.columns]
    levels = list(zip(*frame.columns, strict=True))
    telling = [level for level in levels if len(set(level)) > 1] or levels[:1]
    return [" ".join(str(part) for part in parts) for parts in zip(*telling, strict=True)]


def _cell(value: Any) -> str:
    text = str(value)
    return "" if text in _MISSING else _MIDNIGHT.sub("", text)


def _quoted(cell: str) -> str:
    """Quotes a cell that contains a character that could separate cells."""
    return '"' + cell.replace('"', '""').replace("\n", " ") + '"' if re.search(r'[\s,;|"#]', cell) else cell


def _decoded(content: bytes) -> str:
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")
