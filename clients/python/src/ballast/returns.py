"""Returns in whatever holds numbers, as the log-returns the service takes. Nothing here imports pandas or NumPy.

What is learned from is read by the service (:func:`read`), so that a file, a paste and a Series mean the same
everywhere; what is reported of periods that passed is taken as it is said to be (:func:`log_returns`)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from os import PathLike
from pathlib import Path
from statistics import pstdev
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, cast

from . import wire
from .errors import UnclearReturns

if TYPE_CHECKING:
    from .transport import Transport

#: What the numbers are, with the names ``observe`` has for them.
Kind: TypeAlias = Literal["log", "simple", "price"]

#: A list, a tuple, a NumPy array, a pandas or polars Series, a DataFrame of one column.
Returns: TypeAlias = Any


#: Largest standard deviation of returns, a period, that is taken for what was meant: percents in the place of fractions
#: have more. So have the years of some single shares; as prices, which cannot be in percent, they have no such bound.
LARGEST_DEVIATION = 0.3


def log_returns(returns: Returns, kind: Kind, name: str = "returns") -> list[float]:
    """``log``: as they are. ``simple``: ln(1 + R). ``price``: ln(P_i / P_(i-1)), oldest first, one fewer than prices.

    Raises ``ValueError`` that names the argument (``name``), the entry, its value and the rule: numbers are finite,
    dates of an index increase, and returns do not deviate by more than :data:`LARGEST_DEVIATION`, as percents would.
    """
    numbers = [_number(number, f"{name}[{index}]") for index, number in enumerate(_column(returns, name))]
    above = {"log": -math.inf, "simple": -1.0, "price": 0.0}.get(kind)
    if above is None:
        raise ValueError(f"kind is {kind!r}: must be 'log', 'simple' or 'price'")
    for index, number in enumerate(numbers):
        if not math.isfinite(number):
            raise ValueError(f"{name}[{index}] is {number}: must be finite (drop missing values first)")
        if number <= above:
            raise ValueError(f"{name}[{index}] is {number}: must be above {above:g}, since kind is {kind!r}")
    _check_order(returns, kind, name)
    if kind == "price":
        return [math.log(later / earlier) for earlier, later in pairwise(numbers)]
    if len(numbers) > 1 and (deviation := pstdev(numbers)) > LARGEST_DEVIATION:
        raise ValueError(
            f"{name} has a standard deviation of {deviation:.3g} a period: must be at most {LARGEST_DEVIATION}, as "
            "fractions are, 0.01 for 1 % (give prices with kind='price' where so much is meant)"
        )
    return [math.log1p(number) for number in numbers] if kind == "simple" else numbers


#: A DataFrame, a two-dimensional array, a list of rows: a column for each asset. Also a text, or the path of a file.
Table: TypeAlias = Any


def text_of(source: str | PathLike[str] | Table) -> str:
    """A text as it is, that of a file (UTF-8, or UTF-16 where its first bytes say so; a line that ends as the name of
    one does is its path), a table of pandas as CSV, with its index where that holds dates, or numbers, a row a line."""
    if isinstance(source, str) and "\n" not in source and source.lower().endswith(_FILES):
        source = Path(source)
    if isinstance(source, PathLike):
        content = Path(source).read_bytes()
        return content.decode("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    if isinstance(source, str):
        return source
    if hasattr(source, "to_csv"):
        named = getattr(source, "columns", [getattr(source, "name", None)])
        headed = all(isinstance(name, str) for name in named)
        days = dates_of(source)
        dated = source if days is None else source.set_axis(days, axis="index")
        return str(dated.to_csv(index=days is not None, header=headed))
    held = source.to_numpy() if hasattr(source, "to_numpy") else source
    rows = held.tolist() if hasattr(held, "tolist") else held
    cells = [row if isinstance(row, Sequence) and not isinstance(row, str) else [row] for row in rows]
    return "\n".join("\t".join(str(cell) for cell in row) for row in cells)


def dates_of(returns: Returns) -> list[str] | None:
    """The dates in the index of a pandas object, one for each entry, as ``2008-01-31`` or ``2008-01``; of a span in a
    PeriodIndex the last day. ``None`` where there is no index of dates."""
    index: Any = getattr(returns, "index", None)
    kind = getattr(index, "inferred_type", None)
    if kind == "string" and len(index) and all(_DATE.match(text) for text in index):
        return [day(text) for text in index]
    if kind not in _DATED:
        return None
    return [day(date) for date in (index.to_timestamp(how="end") if hasattr(index, "to_timestamp") else index)]


#: How a line ends that is the path of a file, and no returns.
_FILES = (".csv", ".tsv", ".txt")
#: What pandas calls the values of an index of dates.
_DATED = ("datetime64", "datetime", "date", "period")
#: A month or a day, maybe with a time.
_DATE = re.compile(r"\d{4}-\d{2}(-\d{2}([ T].*)?)?$")


class Read(NamedTuple):
    """Returns as the service's reader takes them, and what stands beside them."""

    #: Log-returns, a list for each asset.
    series: list[list[float]]
    kind: Kind
    dates: list[str] | None
    periods_per_year: int | None
    #: What the bank paid in each period, where a column says so.
    rates: list[float] | None

    @property
    def rows(self) -> list[list[float]]:
        """A row for each period."""
        return [list(row) for row in zip(*self.series, strict=True)]


async def read(
    transport: Transport, source: Returns, kind: Kind | None, choices: wire.Choices | None, name: str = "returns"
) -> Read:
    """What the service reads, where that is one reading.

    ``kind`` and ``choices`` say what the source does not. Raises :class:`UnclearReturns` where it may be several
    readings, and ``ValueError`` where it is none; both name the argument.
    """
    _check_order(source, kind, name)
    reading = await _reading(transport, text_of(source), kind, choices)
    if reading["outcome"] == "asked":
        raise UnclearReturns(name, reading["questions"])
    if reading["outcome"] == "refused":
        raise ValueError(f"{name}: {reading['sentence']}")
    series, paid = reading["series"], reading.get("rate")
    return Read(
        [one["log_returns"] for one in series],
        series[0]["kind"],
        reading.get("dates"),
        reading.get("periods_per_year"),
        None if paid is None else paid["rates"],
    )


async def _reading(transport: Transport, text: str, kind: Kind | None, choices: wire.Choices | None) -> wire.Reading:
    said = {**(choices or {}), **({} if kind is None else {"kind": kind})}
    return cast(wire.Reading, await transport.json("POST", "/returns", body={"text": text, "choices": said}))


async def read_assets(
    transport: Transport,
    source: Table,
    kind: Kind | None,
    choices: wire.Choices | None,
    assets: Sequence[str] | None,
    name: str = "returns",
) -> tuple[list[str], Read]:
    """The names of several assets, and what the service reads of each, as :func:`read`.

    ``assets`` names the columns of rows, or chooses among those of a DataFrame, of a text or of a file; by default all
    that hold neither dates nor the rates of the bank.
    """
    columns = getattr(source, "columns", None)
    if columns is not None and not hasattr(source, "set_axis"):
        # A table of polars: rows, and their names.
        source, assets, columns = source.to_numpy(), list(columns) if assets is None else assets, None
    if assets is None:
        if columns is None and not isinstance(source, str | PathLike):
            raise ValueError(f"assets is None: must name the columns where {name} is no DataFrame, text or file")
        assets = await _assets_of(transport, source, kind, choices, name)
    names = [str(each) for each in assets]
    if twice := next((each for place, each in enumerate(names) if each in names[:place]), None):
        raise ValueError(f"assets has {twice!r} twice: each asset must have a name of its own")
    if columns is not None:
        source = source.set_axis([_heading(column) for column in columns], axis="columns")
    elif not isinstance(source, str | PathLike):
        rows = [list(row) for row in source]
        for index, row in enumerate(rows):
            if len(row) != len(names):
                raise ValueError(f"{name}[{index}] has {len(row)} numbers: must have one for each of {names}")
        source = text_of([[_heading(each) for each in names], *rows])
    chosen: wire.Choices = {**(choices or {}), "columns": [_heading(each) for each in names]}
    return names, await read(transport, source, kind, chosen, name)


async def _assets_of(
    transport: Transport, source: Table, kind: Kind | None, choices: wire.Choices | None, name: str
) -> list[str]:
    """The columns that hold neither dates nor rates, as the service's reader tells them."""
    columns = getattr(source, "columns", None)
    if columns is None:
        places, headed = None, source
    else:
        places = [str(column) for column in columns]
        headed = source.set_axis([_heading(column) for column in columns], axis="columns")
    reading = await _reading(transport, text_of(headed), kind, choices)
    if reading["outcome"] == "refused":
        raise ValueError(f"{name}: {reading['sentence']}")
    found = [column["name"] for column in reading["columns"] if column["holds"] == "values"]
    if not found and reading["outcome"] == "asked":
        raise UnclearReturns(name, reading["questions"])
    return found if places is None else [place for place in places if _heading(place) in found]


def _heading(asset: object) -> str:
    """The name of an asset as a heading, which a number alone would not be."""
    name = str(asset)
    return name if any(letter.isalpha() for letter in name) else f"asset {name}"


def day(date: object) -> str:
    """A date, a time or a text as the service takes it: the day alone."""
    return str(date)[:10]


def per_period(name: str, values: Iterable[Any], returns: Returns, periods: int, kind: Kind) -> list[Any]:
    """What was given for each entry of the returns, as one for each period: the first price has none, and neither have
    entries before and after the numbers that hold none.

    Raises ``ValueError`` that names the argument and the rule: as many entries, and the same index where both have one.
    """
    found, (before, after) = list(values), _blank(returns)
    last = before + (kind == "price") + periods
    if len(found) != last + after:
        raise ValueError(f"{name} has {len(found)} entries: must have {last + after}, one for each entry of returns")
    own: Any = getattr(values, "index", None)
    index: Any = getattr(returns, "index", None)
    if hasattr(own, "equals") and hasattr(index, "equals") and not own.equals(index):
        raise ValueError(f"{name} has another index than returns: align the two first")
    return found[last - periods : last]


def _blank(returns: Returns) -> tuple[int, int]:
    """How many entries of a pandas object before and after its numbers hold none, as the first of ``pct_change()``
    does: the service leaves them out."""
    if not hasattr(returns, "notna"):
        return 0, 0
    held = returns.notna()
    rows: list[bool] = (held.any(axis="columns") if hasattr(held, "columns") else held).tolist()
    return (rows.index(True), rows[::-1].index(True)) if any(rows) else (0, 0)


def _number(value: Any, place: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{place} is {value!r}: must be a number") from None


def _check_order(returns: Returns, kind: Kind | None, name: str) -> None:
    """Dates increase; where the index has none, prices must still come in its order."""
    index: Any = getattr(returns, "index", None)
    dates = dates_of(returns)
    if dates is None:
        if kind == "price" and not getattr(index, "is_monotonic_increasing", True):
            raise ValueError("the index of the prices is not increasing: prices must come oldest first")
        return
    for place, (earlier, later) in enumerate(pairwise(index), start=1):
        if earlier == later:
            raise ValueError(f"the index of {name} has {dates[place]} twice: must have each date once")
        if not earlier < later:
            raise ValueError(
                f"the index of {name} has {dates[place]} after {dates[place - 1]}: dates must increase (sort_index)"
            )


def _column(returns: Returns, name: str) -> Iterable[Any]:
    """The one column of a table; anything else as it is."""
    shape: tuple[int, ...] = getattr(returns, "shape", (0,))
    if len(shape) == 1:
        values: Iterable[Any] = returns
        return values
    if len(shape) != 2 or shape[1] != 1:
        names = f", {list(returns.columns)}" if hasattr(returns, "columns") else ""
        raise ValueError(f"{name} has the shape {shape}{names}: must be one column; choose it first")
    rows = returns.to_numpy() if hasattr(returns, "to_numpy") else returns
    return [row[0] for row in rows]
