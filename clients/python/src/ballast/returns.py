"""Converts returns from lists, arrays, tables and files to log-returns. Nothing here imports pandas or NumPy.

The service reads the records that it learns from (:func:`read`), so that a file, a paste and a Series mean the same
everywhere. Reports of past periods are converted here, as the caller's ``kind`` says (:func:`log_returns`)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from statistics import pstdev
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, cast

from . import wire
from .errors import UnclearReturns
from .sheet import Sheet, Table, counts_rows, heading, is_years, sheet_of

if TYPE_CHECKING:
    from .transport import Transport

#: What the numbers are, by the names that ``observe`` uses.
Kind: TypeAlias = Literal["log", "simple", "price"]

#: A list, a tuple, a NumPy array, a pandas or polars Series, a DataFrame of one column.
Returns: TypeAlias = Any


#: Largest standard deviation of returns per period that is accepted. Percents instead of fractions exceed it. So do the
#: yearly returns of some single shares. Give those as prices, which cannot be in percent and have no such bound.
LARGEST_DEVIATION = 0.3


def log_returns(returns: Returns, kind: Kind, name: str = "returns") -> list[float]:
    """Returns log-returns. ``log``: unchanged. ``simple``: ln(1 + R). ``price``: ln(P_i / P_(i-1)), oldest first.

    Prices give one fewer return than there are prices. Raises ``ValueError``, which names the argument (``name``), the
    entry, its value and the rule: numbers are finite, dates of an index increase, and returns have a standard deviation
    of at most :data:`LARGEST_DEVIATION`, which percents would exceed.
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
    check_order(returns, name)
    if kind == "price":
        return [math.log(later / earlier) for earlier, later in pairwise(numbers)]
    if len(numbers) > 1 and (deviation := pstdev(numbers)) > LARGEST_DEVIATION:
        raise ValueError(
            f"{name} has a standard deviation of {deviation:.3g} a period: must be at most {LARGEST_DEVIATION}; give "
            "fractions, 0.01 for 1 %, or, if the returns do vary so much, prices with kind='price'"
        )
    return [math.log1p(number) for number in numbers] if kind == "simple" else numbers


def dates_of(returns: Returns, name: str = "returns") -> list[str] | None:
    """Returns the dates in the index of a pandas object, one for each entry, as ``2008-01-31`` or ``2008-01``.

    A span in a PeriodIndex gives its last day. Returns ``None`` if the index only counts rows, or there is none. Raises
    ``ValueError`` for any other index, because it would not show which row is the oldest.
    """
    index: Any = getattr(returns, "index", None)
    kind = getattr(index, "inferred_type", None)
    if kind is None:
        return None
    if kind == "string" and len(index) and all(_DATE.match(text) for text in index):
        return [day(text) for text in index]
    if kind in _DATED:
        return [day(date) for date in (index.asfreq("D", how="end") if hasattr(index, "to_timestamp") else index)]
    if counts_rows(index, name):
        return None
    if kind == "integer" and is_years(index):
        return [f"{year}-12-31" for year in index]
    raise ValueError(
        f"the index of {name} begins with {index[0]}: must hold dates (pandas.to_datetime makes them), or count the "
        "rows, oldest first (reset_index(drop=True))"
    )


#: What pandas calls the values of an index of dates.
_DATED = ("datetime64", "datetime", "date", "period")
#: A month or a day, maybe with a time.
_DATE = re.compile(r"\d{4}-\d{2}(-\d{2}([ T].*)?)?$")


class LogReturns(list[Any]):
    """Log-returns that the service returned: a number for each period, or a row for several assets. Wherever you pass
    them as returns, they are used unchanged, bit for bit."""


class Read(NamedTuple):
    """Returns as the service read them, with their dates and the rates of the bank."""

    #: A sentence that says what was read, for a person to check.
    sentence: str
    #: Log-returns, a list for each asset, ``None`` before its first one.
    series: list[list[Any]]
    kind: wire.Kind
    dates: list[str] | None = None
    periods_per_year: int | None = None
    #: What the bank paid in each period, if there is a column of rates.
    rates: list[float] | None = None
    #: Whether the newest row came first, so that the rows were reversed.
    is_turned: bool = False

    @property
    def rows(self) -> list[list[float | None]]:
        """Returns a row for each period."""
        return [list(row) for row in zip(*self.series, strict=True)]


async def read(
    transport: Transport,
    source: Returns,
    kind: Kind | None,
    choices: wire.Choices | None,
    name: str = "returns",
    assets: Sequence[str] | None = None,
) -> Read:
    """Returns what the service reads in the source, if there is exactly one reading.

    ``kind`` and ``choices`` add what the source does not show, and ``assets`` are the headings of its columns. Raises
    :class:`UnclearReturns` if several readings are possible, and ``ValueError`` if none is. Both name the argument.
    """
    if isinstance(source, LogReturns):
        return _as_returned(source, kind, name)
    reading = await reading_of(transport, source, kind, choices, name, assets)
    if reading["outcome"] == "asked":
        raise UnclearReturns(name, reading["questions"])
    if reading["outcome"] == "refused":
        raise ValueError(f"{name}: {reading['sentence']}")
    series, paid = reading["series"], reading.get("rate")
    return Read(
        reading["sentence"],
        [[None] * one.get("missing", 0) + one["log_returns"] for one in series],
        series[0]["kind"],
        reading.get("dates"),
        reading.get("periods_per_year"),
        None if paid is None else paid["rates"],
        reading["newest_first"],
    )


def _as_returned(returns: LogReturns, kind: Kind | None, name: str) -> Read:
    if kind not in (None, "log"):
        raise ValueError(f"kind is {kind!r}: must be 'log' or left out, because {name} are log-returns of the service")
    rows = [row if isinstance(row, list) else [row] for row in returns]
    return Read(
        f"{len(rows)} log-returns as fractions, as the service returned them.",
        [list(column) for column in zip(*rows, strict=True)],
        "log",
    )


async def reading_of(
    transport: Transport,
    source: Returns,
    kind: Kind | None,
    choices: wire.Choices | None,
    name: str = "returns",
    assets: Sequence[str] | None = None,
) -> wire.Reading:
    """Returns the reading of the service.

    If returns have no heading, the reading also contains the question whether they are simple or log-returns, because
    the two look alike. The same holds for a ``history`` under any heading, because the service's own histories are of
    log-returns.
    """
    held = sheet_of(source, name)
    text = held if isinstance(held, str) else held.text(assets)
    given: wire.Choices = {**(choices or {})}
    if kind is not None:
        given["kind"] = kind
    reading = await _reading(transport, text, given)
    if isinstance(held, str) or "kind" in given or (held.is_headed and name != "history"):
        return reading
    if reading["outcome"] == "read":
        questions: list[wire.Question] = []
        is_open = reading["series"][0]["kind"] == "simple"
    else:
        questions = reading["questions"] if reading["outcome"] == "asked" else []
        is_open = any(question["asks"] == "unit" for question in questions)
    if not is_open:
        return reading
    options = [await _meaning(transport, text, given, "simple"), await _meaning(transport, text, given, "log")]
    kind_question: wire.Question = {
        "asks": "kind",
        "question": "Are these simple returns, or log-returns? They look alike.",
        "options": options,
    }
    columns = [] if reading["outcome"] == "refused" else reading["columns"]
    return {"outcome": "asked", "questions": [kind_question, *questions], "columns": columns}


async def _meaning(transport: Transport, text: str, given: wire.Choices, kind: Literal["simple", "log"]) -> wire.Answer:
    """Returns one possible answer to the question of the kind, with the reading that would follow."""
    reading = await _reading(transport, text, {**given, "kind": kind})
    answer: wire.Answer = {"label": {"simple": "Simple", "log": "Logarithms"}[kind], "choices": {"kind": kind}}
    if reading["outcome"] == "read":
        answer["sentence"] = reading["sentence"]
    return answer


async def _reading(transport: Transport, text: str, given: wire.Choices) -> wire.Reading:
    return cast(wire.Reading, await transport.json("POST", "/returns", body={"text": text, "choices": given}))


async def read_assets(
    transport: Transport,
    source: Table,
    kind: Kind | None,
    choices: wire.Choices | None,
    assets: Sequence[str] | None,
    name: str = "returns",
) -> tuple[list[str], Read]:
    """Returns the names of several assets, and the reading of their returns as :func:`read` does.

    ``assets`` names the columns of rows, or selects columns of a table, a text or a file. By default it selects all
    that hold neither dates nor the rates of the bank.
    """
    held = source if isinstance(source, LogReturns) else sheet_of(source, name)
    columns = held.names if isinstance(held, Sheet) else None
    if assets is None:
        if isinstance(held, LogReturns) or (columns is None and not isinstance(held, str)):
            raise ValueError(f"assets is None: must name the columns because {name} is no DataFrame, text or file")
        assets = await _assets_of(transport, held, kind, choices, name)
    names = [str(each) for each in assets]
    if twice := next((each for place, each in enumerate(names) if each in names[:place]), None):
        raise ValueError(f"assets has {twice!r} twice: must name each asset once")
    if columns is None and not isinstance(held, str):
        for index, row in enumerate(held if isinstance(held, LogReturns) else held.rows):
            if len(row) != len(names):
                raise ValueError(f"{name}[{index}] has {len(row)} numbers: must have one for each of {names}")
    if isinstance(held, LogReturns):
        return names, await read(transport, held, kind, choices, name)
    headings = [heading(each) for each in names]
    chosen: wire.Choices = {**(choices or {}), "columns": headings}
    if isinstance(held, str):
        return names, await read(transport, held, kind, chosen, name)
    own = headings if columns is None else [heading(each) for each in columns]
    return names, await read(transport, held, kind, chosen, name, own)


async def _assets_of(
    transport: Transport, held: Sheet | str, kind: Kind | None, choices: wire.Choices | None, name: str
) -> list[str]:
    """Returns the columns that, as the service reads them, hold neither dates nor rates."""
    names = None if isinstance(held, str) else held.names
    own = None if names is None else [heading(each) for each in names]
    reading = await reading_of(transport, held, kind, choices, name, own)
    if reading["outcome"] == "refused":
        raise ValueError(f"{name}: {reading['sentence']}")
    found = [column["name"] for column in reading["columns"] if column["holds"] == "values"]
    if not found and reading["outcome"] == "asked":
        raise UnclearReturns(name, reading["questions"])
    if reading["outcome"] == "read":
        # A known heading marks one column as the only asset, as in a file.
        read = [one["column"] for one in reading["series"]]
        if len(read) < len(found) and len(read) == 1:
            raise ValueError(f"{name} holds one asset, in column {read[0]}: assets must name several columns")
    return found if names is None else [each for each in names if heading(each) in found]


def day(date: object) -> str:
    """Returns the day of a date, a time or a text, as the service accepts it."""
    return str(date)[:10]


def per_period(
    name: str, values: Iterable[Any], returns: Returns, periods: int, kind: wire.Kind, is_turned: bool = False
) -> list[Any]:
    """Returns one value for each period, oldest first, from one for each entry of the returns.

    The first price has no period, and neither have empty entries before and after the numbers. Raises ``ValueError``,
    which names the argument and the rule: as many entries, and the same index if both have one.
    """
    found, (before, after) = list(values), _blank(returns)
    last = before + (kind in ("price", "cumulated")) + periods
    if len(found) != last + after:
        raise ValueError(f"{name} has {len(found)} entries: must have {last + after}, one for each entry of returns")
    check_aligned(name, values, returns)
    return found[before : before + periods][::-1] if is_turned else found[last - periods : last]


def check_aligned(name: str, values: Any, returns: Returns) -> None:
    """Raises ``ValueError`` if both have an index and the two differ."""
    own: Any = getattr(values, "index", None)
    index: Any = getattr(returns, "index", None)
    if hasattr(own, "equals") and hasattr(index, "equals") and not own.equals(index):
        raise ValueError(f"{name} has another index than returns: align the two first")


def _blank(returns: Returns) -> tuple[int, int]:
    """Counts the empty entries before and after the numbers, which the service leaves out."""
    if isinstance(returns, LogReturns) or not hasattr(returns, "__len__"):
        return 0, 0
    held = sheet_of(returns)
    return (0, 0) if isinstance(held, str) else held.blank()


def _number(value: Any, place: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{place} is {value!r}: must be a number") from None


def check_order(returns: Returns, name: str = "returns") -> None:
    """Raises ``ValueError`` if the index holds dates that do not increase."""
    index: Any = getattr(returns, "index", None)
    dates = dates_of(returns, name)
    if dates is None:
        return
    for place, (earlier, later) in enumerate(pairwise(index), start=1):
        if earlier == later:
            raise ValueError(f"the index of {name} has {dates[place]} twice: must have each date once")
        if not earlier < later:
            raise ValueError(
                f"the index of {name} has {dates[place]} after {dates[place - 1]}: dates must increase (sort_index)"
            )


def _column(returns: Returns, name: str) -> Iterable[Any]:
    """Returns the only column of a table, and anything else unchanged."""
    shape: tuple[int, ...] = getattr(returns, "shape", (0,))
    if len(shape) == 1:
        values: Iterable[Any] = returns
        return values
    if len(shape) != 2 or shape[1] != 1:
        names = f", {list(returns.columns)}" if hasattr(returns, "columns") else ""
        raise ValueError(f"{name} has the shape {shape}{names}: must be one column; choose it first")
    rows = returns.to_numpy() if hasattr(returns, "to_numpy") else returns
    return [row[0] for row in rows]
