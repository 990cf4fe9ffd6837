"""Whatever holds numbers, as text that the service reads: a file as it stands, a table row by row. Nothing here imports
pandas, polars, pyarrow or NumPy.

An index that is more than the numbers of the rows becomes a column of dates, and is understood by the service, which
understands those of files: a client that knew dates by itself would drop those that it does not know."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

#: A DataFrame, a two-dimensional array, a list of rows: a column for each asset. Also a text, or the path of a file.
Table: TypeAlias = Any

#: How a line ends that is the path of a file, and no returns.
_FILES = (".csv", ".tsv", ".txt")
#: What holders of numbers write where one is missing.
_MISSING = {"nan", "NaN", "NaT", "<NA>", "None"}
#: Midnight beside a day, maybe with an offset, says nothing more than the day.
_MIDNIGHT = re.compile(r"(?<=\d)[ T]00:00:00(\.0+)?([+-]\d\d:?\d\d|Z)?$")
#: Whole numbers that may be years.
_YEARS = range(1700, 2201)
#: The heading of dates, which the service knows whatever stands below it.
_DATE = "date"


@dataclass(frozen=True)
class Sheet:
    """A table of text, cell by cell."""

    #: A row for each entry; its cells are those of the columns, without the index.
    rows: list[list[str]]
    #: Headings of the columns, or the names of unnamed ones; ``None`` where nothing has a name.
    names: list[str] | None
    #: Whether the columns have headings, which may say what their numbers are.
    is_headed: bool
    #: A cell for each row, where the index is more than their numbers.
    index: list[str] | None

    def blank(self) -> tuple[int, int]:
        """How many rows before and after the numbers hold none, as the first of ``pct_change()`` does."""
        held = [any(row) for row in self.rows]
        return (held.index(True), held[::-1].index(True)) if any(held) else (0, 0)

    def text(self, names: Sequence[str] | None = None) -> str:
        """Lines of cells parted by tabs, under ``names`` or their own headings."""
        places = range(1 + (self.index is not None), len(self.rows[0]) + 2) if self.rows else ()
        own = self.names if self.is_headed else None
        if names is None and (own is not None or self.index is not None):
            names = own or [f"column {place}" for place in places]
        if self.index is None:
            # A blank line would be passed over, and the hole in the record with it.
            before, after = self.blank()
            held = self.rows[before : len(self.rows) - after]
            rows = [row if any(row) else ["NaN"] * len(row) for row in held]
        else:
            rows = [[date, *row] for date, row in zip(self.index, self.rows, strict=True)]
        heading = [] if names is None else [[*([_DATE] if self.index is not None else []), *names]]
        return "".join("\t".join(map(_quoted, row)) + "\n" for row in [*heading, *rows])


def sheet_of(source: Table | Sheet | str | PathLike[str], name: str = "returns") -> Sheet | str:
    """A text as it is, and that of a file (UTF-8, UTF-16 where its first bytes say so, or what Windows writes; a line
    that ends as the name of a file does is its path); of anything else its rows.

    Raises ``ValueError`` that names the argument, where it is none of these, or an index cannot be meant.
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
        # What was the index of a DataFrame.
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
    """A name as a heading, which a number alone would not be."""
    text = str(name)
    return text if any(letter.isalpha() for letter in text) else f"asset {text}"


def counts_rows(index: Any, name: str) -> bool:
    """Whether an index of pandas only numbers the rows, from 0 or, as that of a part of a record, from another number.

    Raises ``ValueError`` where it may as well be years.
    """
    if getattr(index, "inferred_type", None) != "integer" and len(index):
        return False
    if any(later != earlier + 1 for earlier, later in pairwise(index)):
        return False
    if not is_years(index):
        return True
    # Years are given as numbers one by one; rows are counted by a range.
    if hasattr(index, "step") and index.name is None:
        raise ValueError(
            f"the index of {name} goes from {index[0]} to {index[-1]}, which may be years or rows that are counted: "
            "must have the name 'year', or start from 0 (reset_index(drop=True))"
        )
    return False


def is_years(numbers: Any) -> bool:
    """Whether whole numbers that go up one by one may be years."""
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
    """The names of the columns of a DataFrame as texts; of several levels those by which the columns differ."""
    if getattr(frame.columns, "nlevels", 1) == 1:
        return [str(name) for name in frame.columns]
    levels = list(zip(*frame.columns, strict=True))
    telling = [level for level in levels if len(set(level)) > 1] or levels[:1]
    return [" ".join(str(part) for part in parts) for parts in zip(*telling, strict=True)]


def _cell(value: Any) -> str:
    text = str(value)
    return "" if text in _MISSING else _MIDNIGHT.sub("", text)


def _quoted(cell: str) -> str:
    """A cell that holds what could part cells stands in quotes."""
    return '"' + cell.replace('"', '""').replace("\n", " ") + '"' if re.search(r'[\s,;|"#]', cell) else cell


def _decoded(content: bytes) -> str:
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")
