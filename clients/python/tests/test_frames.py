"""Answers as pandas objects and pictures. Every number is that of the JSON, under its documented name."""

from __future__ import annotations

import itertools
import json
import math
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import pytest
from conftest import RETURNS, compare, train, walk

from ballast import Ballast, Frontier, Session, frames, plots

matplotlib.use("Agg")

RECORD = [0.01 + 0.05 * math.sin(1.7 * period) for period in range(24)]


def tried(ballast: Ballast) -> Frontier:
    return ballast.frontier(
        RECORD, kind="log", rate_per_step=0.002, scales=[0.0, 0.5, 1.0], resamples=20, idempotency_key="of the frames"
    )


def test_a_session_is_a_frame_with_and_without_its_corrections(session: Session) -> None:
    assert list(session.frame().index) == [] and "wealth" in session.frame()
    session.observe(simple_return=0.05, date="2008-01-31", executed_allocation=0.5)
    session.observe(missing=True)
    session.observe(log_return=-0.02, date="2008-03-31")
    then = session.frame()
    assert then.index.name == "period" and list(then.index) == [1, 2, 3] and not then["corrected"].any()
    rows = session.history()["observations"]
    for name in ("advised_allocation", "executed_allocation", "wealth", "holding", "radius"):
        assert then[name].tolist() == [row[name] for row in rows]
    assert then["simple_return"].tolist() == pytest.approx([0.05, math.nan, math.expm1(-0.02)], nan_ok=True)
    assert then["date"].tolist() == [pd.Timestamp("2008-01-31"), pd.NaT, pd.Timestamp("2008-03-31")]

    session.correct(2, "it was found", simple_return=0.03, date="2008-02-29")
    now = session.frame()
    assert now["corrected"].tolist() == [False, True, True]
    assert now.loc[2, "simple_return"] == pytest.approx(0.03) and now.loc[2, "date"] == pd.Timestamp("2008-02-29")
    assert now.loc[3, "wealth"] == session.wealth != then.loc[3, "wealth"]
    # The account of a period always includes every correction.
    later = ["corrected", "equal_weights", "initial_composition"]
    pd.testing.assert_frame_equal(session.frame(as_of="then").drop(columns=later), then.drop(columns=later))


def test_the_worst_case_is_a_transport(ballast: Ballast, session: Session) -> None:
    advised = ballast.advise(RETURNS, kind="log", rate_per_step=0.002, caution="paper")
    answers: list[frames.Explained] = [advised, session.action(explain="worst_case")]
    for advice in answers:
        moves = frames.worst_case(advice)
        assert moves["mass"].sum() == pytest.approx(1.0)
        # Every observed return has the mass 1/10, wherever that moves, and the mean distance is within the radius.
        seen = moves.groupby("atom")["mass"].sum()
        assert sorted(seen.index) == sorted(RETURNS) and seen.tolist() == pytest.approx([0.1] * 10)
        distance = (moves["mass"] * (moves["atom"] - moves["moved_to"]).abs()).sum()
        assert 0.0 <= distance <= advice["radius"] * (1 + 1e-9)
    assert (frames.worst_case(advised)["atom"] > frames.worst_case(advised)["moved_to"]).any()
    pd.testing.assert_frame_equal(session.worst_case(), frames.worst_case(session.action(explain="worst_case")))
    with pytest.raises(ValueError, match="ask for it with explain='worst_case'"):
        frames.worst_case(session.action())
    normal = ballast.advise(RETURNS, kind="log", rate_per_step=0.002, framework="parametric_static")
    with pytest.raises(ValueError, match="the worst law is normal"):
        frames.worst_case(normal)


def test_allocations_have_the_names_of_the_assets(ballast: Ballast) -> None:
    table = pd.DataFrame({"stocks": RETURNS, "bonds": [value * value - 0.0005 for value in RETURNS]})
    advised = ballast.advise_assets(table, kind="log", rate_per_step=0.0, radius={"rule": "fixed", "radius": 1e-4})
    held = frames.allocation(advised)
    assert held.name == "allocation" and held.to_dict() == advised["allocation"]
    assert held.sum() == pytest.approx(advised["total"]) and held["stocks"] > 0.0
    figures = frames.figures(advised)
    assert figures["total"] == advised["total"] and figures["sample_size"] == len(RETURNS)
    # Part of the caution is for a crash that is not in the record.
    assert (
        figures["without_crash"] == advised.get("without_crash") and figures["without_crash"] > figures["total"] - 1e-6
    )
    assert {"bound", "floor", "radius", "radius_factor"} <= set(figures.index) and "allocation" not in figures
    one = frames.figures(ballast.advise(RETURNS, kind="log", rate_per_step=0.0))
    assert one["allocation"] >= 0.0 and "certainty_equivalent" in one and "without_crash" not in one
    means = frames.worst_means(advised)
    assert means.loc["stocks", "seen"] == pytest.approx(table["stocks"].mean())
    assert (means["worst"] <= means["seen"] + 1e-12).all() and list(means) == ["seen", "worst"]
    equal = ballast.advise_assets(table, kind="log", rate_per_step=0.0, means={"kind": "shrunk", "intensity": 1.0})
    believed = frames.worst_means(equal)["believed"]
    simple = np.exp(table - table.mean() + believed).mean()
    assert simple["stocks"] == pytest.approx(simple["bonds"], rel=1e-12)


def test_a_session_of_several_assets_is_a_frame_for_each_figure(ballast: Ballast, session: Session) -> None:
    table = pd.DataFrame({"stocks": RETURNS, "bonds": [value * value - 0.0005 for value in RETURNS]})
    fund = ballast.train_assets(
        table, kind="log", rate_per_step=0.0, horizon=3, radius={"rule": "fixed", "radius": 1e-4}, design={"count": 20}
    ).session()
    fund.observe(
        simple_returns={"stocks": 0.1, "bonds": -0.01},
        executed_allocations={"stocks": 0.25, "bonds": 0.5},
        confirm=True,
    )
    fund.observe(missing=True)
    then = fund.assets_frame()
    assert (
        then.columns.tolist() == ["stocks", "bonds"] and then.index.tolist() == [1, 2] and then.index.name == "period"
    )
    assert then.loc[1].tolist() == pytest.approx([0.1, -0.01]) and then.loc[2].isna().all()
    assert fund.assets_frame("executed_allocation").loc[1].tolist() == [0.25, 0.5]
    row = fund.history()["observations"][0]["assets"]
    assert fund.assets_frame("holding").loc[1].to_dict() == row["holdings"]  # type: ignore[index]
    assert fund.assets_frame("advised_allocation").loc[1].to_dict() == row["advised_allocations"]  # type: ignore[index]
    fund.correct(1, "a slip", simple_returns={"stocks": 0.2, "bonds": 0.0}, confirm=True)
    assert fund.assets_frame("log_return").loc[1].tolist() == pytest.approx([math.log(1.2), 0.0])
    pd.testing.assert_frame_equal(fund.assets_frame(as_of="then"), then)
    with pytest.raises(ValueError, match="figure is 'wealth': must be one of simple_return, log_return"):
        fund.assets_frame("wealth")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="history is of one asset"):
        session.assets_frame()


def test_a_walk_forward_is_frames(ballast: Ballast) -> None:
    walked = walk(ballast, alpha=[0.5])
    report = walked.report()
    table = walked.frame()
    assert list(table.index) == [line["strategy"] for line in report["strategies"]]
    for line in report["strategies"]:
        row, figure = table.loc[line["strategy"]], line["annual_mean"]
        assert [row["annual_mean"], row["annual_mean_low"], row["annual_mean_high"]] == [
            figure["value"],
            *figure["interval"],
        ]
        assert (row["final_wealth"], row["hindsight"]) == (line["final_wealth"], line["hindsight"])
    wealth = walked.periods()
    assert list(wealth.columns) == list(table.index)
    assert wealth.index.tolist() == pd.date_range("2022-01", periods=4, freq="QS").tolist()
    assert wealth.iloc[-1].to_dict() == pytest.approx(table["final_wealth"].to_dict(), rel=1e-12)
    assert walked.periods("allocation")["All in stocks"].tolist() == [1.0] * 4
    with pytest.raises(ValueError, match="figure is 'return': must be one of wealth, allocation"):
        walked.periods("return")  # type: ignore[arg-type]
    # A report of periods without dates, as `ballast backtest` writes it.
    undated = json.loads(json.dumps({**report, "dates": None}))
    assert frames.periods(undated).index.tolist() == [1, 2, 3, 4]


def test_an_evaluation_is_a_frame(ballast: Ballast) -> None:
    evaluation = compare(ballast)
    report, table = evaluation.report(), evaluation.frame()
    bank, half = report["strategies"]
    assert list(table.index) == [bank["strategy"], half["strategy"]]
    assert table.loc["50 % in stocks", "wealth_mean_high"] == half["wealth"]["mean"]["high"]
    assert table.loc["50 % in stocks", "utility_quantile_20"] == half["utility"]["quantile_20"]["value"]
    ahead = table["certainty_equivalent"] - table.loc["All in the bank", "certainty_equivalent"]
    assert table.loc["50 % in stocks", "difference_certainty_equivalent"] == pytest.approx(ahead["50 % in stocks"])
    assert table.loc["All in the bank"].filter(like="difference").isna().all()


def test_a_strategy_of_one_s_own_is_walked(ballast: Ballast) -> None:
    periods = walk(ballast, alpha=[0.5]).periods()
    length = 8 + len(periods)
    mine = walk(ballast, alpha=[0.5], weights={"Mine": [0.6] * length}).periods()
    assert mine["Mine"].tolist() == mine["60/40"].tolist() == periods["60/40"].tolist()


def test_a_frontier_is_a_frame(ballast: Ballast) -> None:
    found = tried(ballast)
    report, table = found.report(), found.frame()
    assert table.index.names == ["law", "scale"] and len(table) == 9
    for resampled in report["resampled"]:
        for point in resampled["points"]:
            row = table.loc[(resampled["bootstrap"]["kind"], point["scale"])]
            assert (row["lost"], row["lost_low"], row["beyond_own_mix_high"], row["total"]) == (
                point["lost"]["value"],
                point["lost"]["low"],
                point["beyond_own_mix"]["high"],
                point["total"],
            )
    # At the best scale of each law there is no excess loss.
    least = table["beyond_least"].isna()
    assert least.groupby(level="law").sum().tolist() == [1, 1, 1]
    assert table.loc[least, "lost"].tolist() == table.groupby(level="law", sort=False)["lost"].min().tolist()


def test_pictures_show_the_frames(ballast: Ballast) -> None:
    walked = walk(ballast, alpha=[0.5])
    lines = {line.get_label(): line for line in walked.plot().get_lines()}
    wealth = walked.periods()
    assert set(wealth.columns) <= set(lines)
    assert list(lines["All in stocks"].get_ydata()) == wealth["All in stocks"].tolist()  # type: ignore[arg-type]
    # The names of the strategies stand beside the lines, on the figure.
    axes = walked.plot()
    axes.figure.draw_without_rendering()  # type: ignore[union-attr]
    names = axes.get_legend().get_window_extent()  # type: ignore[union-attr]
    assert axes.get_window_extent().x1 <= names.x0 and names.x1 <= axes.figure.bbox.x1

    found = tried(ballast)
    axes = found.plot()
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["smoothed", "block", "without_premium"]  # type: ignore[union-attr]
    smoothed = found.frame().loc["smoothed"]
    assert list(axes.get_lines()[0].get_ydata()) == smoothed["lost"].tolist()  # type: ignore[arg-type]
    (band,) = axes.collections[0].get_paths()
    heights = np.asarray(band.vertices)[:, 1]
    assert (heights.min(), heights.max()) == (smoothed["lost_low"].min(), smoothed["lost_high"].max())
    assert plots.frontier(found.report(), axes) is axes

    futures = train(ballast, seed=8).policy().futures(20)
    axes = plots.futures(futures)
    assert [line.get_label() for line in axes.get_lines()] == [
        "the worst law every period",
        "periods like the record's",
    ]
    medians = [point["median"] for point in futures["courses"][0]["worst"]]
    assert list(axes.get_lines()[0].get_ydata()) == medians  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="'stock': must be one of wealth"):
        plots.futures(futures, "stock")

    advice = ballast.advise(RETURNS, kind="log", rate_per_step=0.002)
    seen, worst = plots.worst_case(advice).collections
    assert len(seen.get_paths()) == len(RETURNS)
    # The lines upwards and those downwards each sum to 1.
    for law, sign in ((seen, 1.0), (worst, -1.0)):
        assert sum(np.asarray(path.vertices)[1, 1] for path in law.get_paths()) == pytest.approx(sign)


def test_plots_of_an_evaluation_show_the_strategies_chosen(ballast: Ballast) -> None:
    found = ballast.evaluate(
        {
            "problem": {"horizon": 2, "rate_per_step": 0.002, "history": RETURNS},
            "design": {"count": 10},
            "frameworks": ["adaptive", "plug_in"],
            "paths": 100,
        }
    )
    report = found.report()
    worth = {one["strategy"]: one["certainty_equivalent"] for one in report["strategies"]}
    assert len(worth) >= 13

    axes = found.plot()
    best_first = sorted(worth, key=lambda name: worth[name]["value"], reverse=True)
    assert sorted(label.get_text() for label in axes.get_yticklabels()) == sorted(worth)
    values = [worth[label.get_text()]["value"] for label in axes.get_yticklabels()]
    assert values == sorted(worth[name]["value"] for name in best_first)
    # Every name has room of its own, within the figure.
    axes.figure.draw_without_rendering()  # type: ignore[union-attr]
    boxes = [label.get_window_extent() for label in axes.get_yticklabels()]
    assert all(below.y1 <= above.y0 for below, above in itertools.pairwise(boxes))
    assert min(box.x0 for box in boxes) >= 0.0

    chosen = ["All in stocks", "Cautious, learns"]
    axes = found.plot(strategies=chosen)
    assert [label.get_text() for label in axes.get_yticklabels()] == sorted(
        chosen, key=lambda name: worth[name]["value"]
    )
    reach = axes.containers[0].lines[2][0].get_segments()[0]  # type: ignore[attr-defined]
    lowest = worth[axes.get_yticklabels()[0].get_text()]
    assert reach[:, 0].tolist() == pytest.approx([lowest["low"], lowest["high"]])
    with pytest.raises(ValueError, match=r"strategies has 'Gold': must be one of Cautious, learns; .*All in the bank"):
        plots.evaluation(report, strategies=["All in stocks", "Gold"])


def missing(package: str, call: str) -> str:
    """Returns the error message of a call while a package is not installed."""
    code = f"import sys; sys.modules[{package!r}] = None\nfrom ballast import frames, plots\n{call}"
    return subprocess.run([sys.executable, "-c", code], text=True, capture_output=True).stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("package", "call", "message"),
    [
        ("pandas", "frames.allocation({'allocation': {}})", "pip install 'ballast-client[pandas]'"),
        ("pandas", "frames.frontier({'resampled': []})", "pip install 'ballast-client[pandas]'"),
        ("matplotlib", "plots.worst_case({})", "pip install 'ballast-client[plots]'"),
    ],
)
def test_what_to_install_is_said(package: str, call: str, message: str) -> None:
    output = missing(package, call)
    assert output.startswith("ImportError: ") and output.endswith(message)


def test_every_frame_says_what_it_needs() -> None:
    public: list[Callable[..., Any]] = [
        made
        for module in (frames, plots)
        for name, made in vars(module).items()
        if callable(made) and getattr(made, "__module__", "") == module.__name__ and not name.startswith("_")
    ]
    assert len(public) >= 11
    for made in public:
        assert made.__doc__, made


def test_a_session_and_an_evaluation_are_drawn(ballast: Ballast, session: Session) -> None:
    session.observe(simple_return=0.05, executed_allocation=0.5)
    session.observe(log_return=-0.02)
    axes = session.plot()
    rows = session.history()["observations"]
    wealth, _ = axes.get_lines()
    assert np.asarray(wealth.get_ydata()).tolist() == [row["wealth"] for row in rows] and np.asarray(
        wealth.get_xdata()
    ).tolist() == [1, 2]
    assert all(tick == round(tick) for tick in axes.get_xticks())
    (held,) = axes.figure.axes[1].get_lines()
    assert np.asarray(held.get_ydata()).tolist() == [row["executed_allocation"] for row in rows]
    evaluation = compare(ballast)
    drawn = evaluation.plot()
    table = evaluation.frame().sort_values("certainty_equivalent")
    assert [label.get_text() for label in drawn.get_yticklabels()] == list(table.index)
    assert np.asarray(drawn.get_lines()[0].get_xdata()).tolist() == table["certainty_equivalent"].tolist()
