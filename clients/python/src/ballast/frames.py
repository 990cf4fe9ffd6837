"""Converts answers of the service to pandas objects.

Each function takes the JSON of a call, or of a file such as the ``report.json`` that ``ballast backtest`` writes, and
does not change it. pandas is imported only when a function is called. If it is missing, the call raises ``ImportError``
and says what to install.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, cast

from . import wire

if TYPE_CHECKING:
    import pandas as pd

#: The answers that contain a worst law: ``Ballast.advise``, ``Session.action(explain="worst_case")``, a what-if.
Explained: TypeAlias = wire.Advised | wire.AssetAction | wire.WhatIfPoint

#: The figures of a walk-forward that have a value for each period.
Figure: TypeAlias = Literal["wealth", "allocation", "low", "high", "radius", "traded"]
#: The figures of a session of several assets that have a value for each asset.
AssetsFigure: TypeAlias = Literal["simple_return", "log_return", "advised_allocation", "executed_allocation", "holding"]


def history(history: wire.History, as_of: Literal["now", "then"] = "now") -> pd.DataFrame:
    """Returns the result of ``Session.history`` as a table with a row for each observed period, indexed by the period.

    ``date`` is the last day of the period, ``NaT`` if none was reported. ``log_return`` and ``simple_return`` are NaN
    if the return is missing. ``advised_allocation``, ``executed_allocation`` and ``holding`` are shares of wealth.
    ``wealth`` is an amount of money, and ``radius`` is a log-return. ``wealth``, ``holding`` and ``radius`` are values
    after the period. With ``as_of="now"`` all columns include every correction; with ``"then"`` they are what the
    service answered at the time. ``corrected`` marks the rows where the two may differ.

    ``rate`` is what the bank paid, ``flow`` the money added and ``spent`` the money spent at the start. ``turnover`` is
    the share of wealth that was traded, and ``cost`` the money that it cost. ``equal_weights``,
    ``initial_composition`` and ``bank`` are the wealth of somebody who began with the same wealth and holdings and held
    equal shares of all assets, the first composition of the fund, or nothing. These columns always include every
    correction. Raises ``ImportError`` without pandas.
    """
    pd = require_pandas()
    rows = []
    for observation in history["observations"]:
        changed = observation.get("now")
        row: Mapping[str, Any] = observation if as_of == "then" or changed is None else changed
        reported = row.get("reported") or observation["reported"]
        account: Mapping[str, Any] = observation["account"]
        log_return = _log_return(row, None if history.get("assets") is None else _ALL)
        benchmarks = {name: math.nan if value is None else value for name, value in account["benchmarks"].items()}
        rows.append(
            {
                "period": observation["period"],
                "date": reported.get("date"),
                "log_return": log_return,
                "simple_return": math.expm1(log_return),
                **{name: row[name] for name in _STANDING},
                **{name: account.get(name, 0.0) for name in _ACCOUNT},
                **benchmarks,
                "corrected": changed is not None,
            }
        )
    columns = ["period", "date", "log_return", "simple_return", *_STANDING, *_ACCOUNT, *_BENCHMARKS, "corrected"]
    frame = pd.DataFrame(rows, columns=columns).set_index("period")
    return frame.assign(date=pd.to_datetime(frame["date"]))


def declared_history(history: wire.DeclaredHistory) -> pd.DataFrame:
    """Returns the result of ``Session.history`` of a declared problem as a table with a row for each observed period,
    indexed by the period, with every correction.

    ``date`` is the last day of the period, ``NaT`` if it is not known. ``noise`` is NaN if it is missing, and so is
    ``reward``, what the period earned. ``earned`` are the rewards since the start, discounted to it. For each action
    there are ``advised.<name>``, NaN if nothing was advised, and ``executed.<name>``, and for each state
    ``state.<name>``, its value after the period. Raises ``ImportError`` without pandas.
    """
    pd = require_pandas()
    rows = []
    for observation in history["observations"]:
        now, answered = observation["now"], observation["answered"]
        advised = (answered["advised"] if answered else None) or {}
        row: dict[str, Any] = {"period": observation["period"], "date": now["date"]}
        row |= {name: cast(dict[str, Any], now)[name] for name in ("noise", "reward", "earned")}
        for name, value in now["executed"].items():
            row |= {f"advised.{name}": advised.get(name), f"executed.{name}": value}
        rows.append(row | {f"state.{name}": value for name, value in now["state"].items()})
    frame = pd.DataFrame(rows, columns=None if rows else ["period", "date"]).set_index("period")
    dates = pd.to_datetime(frame.pop("date"))
    frame = frame.astype(float)
    frame.insert(0, "date", dates)
    return frame


def assets_history(
    history: wire.History, figure: AssetsFigure = "simple_return", as_of: Literal["now", "then"] = "now"
) -> pd.DataFrame:
    """Returns one figure of a session of several assets, with a row for each observed period and a column for each
    asset that the session has or had.

    ``simple_return`` and ``log_return`` include every correction unless ``as_of`` is ``"then"``, and are NaN if they
    are missing: a total loss is a simple return of -1. ``advised_allocation``, ``executed_allocation`` and ``holding``
    (after the period) are shares of wealth as the service answered at the time. Raises ``ValueError`` for another
    figure and for a session of one asset, and ``ImportError`` without pandas.
    """
    assets = history.get("assets")
    if not assets:
        raise ValueError("history is of one asset: use frames.history")
    if figure not in _ASSETS_FIGURES:
        raise ValueError(f"figure is {figure!r}: must be one of {', '.join(_ASSETS_FIGURES)}")
    for renewal in history["renewals"]:
        assets = [*assets, *(name for name in renewal.get("names") or [] if name not in assets)]
    rows = []
    for observation in history["observations"]:
        row = cast(dict[str, Any], observation)
        if as_of == "now" and figure.endswith("return") and row.get("now") is not None:
            row = row["now"]
        values = row["assets"].get(_ASSETS_FIGURES[figure]) or {}
        if figure.endswith("return"):
            values = {name: _log_return({**row, "log_return": value}, name) for name, value in values.items()}
        rows.append(values)
    pd = require_pandas()
    index = pd.Index([observation["period"] for observation in history["observations"]], name="period")
    frame = pd.DataFrame(rows, index=index, columns=assets, dtype=float)
    return frame.map(math.expm1) if figure == "simple_return" else frame


_ASSETS_FIGURES = {
    "simple_return": "log_returns",
    "log_return": "log_returns",
    "advised_allocation": "advised_allocations",
    "executed_allocation": "executed_allocations",
    "holding": "holdings",
}
_STANDING = ("advised_allocation", "executed_allocation", "wealth", "holding", "radius")
_ACCOUNT = ("rate", "flow", "spent", "turnover", "cost")
_BENCHMARKS = ("equal_weights", "initial_composition", "bank")
#: Stands for all assets that are held.
_ALL = "*"


def _log_return(row: Mapping[str, Any], asset: str | None) -> float:
    """Returns the log-return of a row: NaN if it is missing, and minus infinity after a total loss, which JSON writes
    as null. Of all assets together a null is a loss only if some return is known."""
    value = row.get("log_return")
    if value is not None:
        return float(value)
    if asset == _ALL:
        return -math.inf if (row.get("assets") or {}).get("log_returns") else math.nan
    notes = row.get("notes") or []
    lost = any(note["reason"] == "total_loss" and note.get("asset") == asset for note in notes)
    return -math.inf if lost else math.nan


def worst_case(advice: Explained) -> pd.DataFrame:
    """Returns the worst law that an advice is robust against, as a transport of probability.

    In each row the probability ``mass`` moves from the observed log-return ``atom`` to ``moved_to``. So ``moved_to``
    with the weights ``mass`` is the worst law, and ``atom`` with the same weights is the learned law. Raises
    ``ValueError`` if the advice has no worst law (``Session.action`` needs ``explain="worst_case"``) or if that law is
    normal, which is no transport; and ``ImportError`` without pandas.
    """
    law = advice.get("worst_case")
    if law is None:
        raise ValueError("the advice has no worst_case: ask for it with explain='worst_case'")
    if not law["transport"]:
        raise ValueError("the worst law is normal, not a transport: see advice['worst_case']['normal']")
    return require_pandas().DataFrame(law["transport"], columns=["atom", "moved_to", "mass"])


def allocation(advised: wire.AssetsAdvised | wire.AssetsAction | wire.AssetsWhatIfPoint) -> pd.Series[float]:
    """Returns the advised share of wealth in each asset, by its name, in no particular order. The rest is in the bank.

    ``advised`` is an answer of ``Ballast.advise_assets``, ``Session.assets_action`` or ``Session.assets_what_if``.
    Raises ``ImportError`` without pandas.
    """
    return require_pandas().Series(advised["allocation"], name="allocation", dtype=float)


def figures(advised: Explained | wire.AssetsAdvised | wire.AssetsAction | wire.AssetsWhatIfPoint) -> pd.Series[float]:
    """Returns the single numbers of an advice by the name of their field: ``certainty_equivalent``, ``floor``,
    ``radius`` and so on.

    For several assets ``total`` is the share of wealth in all of them together. ``without_crash``, if
    ``Ballast.advise_assets`` returns it, is what ``total`` would be if no return could fall below the lowest observed
    one. Raises ``ImportError`` without pandas.
    """
    numbers = {name: value for name, value in advised.items() if type(value) in (int, float)}
    return require_pandas().Series(numbers, name="figure", dtype=float)


def worst_means(advised: wire.AssetsAdvised) -> pd.DataFrame:
    """Returns the mean log-return of each asset, as ``seen`` and under the ``worst`` law, with a row for each asset.

    If ``problem.means`` moves the means, the column ``believed`` has those at the centre of the ball.
    Raises ``ImportError`` without pandas.
    """
    table = require_pandas().DataFrame.from_dict(advised["worst_means"], orient="index")
    return table[[name for name in ("seen", "believed", "worst") if name in table]]


def sessions(entries: Iterable[wire.SessionEntry]) -> pd.DataFrame:
    """Returns the sessions of ``Ballast.sessions``, a row for each in the order of the list, indexed by the identifier.

    The columns are the fields of an entry except ``notes``. ``wealth`` and ``wealth_change`` are amounts of money,
    ``holding`` is a share of wealth, and ``date`` is the last reported day. ``created`` and ``last_report`` are times
    in UTC. Missing values are NaN or ``NaT``. Raises ``ImportError`` without pandas.
    """
    pd = require_pandas()
    frame = pd.DataFrame(list(entries), columns=["session", *_LISTED, "date", "created_ms", "last_report_ms"])
    frame = frame.set_index("session")
    times = {name: pd.to_datetime(frame.pop(f"{name}_ms"), unit="ms", utc=True) for name in ("created", "last_report")}
    numbers = {name: frame[name].astype(float) for name in ("wealth_change", "periods_per_year")}
    return frame.assign(date=pd.to_datetime(frame["date"]), **times, **numbers)


_LISTED = (
    "name",
    "tags",
    "policy",
    "policy_name",
    "periods_per_year",
    "period",
    "horizon",
    "state",
    "drift",
    "initial_wealth",
    "wealth",
    "wealth_change",
    "holding",
)


def walk_forward(report: wire.BacktestReport | wire.AssetsBacktestReport) -> pd.DataFrame:
    """Returns the strategies of a walk-forward, a row for each by its name, with the figures of the report as columns.

    A figure with an interval has two more columns for its ends, with the suffixes ``_low`` and ``_high``. Returns,
    volatilities and shares are fractions. Certainty equivalents and wealth are for an initial wealth of 100.
    :func:`held` shows what was held of each of several assets. Raises ``ImportError`` without pandas.
    """
    rows = []
    for figures in report["strategies"]:
        row: dict[str, Any] = {}
        for name, value in cast(dict[str, Any], figures).items():
            if name == "mean_allocations":
                continue
            row |= _estimate(name, value) if isinstance(value, Mapping) else {name: value}
        rows.append(row)
    return require_pandas().DataFrame(rows).set_index("strategy")


def periods(report: wire.BacktestReport | wire.AssetsBacktestReport, figure: Figure = "wealth") -> pd.DataFrame:
    """Returns one figure of a walk-forward, with a row for each period and a column for each strategy.

    ``wealth`` is at the end of the period, for an initial wealth of 100. ``allocation``, the ends ``low`` and ``high``
    of the no-trade range and ``traded`` are shares of wealth. ``radius`` is a log-return. The index has the dates of
    the periods, with a month as its first day, or counts from 1 if there are no dates. Raises ``ValueError`` for
    another figure, and ``ImportError`` without pandas.
    """
    strategies = cast(list[dict[str, Any]], report["periods"])
    figures = [name for name in _FIGURES if name in strategies[0]]
    if figure not in figures:
        raise ValueError(f"figure is {figure!r}: must be one of {', '.join(figures)}")
    return _by_date(report, {strategy["strategy"]: strategy[figure] for strategy in strategies})


def held(report: wire.AssetsBacktestReport, strategy: str | None = None) -> pd.DataFrame:
    """Returns the share of wealth in each asset of a walk-forward of several, with a column for each asset.

    With ``strategy`` there is a row for each period, indexed by its date. Without it, there is a row for each strategy
    with its average shares. Raises ``ValueError`` for an unknown strategy, and ``ImportError`` without pandas.
    """
    pd, assets = require_pandas(), report["assets"]
    if strategy is None:
        means = {figures["strategy"]: figures["mean_allocations"] for figures in report["strategies"]}
        return pd.DataFrame.from_dict(means, orient="index", columns=assets).rename_axis("strategy")
    for line in report["periods"]:
        if line["strategy"] == strategy:
            return _by_date(report, line["allocations"])[assets]
    names = "; ".join(line["strategy"] for line in report["periods"])
    raise ValueError(f"strategy is {strategy!r}: must be one of {names}")


def _by_date(report: wire.BacktestReport | wire.AssetsBacktestReport, columns: Mapping[str, Any]) -> pd.DataFrame:
    """Returns a table with a row for each period, indexed by its date or its number."""
    pd = require_pandas()
    frame = pd.DataFrame(columns)
    dates = report.get("dates")
    if dates is None:
        return frame.set_axis(pd.RangeIndex(1, len(frame) + 1, name="period"))
    return frame.set_axis(pd.to_datetime(pd.Index(dates, name="date"), format="ISO8601"))


_FIGURES = ("wealth", "allocation", "low", "high", "radius", "traded")


def evaluation(report: wire.EvaluationReport) -> pd.DataFrame:
    """Returns the strategies of an evaluation, a row for each by its name.

    ``certainty_equivalent`` and ``wealth_mean`` are amounts of money. ``utility_mean``, ``utility_variance`` and so on
    are of terminal utility. ``difference_certainty_equivalent`` and ``difference_utility`` are differences to the
    reference strategy, and NaN in its own row. ``beyond_own_mix`` is what changing the allocation earned, NaN for
    constant mixes. All except the extremes ``max`` and ``min`` have their interval in the columns with ``_low`` and
    ``_high``. Raises ``ImportError`` without pandas.
    """
    rows = []
    for strategy in report["strategies"]:
        difference: Mapping[str, Any] = strategy.get("difference") or {}
        row: dict[str, Any] = {"strategy": strategy["strategy"]}
        row |= _estimate("certainty_equivalent", strategy["certainty_equivalent"])
        for name in ("certainty_equivalent", "utility"):
            row |= _estimate(f"difference_{name}", difference.get(name))
        own_mix: Mapping[str, Any] = strategy.get("own_mix") or {}
        row |= _estimate("beyond_own_mix", own_mix.get("beyond"))
        for group in ("wealth", "utility"):
            for name, value in cast(dict[str, Any], strategy)[group].items():
                full = f"{group}_{name}"
                row |= _estimate(full, value) if isinstance(value, Mapping) else {full: value}
        rows.append(row)
    return require_pandas().DataFrame(rows).set_index("strategy")


def frontier(report: wire.FrontierReport) -> pd.DataFrame:
    """Returns what caution costs, indexed by the law that records were drawn from (``law``) and the multiple of the
    radius (``scale``).

    ``lost`` is how far the certainty equivalent is below that of the best allocation. All losses are in basis points,
    per year if the report is ``per_year`` and otherwise per period. ``deviation`` is the standard deviation of the loss
    from record to record. ``beyond_least`` is the loss in excess of that at the best scale, where it is NaN.
    ``beyond_own_mix`` is the gain over a constant mix of the average advice. Each has its interval in the columns with
    ``_low`` and ``_high``. ``total`` is the average share of wealth held in all assets. Raises ``ImportError`` without
    pandas.
    """
    rows = []
    for resampled in report["resampled"]:
        for point in resampled["points"]:
            row: dict[str, Any] = {"law": resampled["bootstrap"]["kind"], "scale": point["scale"]}
            row |= _estimate("lost", point["lost"]) | _estimate("deviation", point["deviation"])
            row |= _estimate("beyond_least", point.get("beyond_least"))
            rows.append(row | _estimate("beyond_own_mix", point["beyond_own_mix"]) | {"total": point["total"]})
    return require_pandas().DataFrame(rows).set_index(["law", "scale"])


def comparison(report: wire.ComparisonReport) -> pd.DataFrame:
    """Returns policies and rules of a declared problem, indexed by ``strategy``.

    ``value`` is the mean worth of a path, ``difference`` the value less that of the first policy, and
    ``worst_twentieth`` the mean of the worst twentieth of the paths. Each has its interval in the columns with ``_low``
    and ``_high``.
    ``robust_value`` is the worth of a policy under the worst law; it is NaN for rules. Raises ``ImportError`` without
    pandas.
    """
    rows = []
    for strategy in report["strategies"]:
        row: dict[str, Any] = {"strategy": strategy["strategy"], "is_rule": strategy["is_rule"]}
        for name in ("value", "difference", "worst_twentieth"):
            row |= _estimate(name, cast(dict[str, Any], strategy).get(name))
        robust = strategy.get("robust_value")
        rows.append(row | {"robust_value": math.nan if robust is None else robust})
    return require_pandas().DataFrame(rows).set_index("strategy")


def declared_walk(report: wire.DeclaredWalkReport) -> pd.DataFrame:
    """Returns policies and rules that walked through the record of a declared problem, indexed by ``strategy``.

    ``gain`` is the mean gain of a period, ``difference`` the gain less that of the first strategy, each with its
    interval in the columns with ``_low`` and ``_high``. ``earned`` is the sum of the rewards and ``left`` what the last
    states are worth. Raises ``ImportError`` without pandas.
    """
    rows = []
    for strategy in report["strategies"]:
        row: dict[str, Any] = {"strategy": strategy["strategy"], "is_rule": strategy["is_rule"]}
        row |= _estimate("gain", strategy["gain"]) | _estimate("difference", strategy.get("difference"))
        rows.append(row | {"earned": strategy["earned"], "left": strategy["left"]})
    return require_pandas().DataFrame(rows).set_index("strategy")


def declared_periods(report: wire.DeclaredWalkReport, strategy: str | None = None) -> pd.DataFrame:
    """Returns the periods that a strategy walked through, by default the first, indexed by ``period`` from 1.

    The columns are ``noise``, ``reward``, ``radius``, which is NaN for rules, ``state.<name>`` for each state before
    the noise, and ``action.<name>``. Raises ``ValueError`` for an unknown strategy and ``ImportError`` without pandas.
    """
    walked = {own["strategy"]: own for own in report["strategies"]}
    name = next(iter(walked)) if strategy is None else strategy
    if name not in walked:
        raise ValueError(f"there is no strategy {name!r}: {', '.join(walked)}")
    rows = []
    for number, period in enumerate(walked[name]["periods"], start=1):
        radius = period.get("radius")
        row: dict[str, Any] = {"period": number, "noise": period["noise"], "reward": period["reward"]}
        row |= {"radius": math.nan if radius is None else radius}
        row |= {f"state.{name}": value for name, value in period["states"].items()}
        rows.append(row | {f"action.{name}": value for name, value in period["actions"].items()})
    return require_pandas().DataFrame(rows).set_index("period")


def _estimate(name: str, figure: Mapping[str, Any] | None) -> dict[str, float]:
    """Returns a figure and the ends of its interval, which is a list in reports of walk-forwards."""
    ends = (name, f"{name}_low", f"{name}_high")
    if figure is None:
        return dict.fromkeys(ends, math.nan)
    low, high = figure["interval"] if "interval" in figure else (figure["low"], figure["high"])
    return dict(zip(ends, (figure["value"], low, high), strict=True))


def require_pandas() -> ModuleType:
    """Imports pandas. Raises ``ImportError`` if it is missing."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("frames need pandas: pip install 'ballast-client[pandas]'") from error
    module: ModuleType = pandas
    return module
