"""Turns a record into one report for each period. Every report is built and checked before the first is sent."""

from __future__ import annotations

import calendar
import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from . import frames, wire
from .returns import Kind, Returns, check_aligned, check_order, dates_of, day, log_returns, per_period
from .sheet import Sheet, Table, sheet_of

if TYPE_CHECKING:
    import pandas as pd

#: One number for all periods, or one for each entry of the returns.
Numbers: TypeAlias = float | Sequence[float]


def reports(
    returns: Returns,
    kind: Kind,
    dates: Iterable[object] | None,
    rate: Numbers | None,
    flow: Numbers | None,
    executed_allocation: Numbers | Table | None,
    assets: Sequence[str] | None = None,
) -> list[wire.Report]:
    """Returns the report of each period, by the names of ``assets`` if there are several.

    Raises ``ValueError``, which names the argument and the rule.
    """
    fields: dict[str, list[Any]] = {}
    if assets is None:
        record = log_returns(returns, kind)
        fields["log_return"] = record
    else:
        columns = _by_asset("returns", returns, assets)
        logs = {name: log_returns(column, kind, f"returns of {name}") for name, column in columns.items()}
        record = logs[assets[0]]
        fields["log_returns"] = [dict(zip(logs, row, strict=True)) for row in zip(*logs.values(), strict=True)]
        if executed_allocation is not None:
            check_aligned("executed_allocation", executed_allocation, returns)
            held = _by_asset("executed_allocation", executed_allocation, assets)
            shares = {
                name: _numbers(f"executed_allocation of {name}", column, returns, len(record), kind)
                for name, column in held.items()
            }
            executed_allocation = None
            fields["executed_allocations"] = [
                dict(zip(shares, row, strict=True)) for row in zip(*shares.values(), strict=True)
            ]
    check_order(returns)
    days = dates_of(returns) if dates is None else [day(date) for date in dates]
    if days is not None:
        fields["date"] = per_period("dates", map(_last_day, days), returns, len(record), kind)
        for earlier, later in pairwise(fields["date"]):
            if not earlier < later:
                raise ValueError(f"dates has {later} after {earlier}: must increase")
    for name, values in (("rate", rate), ("flow", flow), ("executed_allocation", executed_allocation)):
        if values is not None:
            fields[name] = _numbers(name, values, returns, len(record), kind)
    return [cast(wire.Report, dict(zip(fields, row, strict=True))) for row in zip(*fields.values(), strict=True)]


def has_columns(returns: Returns) -> bool:
    """Tells whether there is more than one column."""
    if not hasattr(returns, "__len__") or isinstance(returns, str):
        return False
    held = sheet_of(returns)
    return isinstance(held, Sheet) and any(len(row) > 1 for row in held.rows)


def _by_asset(name: str, table: Table, assets: Sequence[str]) -> dict[str, list[Any]]:
    """Returns the columns of a table by the names of the assets, in the order of the assets."""
    held = sheet_of(table, name)
    assert isinstance(held, Sheet)
    names = list(assets) if held.names is None else held.names
    if sorted(names) != sorted(assets):
        raise ValueError(f"{name} has the columns {names}: must have those of the session, {list(assets)}")
    for number, row in enumerate(held.rows):
        if len(row) != len(names):
            raise ValueError(f"{name}[{number}] has {len(row)} numbers: must have one for each of {names}")
    columns = dict(zip(names, map(list, zip(*held.rows, strict=True)), strict=True))
    return {asset: columns[asset] for asset in assets}


def replayed_rows(history: wire.History, period: int, returns: Returns, kind: Kind, count: int) -> pd.DataFrame:
    """Returns the rows of a history from ``period`` on, under the index of ``returns`` if it is a pandas object."""
    rows = frames.history(history, as_of="then").loc[period : period + count - 1].drop(columns="corrected")
    if not hasattr(returns, "iloc"):
        return rows
    return rows.reset_index().set_axis(returns.index[kind == "price" :], axis="index")


def _last_day(date: str) -> str:
    """Returns the last day of a month, and a day unchanged."""
    year, _, month = date.partition("-")
    return date if len(month) != 2 else f"{date}-{calendar.monthrange(int(year), int(month))[1]}"


def _numbers(name: str, values: Numbers, returns: Returns, periods: int, kind: Kind) -> list[float]:
    each = per_period(name, values, returns, periods, kind) if isinstance(values, Iterable) else [values] * periods
    found = [float(value) for value in each]
    for number, value in enumerate(found, start=1):
        if not math.isfinite(value):
            raise ValueError(f"{name} of period {number} is {value}: must be finite")
    return found
