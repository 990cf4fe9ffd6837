"""Returns in whatever holds numbers, as the log-returns the service takes. Nothing here imports pandas or NumPy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, Literal, TypeAlias

#: What the numbers are, with the names ``observe`` has for them.
Kind: TypeAlias = Literal["log", "simple", "price"]

#: A list, a tuple, a NumPy array, a pandas or polars Series, a DataFrame of one column.
Returns: TypeAlias = Any


def log_returns(returns: Returns, kind: Kind) -> list[float]:
    """``log``: as they are. ``simple``: ln(1 + R). ``price``: ln(P_i / P_(i-1)), oldest first, one fewer than prices.

    Raises ``ValueError`` that names the entry, its value and the rule.
    """
    numbers = [float(number) for number in _column(returns)]
    above = {"log": -math.inf, "simple": -1.0, "price": 0.0}.get(kind)
    if above is None:
        raise ValueError(f"kind is {kind!r}: must be 'log', 'simple' or 'price'")
    for index, number in enumerate(numbers):
        if not math.isfinite(number):
            raise ValueError(f"returns[{index}] is {number}: must be finite (drop missing values first)")
        if number <= above:
            raise ValueError(f"returns[{index}] is {number}: must be above {above:g}, since kind is {kind!r}")
    if kind == "log":
        return numbers
    if kind == "simple":
        return [math.log1p(number) for number in numbers]
    if not getattr(getattr(returns, "index", None), "is_monotonic_increasing", True):
        raise ValueError("the index of the prices is not increasing: prices must come oldest first")
    return [math.log(later / earlier) for earlier, later in pairwise(numbers)]


#: A DataFrame, a two-dimensional array, a list of rows: a column for each asset.
Table: TypeAlias = Any


def log_returns_of_assets(
    returns: Table, kind: Kind, assets: Sequence[str] | None = None
) -> tuple[list[str], list[list[float]]]:
    """Names and rows of log-returns, each column read as :func:`log_returns` reads one.

    Raises ``ValueError`` that names the asset, the entry, its value and the rule.
    """
    columns = getattr(returns, "columns", None)
    named = columns if assets is None else assets
    if named is None or (assets is not None and columns is not None):
        raise ValueError(f"assets is {assets}: must name the columns where returns is no DataFrame, and only there")
    names = [str(name) for name in named]
    rows = returns.to_numpy() if hasattr(returns, "to_numpy") else returns
    table = [[float(number) for number in row] for row in rows]
    for index, row in enumerate(table):
        if len(row) != len(names):
            raise ValueError(f"returns[{index}] has {len(row)} numbers: must have one for each of {names}")
    if kind == "price" and not getattr(getattr(returns, "index", None), "is_monotonic_increasing", True):
        raise ValueError("the index of the prices is not increasing: prices must come oldest first")
    each = []
    for asset, name in enumerate(names):
        try:
            each.append(log_returns([row[asset] for row in table], kind))
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    return names, [list(row) for row in zip(*each, strict=True)]


def days_of(returns: Returns) -> list[str] | None:
    """The days that the index of a pandas object names, one for each entry, as ``2008-01-31``; of a month or another
    span in a PeriodIndex the last. ``None`` where there is no index of dates."""
    index: Any = getattr(returns, "index", None)
    if getattr(index, "inferred_type", None) not in _DATED:
        return None
    return [day(date) for date in (index.to_timestamp(how="end") if hasattr(index, "to_timestamp") else index)]


#: What pandas calls the values of an index of dates.
_DATED = ("datetime64", "datetime", "date", "period")


def day(date: object) -> str:
    """A date, a time or a text as the service takes it: the day alone."""
    return str(date)[:10]


def per_period(name: str, values: Iterable[Any], periods: int, kind: Kind) -> list[Any]:
    """What was given for each entry of the returns, as one for each period: the first price has none.

    Raises ``ValueError`` that names the argument and the rule.
    """
    found, entries = list(values), periods + (kind == "price")
    if len(found) != entries:
        raise ValueError(f"{name} has {len(found)} entries: must have {entries}, one for each entry of returns")
    return found[entries - periods :]


def _column(returns: Returns) -> Iterable[Any]:
    """The one column of a table; anything else as it is."""
    shape: tuple[int, ...] = getattr(returns, "shape", (0,))
    if len(shape) == 1:
        values: Iterable[Any] = returns
        return values
    if len(shape) != 2 or shape[1] != 1:
        names = f", {list(returns.columns)}" if hasattr(returns, "columns") else ""
        raise ValueError(f"returns has the shape {shape}{names}: must be one column; choose it first")
    rows = returns.to_numpy() if hasattr(returns, "to_numpy") else returns
    return [row[0] for row in rows]
