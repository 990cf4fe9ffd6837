"""Answers of the service as pandas objects.

Each function takes the JSON as it came, from a call or from a file such as the ``report.json`` that ``ballast
backtest`` writes, and leaves it as it is. pandas is imported when a function is called, and not before: where it is
missing, the call raises ``ImportError`` and says what to install.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, cast

from . import wire

if TYPE_CHECKING:
    import pandas as pd

#: Whatever is robust against a worst law: ``Ballast.advise``, ``Session.action(explain="worst_case")``, a what-if.
Explained: TypeAlias = wire.Advised | wire.Action | wire.WhatIfPoint

#: The figures of a walk-forward that have a number for each period.
Figure: TypeAlias = Literal["wealth", "allocation", "low", "high", "radius", "traded"]
#: The figures of a session of several assets that have a number for each asset.
AssetsFigure: TypeAlias = Literal["simple_return", "log_return", "advised_allocation", "executed_allocation", "holding"]


def history(history: wire.History, as_of: Literal["now", "then"] = "now") -> pd.DataFrame:
    """What ``Session.history`` tells, a row for each period observed, with the period as index.

    ``date`` is the last day of the period, ``NaT`` where none was reported. ``log_return`` and ``simple_return`` are
    NaN where the return is missing. ``advised_allocation``, ``executed_allocation`` and ``holding`` are shares of
    wealth, ``wealth`` is a currency, ``radius`` a log-return, after the period as the last two are. With
    ``as_of="now"`` all of them have every correction made; with ``"then"`` they are what was told at the time.
    ``corrected`` says whether the two may differ. Raises ``ImportError`` without pandas.
    """
    pd = require_pandas()
    rows = []
    for observation in history["observations"]:
        changed = observation.get("now")
        told: Mapping[str, Any] = observation if as_of == "then" or changed is None else changed
        reported = told.get("reported") or observation["reported"]
        log_return = told.get("log_return")
        rows.append(
            {
                "period": observation["period"],
                "date": reported.get("date"),
                "log_return": math.nan if log_return is None else log_return,
                "simple_return": math.nan if log_return is None else math.expm1(log_return),
                **{name: told[name] for name in _STANDING},
                "corrected": changed is not None,
            }
        )
    columns = ["period", "date", "log_return", "simple_return", *_STANDING, "corrected"]
    frame = pd.DataFrame(rows, columns=columns).set_index("period")
    return frame.assign(date=pd.to_datetime(frame["date"]))


def assets_history(
    history: wire.History, figure: AssetsFigure = "simple_return", as_of: Literal["now", "then"] = "now"
) -> pd.DataFrame:
    """One figure of a session of several assets, a row for each period observed and a column for each asset.

    ``simple_return`` and ``log_return`` have every correction made unless ``as_of`` is ``"then"``, and are NaN where
    they are missing. ``advised_allocation``, ``executed_allocation`` and ``holding``, after the period, are shares of
    wealth as they were told at the time. Raises ``ValueError`` for another figure and for a session of one asset, and
    ``ImportError`` without pandas.
    """
    assets = history.get("assets")
    if not assets:
        raise ValueError("history is of one asset: see frames.history")
    if figure not in _ASSETS_FIGURES:
        raise ValueError(f"figure is {figure!r}: must be one of {', '.join(_ASSETS_FIGURES)}")
    rows = []
    for observation in history["observations"]:
        told = cast(dict[str, Any], observation)
        if as_of == "now" and figure.endswith("return") and told.get("now") is not None:
            told = told["now"]
        rows.append(told["assets"].get(_ASSETS_FIGURES[figure]) or {})
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


def worst_case(advice: Explained) -> pd.DataFrame:
    """The law that an advice is robust against, as what moves: ``mass``, a probability, goes from the log-return
    ``atom``, which was seen, to ``moved_to``.

    So ``moved_to`` with the weights ``mass`` is the worst law, and ``atom`` with the same weights the law that was
    learned. Raises ``ValueError`` where the advice came without one (``Session.action`` needs
    ``explain="worst_case"``) or the law is a normal one, which is no transport; and ``ImportError`` without pandas.
    """
    law = advice.get("worst_case")
    if law is None:
        raise ValueError("the advice has no worst_case: ask for it with explain='worst_case'")
    if not law["transport"]:
        raise ValueError("the worst law is normal, and no transport: see advice['worst_case']['normal']")
    return require_pandas().DataFrame(law["transport"], columns=["atom", "moved_to", "mass"])


def allocation(advised: wire.AssetsAdvised | wire.AssetsAction | wire.AssetsWhatIfPoint) -> pd.Series[float]:
    """What ``Ballast.advise_assets``, ``Session.assets_action`` or ``Session.assets_what_if`` advises: the share of
    wealth in each asset, by its name, in no particular order; the rest is in the bank.

    Raises ``ImportError`` without pandas.
    """
    return require_pandas().Series(advised["allocation"], name="allocation", dtype=float)


def figures(advised: Explained | wire.AssetsAdvised | wire.AssetsAction | wire.AssetsWhatIfPoint) -> pd.Series[float]:
    """The numbers of an advice that stand alone, by the name of their field: ``certainty_equivalent``, ``floor``,
    ``radius`` and so on.

    Of several assets ``total`` is the share of wealth in all together, and ``without_crash``, where
    ``Ballast.advise_assets`` tells it, what that would be were no return below the lowest seen. Raises ``ImportError``
    without pandas.
    """
    numbers = {name: value for name, value in advised.items() if type(value) in (int, float)}
    return require_pandas().Series(numbers, name="figure", dtype=float)


def worst_means(advised: wire.AssetsAdvised) -> pd.DataFrame:
    """The mean log-return of each asset as it was ``seen`` and under the ``worst`` law, an asset a row.

    Raises ``ImportError`` without pandas.
    """
    return require_pandas().DataFrame.from_dict(advised["worst_means"], orient="index", columns=["seen", "worst"])


def sessions(entries: Iterable[wire.SessionEntry]) -> pd.DataFrame:
    """What ``Ballast.sessions`` lists, a row for each session in the order of the list, with its identifier as index.

    The columns are the fields of an entry but ``notes``: ``wealth`` and ``wealth_change`` are currencies, ``holding`` a
    share of wealth, ``date`` the last day reported. ``created`` and ``last_report`` are times in UTC. What is not there
    is NaN or ``NaT``. Raises ``ImportError`` without pandas.
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
    """The strategies of a walk-forward, one a row by its name, the figures of the report as columns.

    A figure with an interval has two columns more, its ends, under its name with ``_low`` and ``_high``. Returns,
    volatilities and shares are fractions, certainty equivalents and wealth are from 100. What was held of each of
    several assets is told by :func:`held`. Raises ``ImportError`` without pandas.
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
    """One figure of a walk-forward, a row for each period and a column for each strategy.

    ``wealth`` is at the end of the period, from 100; ``allocation``, the ends ``low`` and ``high`` of the band and
    ``traded`` are shares of wealth; ``radius`` is a log-return. The index has the dates that were given for the
    periods, a month as its first day, or counts from 1 where there are none. Raises ``ValueError`` for another figure,
    and ``ImportError`` without pandas.
    """
    told = cast(list[dict[str, Any]], report["periods"])
    figures = [name for name in _FIGURES if name in told[0]]
    if figure not in figures:
        raise ValueError(f"figure is {figure!r}: must be one of {', '.join(figures)}")
    return _by_date(report, {strategy["strategy"]: strategy[figure] for strategy in told})


def held(report: wire.AssetsBacktestReport, strategy: str | None = None) -> pd.DataFrame:
    """The share of wealth in each of several assets that were walked forward, an asset a column: of one strategy a row
    for each period, with its date as index, or without one the average of every strategy, a row for each.

    Raises ``ValueError`` for a strategy that there is not, and ``ImportError`` without pandas.
    """
    pd, assets = require_pandas(), report["assets"]
    if strategy is None:
        means = {figures["strategy"]: figures["mean_allocations"] for figures in report["strategies"]}
        return pd.DataFrame.from_dict(means, orient="index", columns=assets).rename_axis("strategy")
    for told in report["periods"]:
        if told["strategy"] == strategy:
            return _by_date(report, told["allocations"])[assets]
    names = "; ".join(told["strategy"] for told in report["periods"])
    raise ValueError(f"strategy is {strategy!r}: must be one of {names}")


def _by_date(report: wire.BacktestReport | wire.AssetsBacktestReport, columns: Mapping[str, Any]) -> pd.DataFrame:
    """A row for each period, by its date or its number."""
    pd = require_pandas()
    frame = pd.DataFrame(columns)
    dates = report.get("dates")
    if dates is None:
        return frame.set_axis(pd.RangeIndex(1, len(frame) + 1, name="period"))
    return frame.set_axis(pd.to_datetime(pd.Index(dates, name="date"), format="ISO8601"))


_FIGURES = ("wealth", "allocation", "low", "high", "radius", "traded")


def evaluation(report: wire.EvaluationReport) -> pd.DataFrame:
    """The strategies of an evaluation, one a row by its name.

    ``certainty_equivalent`` and ``wealth_mean`` are currencies; ``utility_mean``, ``utility_variance`` and so on are
    of terminal utility; ``difference_certainty_equivalent`` and ``difference_utility`` are to the reference, for
    which they are NaN; ``beyond_own_mix`` is what changing the allocation earned, NaN for constant mixes. Each has
    its interval in the columns with ``_low`` and ``_high``, but for the extremes ``max`` and ``min``. Raises
    ``ImportError`` without pandas.
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
    """What caution costs, a row for each law that records were drawn from (``law``) and multiple of the radius
    (``scale``), which are the index.

    ``lost`` is in basis points of certainty equivalent behind the best allocation, a year where the report is
    ``per_year`` and else a period; ``deviation`` is of that from record to record, ``beyond_least`` what more is lost
    than at the best scale, NaN there, and ``beyond_own_mix`` what is gained over a constant mix of the average advice;
    each with its interval in ``_low`` and ``_high``. ``total`` is the share of wealth held in all assets on average.
    Raises ``ImportError`` without pandas.
    """
    rows = []
    for resampled in report["resampled"]:
        for point in resampled["points"]:
            row: dict[str, Any] = {"law": resampled["bootstrap"]["kind"], "scale": point["scale"]}
            row |= _estimate("lost", point["lost"]) | _estimate("deviation", point["deviation"])
            row |= _estimate("beyond_least", point.get("beyond_least"))
            rows.append(row | _estimate("beyond_own_mix", point["beyond_own_mix"]) | {"total": point["total"]})
    return require_pandas().DataFrame(rows).set_index(["law", "scale"])


def _estimate(name: str, figure: Mapping[str, Any] | None) -> dict[str, float]:
    """A figure and the ends of its interval, which walk-forwards tell as a list."""
    ends = (name, f"{name}_low", f"{name}_high")
    if figure is None:
        return dict.fromkeys(ends, math.nan)
    low, high = figure["interval"] if "interval" in figure else (figure["low"], figure["high"])
    return dict(zip(ends, (figure["value"], low, high), strict=True))


def require_pandas() -> ModuleType:
    """pandas itself. Raises ``ImportError`` without it."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("frames are pandas objects: pip install 'ballast-client[pandas]'") from error
    module: ModuleType = pandas
    return module
