"""Several assets: the walk-forward of a table, and what-if scenarios of a session, by the names of pandas."""

from __future__ import annotations

import asyncio
import math

import matplotlib
import numpy as np
import pandas as pd
import pytest

from ballast import AsyncBallast, Ballast, Training, frames, wire

matplotlib.use("Agg")

RISKY = [0.02 + 0.03 * math.sin(1.7 * quarter) for quarter in range(16)]
TABLE = pd.DataFrame(
    {"energy": RISKY, "health": [0.015 + 0.02 * math.cos(2.9 * quarter) for quarter in range(16)]},
    index=pd.period_range("2010Q1", periods=16, freq="Q"),
)


def test_a_table_walked_forward_is_frames_by_strategy_by_date_and_by_asset(ballast: Ballast) -> None:
    job = ballast.backtest_assets(
        TABLE, kind="simple", rate=0.002, windows=[8, None], every=4, alpha=0.9, idempotency_key="of several"
    )
    report = job.report()
    assert report["format"] == "ballast-backtest-assets-1" and report["assets"] == ["energy", "health"]
    assert report["choices"]["windows"] == [8, None]
    assert ballast.assets_walk_forward(job.id).report() == report
    trained = ballast.backtest_assets(
        TABLE, kind="simple", rate=0.002, strategies=["policy"], windows=[8], every=4, horizon=5, count=10, alpha=0.9
    )
    choices = trained.report()["choices"]
    assert (choices["strategies"], choices["horizon"], choices["count"]) == (["policy"], 5, 10)

    strategies = job.frame()
    assert list(strategies.index) == [figures["strategy"] for figures in report["strategies"]]
    one = report["strategies"][0]
    for name in ("yearly_certainty_equivalent", "annual_mean"):
        estimate = one[name]
        ends = [strategies.iloc[0][column] for column in (name, f"{name}_low", f"{name}_high")]
        assert ends == [estimate["value"], *estimate["interval"]]
    assert "mean_allocations" not in strategies and strategies.loc["Equal shares", "final_wealth"] > 100.0

    wealth = job.periods()
    assert list(wealth.columns) == list(strategies.index) and len(wealth) == len(report["dates"]) == 8
    assert wealth["Equal shares"].iloc[-1] == strategies.loc["Equal shares", "final_wealth"]
    assert (job.periods("radius")["Equal shares"] == 0.0).all() and wealth.index.equals(job.periods("traded").index)
    with pytest.raises(ValueError, match="must be one of wealth, radius, traded"):
        job.periods("allocation")

    names = [line.get_label() for line in job.plot(strategies=["Equal shares", strategies.index[0]]).get_lines()]
    assert names == ["Equal shares", strategies.index[0]]
    with pytest.raises(ValueError, match="'adaptive': must be one of Robust, balanced, knows 2 years; Robust"):
        job.plot(strategies=["adaptive"])
    lines = {line.get_label(): line for line in job.plot().get_lines()}
    assert len(lines) == 10
    for label, line in lines.items():
        assert list(line.get_ydata()) == wealth[label].tolist()  # type: ignore[arg-type]

    held = job.held("Equal shares")
    assert list(held.columns) == ["energy", "health"] and (held == 0.5).all().all() and held.index.equals(wealth.index)
    means = job.held()
    assert means.loc["Equal shares"].tolist() == pytest.approx([0.5, 0.5])
    assert list(means.index) == list(strategies.index)
    with pytest.raises(ValueError, match="must be one of Robust, balanced, knows 2 years; Robust"):
        frames.held(report, "adaptive")


def test_prices_and_rates_by_date_are_the_same_record(ballast: Ballast) -> None:
    prices = 100.0 * np.exp(np.log1p(TABLE).cumsum())
    start = pd.DataFrame({"energy": [100.0], "health": [100.0]}, index=pd.period_range("2009Q4", periods=1, freq="Q"))
    table = pd.concat([start, prices])
    rate = pd.Series(0.002, index=table.index)

    def walk(returns: pd.DataFrame, kind: str, rate: object) -> pd.DataFrame:
        job = ballast.backtest_assets(returns, kind=kind, rate=rate, windows=[8], alpha=0.9)  # type: ignore[arg-type]
        return job.periods()

    pd.testing.assert_frame_equal(walk(table, "price", rate), walk(TABLE, "simple", 0.002))
    with pytest.raises(ValueError, match="dates is None: must be given"):
        ballast.backtest_assets(TABLE.to_numpy(), kind="simple", rate=0.0, assets=["energy", "health"])


def test_what_is_held_already_is_traded_from_at_a_cost_and_risk_aversion_has_one_spelling(ballast: Ballast) -> None:
    held = {"energy": 0.2, "health": 0.3}
    advised = ballast.advise_assets(TABLE, rate_per_step=0.002, trading_cost=0.02, holdings=held, risk_aversion=6.0)
    for name, share in held.items():
        assert advised["trade"][name] == pytest.approx(advised["allocation"][name] - share)
    assert advised["floor"] == pytest.approx(100.2 * (1.0 - 0.02 * 0.5))
    utility: wire.UtilitySpecification = {"kind": "power", "risk_aversion": 6.0}
    spelled = ballast.advise_assets(TABLE, rate_per_step=0.002, trading_cost=0.02, holdings=held, utility=utility)
    assert spelled == advised
    one = ballast.advise(TABLE["energy"], rate_per_step=0.002, risk_aversion=6.0)
    assert one == ballast.advise(TABLE["energy"], rate_per_step=0.002, utility=utility)


def _training(ballast: Ballast, table: pd.DataFrame, key: str, *, horizon: int, trading_cost: float = 0.0) -> Training:
    return ballast.train_assets(
        table,
        kind="simple",
        rate_per_step=0.002,
        horizon=horizon,
        trading_cost=trading_cost,
        radius={"rule": "bridge", "scale": 0.1},
        design={"count": 20},
        idempotency_key=key,
    )


def test_what_is_supposed_of_several_assets_is_what_they_are_told(ballast: Ballast) -> None:
    training = _training(ballast, TABLE, "a policy of several", horizon=2)
    session = training.session(holdings={"energy": 0.2, "health": 0.3})
    assert session.assets_what_if()["allocation"] == session.assets_action()["allocation"]
    returns = pd.Series({"energy": 0.03, "health": -0.01})
    supposed = session.assets_what_if(simple_returns=returns)
    moved = session.assets_what_if(holdings=pd.Series({"energy": 0.0, "health": 0.9}), radius_scale=2.0)
    assert moved["trade"]["health"] == pytest.approx(moved["allocation"]["health"] - 0.9)
    assert moved.get("radius_scale") == 2.0

    async def awaited() -> float:
        async with AsyncBallast(str(ballast._transport.http.base_url)) as service:
            same = await service.session(session.id)
            return (await same.assets_what_if(simple_returns=returns))["wealth"]

    assert asyncio.run(awaited()) == supposed["wealth"]
    session.observe(simple_returns=returns.to_dict())
    action = session.assets_action()
    pd.testing.assert_series_equal(frames.allocation(supposed), frames.allocation(action))
    assert (supposed["wealth"], supposed["period"]) == (session.wealth, action["period"])


def test_losses_gaps_and_other_assets_are_in_the_frames(ballast: Ballast) -> None:
    training = _training(ballast, TABLE, "a policy of two", horizon=3, trading_cost=0.001)
    session = training.session(holdings={"energy": 0.2, "health": 0.3})
    held = {"energy": 0.5, "health": 0.25}
    session.observe(simple_returns=pd.Series({"energy": 0.03, "health": math.nan}), executed_allocations=held, flow=1.0)
    assert session.observed is not None
    assert session.observed["notes"][0]["reason"] == "price_missing"
    session.observe(simple_returns={"energy": -1.0, "health": 0.02}, executed_allocations=held, confirm=True)

    frame = session.frame()
    assert list(frame["flow"]) == [1.0, 0.0] and list(frame["rate"]) == [0.002, 0.002]
    assert frame["turnover"].iloc[0] == pytest.approx(0.3 + 0.05)
    assert frame["cost"].iloc[0] == pytest.approx(100.0 * 0.001 * 0.35)
    left = 100.0 * (1.0 - 0.001 * 0.35)
    assert frame["wealth"].iloc[0] == pytest.approx(left * (0.25 * 1.002 + 0.5 * 1.03 + 0.25) + 1.0)
    assert frame["bank"].iloc[0] == pytest.approx(100.0 * (1.0 - 0.001 * 0.5) * 1.002 + 1.0)
    assert frame["equal_weights"].iloc[0] == pytest.approx(100.0 * (1.0 - 0.001 * 0.5) * (0.5 * 1.03 + 0.5) + 1.0)
    # The first composition is energy alone, which loses everything.
    assert frame["initial_composition"].iloc[0] == pytest.approx(100.0 * (1.0 - 0.001 * 1.1) * 1.03 + 1.0)
    assert frame["equal_weights"].iloc[1] > 0.0 and math.isnan(frame["initial_composition"].iloc[1])
    returns = session.assets_frame()
    assert math.isnan(returns["health"].iloc[0]) and returns["energy"].iloc[1] == -1.0
    assert session.assets_frame("log_return")["energy"].iloc[1] == -math.inf
    assert returns["health"].iloc[1] == pytest.approx(0.02)

    # Energy is gone, and technology comes for it.
    technology = [0.01 + 0.04 * math.sin(0.7 * quarter) for quarter in range(18)]
    table = TABLE[["health"]].assign(technology=technology[:16])
    next_policy = _training(ballast, table, "another policy of two", horizon=2)
    record = np.log1p(technology).tolist()
    record[16] = math.nan
    renewed = session.renew(next_policy.policy().id, records={"technology": record}, leaving=["energy"])
    assert renewed.get("names") == ["health", "technology"]
    session.observe(simple_returns={"health": 0.01, "technology": 0.02})
    returns = session.assets_frame()
    assert list(returns.columns) == ["energy", "health", "technology"]
    assert returns["technology"].iloc[2] == pytest.approx(0.02) and math.isnan(returns["energy"].iloc[2])
    assert len(session.history()["record"]) == 17
