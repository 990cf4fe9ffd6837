"""Draws answers of the service with matplotlib and pandas, which are imported only when a function is called.

Each function takes the JSON as :mod:`ballast.frames` does, draws on ``ax`` or else on a new figure, and returns the
axes, which you can change further. If one of the two packages is missing, the call raises ``ImportError`` and says what
to install.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from . import frames, wire

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: The number of lines that have different colours.
_LINES = 10
_STYLES = ("-", "--", ":", "-.")
#: The height of a strategy with its interval, and of the axis below all, in inches.
_ROW, _HEAD = 0.28, 0.9


def walk_forward(
    report: wire.BacktestReport | wire.AssetsBacktestReport,
    ax: Axes | None = None,
    strategies: Sequence[str] | None = None,
) -> Axes:
    """Draws the wealth of strategies of a walk-forward, which starts at 100, over the periods on a logarithmic scale.

    By default it draws the ten strategies with the highest certainty equivalent, the best first. Raises ``ValueError``
    for an unknown strategy.
    """
    worth = frames.walk_forward(report)["yearly_certainty_equivalent"].sort_values(ascending=False, kind="stable")
    wealth, title = frames.periods(report), None
    if strategies is None:
        strategies = list(worth.index[:_LINES])
        title = f"the {_LINES} of {len(worth)} worth most" if len(worth) > _LINES else None
    else:
        _check_known(strategies, wealth)
    axes = _axes(ax, (10.0, 5.0))
    for place, name in enumerate(strategies):
        style = _STYLES[place // _LINES % len(_STYLES)]
        axes.plot(wealth.index, wealth[name], color=f"C{place % _LINES}", linestyle=style, linewidth=1.2, label=name)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.set_ylabel("wealth, from 100")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small", title=title, frameon=False)
    return axes


def history(history: wire.History, ax: Axes | None = None) -> Axes:
    """Draws the wealth of a session after each period, and on a second axis the share that was held.

    The horizontal axis shows the last days of the periods if all are known, and otherwise the numbers of the periods.
    """
    axes = _axes(ax)
    lived = frames.history(history)
    over = lived.index if lived.empty or lived["date"].isna().any() else lived["date"]
    axes.plot(over, lived["wealth"], color="C0", marker=".", label="wealth")
    axes.axhline(history["initial_wealth"], color="C0", linewidth=0.8, linestyle=":")
    axes.set_ylabel("wealth after the period")
    axes.set_xlabel("period" if over is lived.index else "last day")
    if over is lived.index:
        axes.locator_params(axis="x", integer=True)
    shares = axes.twinx()
    shares.step(over, lived["executed_allocation"], where="mid", color="C1", linewidth=1.0, label="held")
    shares.set_ylim(0.0, 1.05)
    shares.set_ylabel("share of wealth held through the period")
    lines = [*axes.get_lines()[:1], *shares.get_lines()]
    axes.legend(handles=lines)
    return axes


def declared_history(history: wire.DeclaredHistory, ax: Axes | None = None) -> Axes:
    """Draws the states of a declared problem at the start and after each period, by the numbers of the periods."""
    axes = _axes(ax)
    lived = frames.declared_history(history)
    for name, start in history["initial_state"].items():
        after = list(lived[f"state.{name}"]) if len(lived) else []
        axes.plot([0, *lived.index], [start, *after], marker=".", label=name)
    axes.set_xlabel("period")
    axes.locator_params(axis="x", integer=True)
    axes.legend()
    return axes


def evaluation(report: wire.EvaluationReport, ax: Axes | None = None, strategies: Sequence[str] | None = None) -> Axes:
    """Draws the certainty equivalent of each strategy of an evaluation, with its interval, the best at the top.

    By default it draws all strategies; a new figure is as high as they need. The point of the reference is red.
    Raises ``ValueError`` for an unknown strategy.
    """
    table = frames.evaluation(report)
    if strategies is not None:
        _check_known(strategies, table.index)
        table = table.loc[list(strategies)]
    table = table.sort_values("certainty_equivalent", kind="stable")
    axes = _axes(ax, (8.0, _HEAD + _ROW * len(table)))
    worth, places = table["certainty_equivalent"], range(len(table))
    reach = [worth - table["certainty_equivalent_low"], table["certainty_equivalent_high"] - worth]
    axes.errorbar(worth, places, xerr=reach, fmt="o", markersize=5, capsize=3)
    if (reference := report["reference"]) in table.index:
        axes.plot(worth[reference], table.index.get_loc(reference), "o", markersize=7, color="C3")
    axes.set_yticks(places, list(table.index))
    axes.set_ylim(-0.7, len(table) - 0.3)
    axes.grid(axis="x", linewidth=0.5, alpha=0.5)
    axes.set_xlabel("certainty equivalent of terminal wealth")
    return axes


def frontier(report: wire.FrontierReport, ax: Axes | None = None) -> Axes:
    """Draws what caution costs: basis points of certainty equivalent lost over the multiple of the radius.

    There is a line for each law that records were drawn from, and a band for its interval.
    """
    axes = _axes(ax)
    for law, points in frames.frontier(report).groupby(level="law", sort=False):
        points = points.droplevel("law")
        (line,) = axes.plot(points.index, points["lost"], marker="o", label=law)
        axes.fill_between(points.index, points["lost_low"], points["lost_high"], alpha=0.2, color=line.get_color())
    axes.set_xlabel("multiple of the radius")
    axes.set_ylabel(f"basis points lost a {'year' if report['per_year'] else 'period'}")
    axes.legend(title="records drawn")
    return axes


def futures(futures: wire.Futures, name: str | None = None, ax: Axes | None = None) -> Axes:
    """Draws the course of a figure in both worlds of some futures: the median, and the range of eight paths in ten.

    By default it draws the first course, which is wealth for an investor. Raises ``ValueError`` for an unknown name.
    """
    courses = {course["name"]: course for course in futures["courses"]}
    name = next(iter(courses)) if name is None else name
    if name not in courses:
        raise ValueError(f"name is {name!r}: must be one of {'; '.join(courses)}")
    axes = _axes(ax)
    for course, label, colour in (
        (courses[name]["worst"], "the worst law every period", "C3"),
        (courses[name]["record"], "periods like the record's", "C0"),
    ):
        periods = [futures["period"] - 1 + place for place in range(len(course))]
        axes.plot(periods, [point["median"] for point in course], color=colour, label=label)
        lows, highs = [point["low"] for point in course], [point["high"] for point in course]
        axes.fill_between(periods, lows, highs, color=colour, alpha=0.15, linewidth=0)
    axes.set_xlabel("period")
    axes.set_ylabel(name)
    axes.legend(frameon=False)
    return axes


def worst_case(advice: frames.Explained, ax: Axes | None = None) -> Axes:
    """Draws the probability of each log-return, under the learned law upwards and under the worst law downwards.

    The advice is robust against the worst law. Raises ``ValueError`` as :func:`ballast.frames.worst_case` does.
    """
    axes = _axes(ax)
    moves = frames.worst_case(advice)
    for column, sign, colour, label in (("atom", 1.0, "C0", "seen"), ("moved_to", -1.0, "C3", "worst case")):
        law = moves.groupby(column)["mass"].sum()
        axes.vlines(law.index, 0.0, sign * law, color=colour, label=label, linewidth=1.5)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set_xlabel("log-return of the period")
    axes.set_ylabel("probability, of the worst case downwards")
    axes.legend()
    return axes


def _check_known(strategies: Sequence[str], names: Iterable[str]) -> None:
    names = list(names)
    if unknown := next((name for name in strategies if name not in names), None):
        raise ValueError(f"strategies has {unknown!r}: must be one of {'; '.join(names)}")


def _axes(ax: Axes | None, size: tuple[float, float] | None = None) -> Axes:
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plots need matplotlib: pip install 'ballast-client[plots]'") from error
    return pyplot.subplots(layout="constrained", figsize=size)[1]
