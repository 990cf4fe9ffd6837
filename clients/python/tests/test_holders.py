"""A table is read like the file it came from, in every type that holds it, and each answer says what was read."""

from __future__ import annotations

import asyncio
import datetime
import io
import math
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from conftest import RETURNS, Service, train

from ballast import AsyncBallast, Ballast, ReportConflict, UnclearReturns, wire

MONTHS = 30
#: Ends of months, newest first, and prices that rise over time.
DAYS = [(datetime.date(2022, 7, 1) - datetime.timedelta(1))] + [
    datetime.date(2022 - (6 + month) // 12, 12 - (6 + month) % 12, 1) - datetime.timedelta(1) for month in range(MONTHS)
]
PRICES = [round(100.0 * math.exp(0.012 * age + 0.04 * math.sin(1.7 * age)), 4) for age in range(len(DAYS))][::-1]
RATES = [0.001 + 0.0001 * age for age in range(len(DAYS))][::-1]
FORMS = ["%d.%m.%Y", "%m/%d/%Y", "%b %d, %Y", "%Y/%m/%d", "%Y-%m-%d", "%Y%m%d", "%d %B %Y"]
ONCE: dict[str, Any] = {"radius": {"rule": "fixed", "radius": 0.004}}


def content(reading: Any) -> tuple[Any, ...]:
    """Returns the part of a reading that does not depend on how the record was written."""
    assert reading["outcome"] == "read", reading
    series = reading["series"][0]
    return reading.get("dates"), series["kind"], series["log_returns"], reading["newest_first"], reading["remarks"]


@pytest.mark.parametrize("form", FORMS)
def test_an_index_of_dates_is_read_as_in_the_file(ballast: Ballast, form: str, tmp_path: Path) -> None:
    text = "Date;Price\n" + "".join(f"{day:{form}};{price}\n" for day, price in zip(DAYS, PRICES, strict=True))
    file = ballast.read_returns(text)
    whole = content(file)
    assert whole[0][0] == "2020-01" and whole[3] and sum(whole[2]) > 0.0
    read = pd.read_csv(io.StringIO(text), sep=";", index_col=0)["Price"]
    assert content(ballast.read_returns(read)) == whole
    assert content(ballast.read_returns(read.to_frame())) == whole
    assert content(ballast.read_returns(pd.read_csv(io.StringIO(text), sep=";"))) == whole
    advised = ballast.advise(read, rate_per_step=0.001, **ONCE)
    assert advised["allocation"] == ballast.advise(text, rate_per_step=0.001, **ONCE)["allocation"] > 0.0
    (tmp_path / "record.csv").write_bytes(text.encode("cp1252"))
    assert content(ballast.read_returns(tmp_path / "record.csv")) == whole


@pytest.mark.parametrize(
    "index",
    [
        pd.DatetimeIndex(DAYS),
        pd.DatetimeIndex(DAYS).tz_localize("America/New_York"),
        pd.DatetimeIndex(DAYS).tz_localize("UTC").as_unit("s"),
        pd.DatetimeIndex(DAYS).to_period("M"),
        pd.DatetimeIndex(DAYS).to_period("D"),
        pd.Index(DAYS),
        pd.Index([int(f"{day:%Y%m}") for day in DAYS]),
        pd.Index([f"{day:%Y-%m}" for day in DAYS], name="Monat"),
        pd.CategoricalIndex([f"{day:%b %Y}" for day in DAYS]),
    ],
    ids=lambda index: f"{type(index).__name__} {index.dtype}",
)
def test_whatever_holds_the_dates_they_are_read(ballast: Ballast, index: Any) -> None:
    dates, kind, *_, newest_first, remarks = content(ballast.read_returns(pd.Series(PRICES, index, name="Price")))
    assert (dates[0], dates[-1], kind, newest_first) == ("2020-01", "2022-06", "price", True)
    assert remarks == ["The rows came newest first and are reversed."]


def test_an_index_is_read_or_refused_and_never_dropped(ballast: Ballast) -> None:
    falling = pd.Series(PRICES, name="Price")[::-1]
    for index in (falling.index, [f"week {day}" for day in range(31)], np.arange(31) ** 2, np.linspace(0.0, 1.0, 31)):
        reading: Any = ballast.read_returns(falling.set_axis(index))
        assert reading["outcome"] == "asked" and [each["asks"] for each in reading["questions"]] == ["newest_first"]
    # Row numbers of a part of a record mean no more than row numbers from 0.
    later = pd.Series(PRICES * 2, name="Price").iloc[20:45]
    assert content(ballast.read_returns(later)) == content(ballast.read_returns(later.reset_index(drop=True)))
    # The same holds for shuffled row numbers if the rows have a column of dates.
    table = pd.DataFrame({"date": [str(day) for day in DAYS], "Price": PRICES})
    assert content(ballast.read_returns(table.sort_values("date")))[:3] == content(ballast.read_returns(table))[:3]
    years = pd.Series([0.05, -0.03, 0.08, 0.02], [1990, 1991, 1992, 1993], name="return")
    assert content(ballast.read_returns(years))[0] == ["1990", "1991", "1992", "1993"]
    counted = pd.Series(years.to_list(), range(1990, 1994), name="return")
    assert content(ballast.read_returns(counted.rename_axis("year")))[0] == ["1990", "1991", "1992", "1993"]
    several = pd.DataFrame({"Price": PRICES}, pd.MultiIndex.from_product([["A"], DAYS]))
    hours = pd.Series([0.01, -0.02, 0.03], pd.period_range("2024-01-01 10:00", periods=3, freq="h"), name="return")
    assert "2024-01-01 11:00" in str(ballast.read_returns(hours))
    refused: dict[str, Any] = {
        "source is of type dict: must be a table": {"fund": PRICES},
        "source is of type NoneType: must be a table": None,
        "from 1990 to 1993, which may be years or row numbers": counted,
        "has 2 levels: must have one": several,
    }
    for message, wrong in refused.items():
        with pytest.raises(ValueError, match=message):
            ballast.read_returns(wrong)


def test_what_stands_beside_a_record_is_turned_round_with_it(ballast: Ballast) -> None:
    newest = pd.DataFrame({"fund": PRICES, "rf": RATES}, [f"{day:%d.%m.%Y}" for day in DAYS])
    oldest = newest.iloc[::-1]
    walks = [
        ballast.backtest(table["fund"], rate=rate, window=16, count=10, alpha=[0.5]).report()
        for table in (newest, oldest)
        for rate in (table["rf"], table["rf"].to_list())
    ]
    assert all(walk == walks[0] for walk in walks[1:])
    assert walks[0]["strategies"] == ballast.backtest(newest, window=16, count=10, alpha=[0.5]).report()["strategies"]
    two = newest.assign(bonds=[0.5 * price + day for day, price in enumerate(PRICES)])
    advised = [ballast.advise_assets(table, **ONCE)["allocation"] for table in (two, two.iloc[::-1])]
    assert advised[0] == advised[1] and set(advised[0]) == {"fund", "bonds"}
    orders: list[tuple[list[float], wire.Choices]] = [(PRICES, {"newest_first": True}), (PRICES[::-1], {})]
    lists = [
        ballast.advise(prices, kind="price", choices=choices, rate_per_step=0.001, **ONCE) for prices, choices in orders
    ]
    assert lists[0]["allocation"] == lists[1]["allocation"]


def test_frames_of_polars_and_tables_of_pyarrow_keep_their_headings_and_dates(ballast: Ballast) -> None:
    returns = [*RETURNS, *RETURNS[::-1]]
    frame = pd.DataFrame(
        {
            "date": pd.date_range("2020-01-31", periods=20, freq="ME"),
            "return": returns,
            "rf": [0.001] * 20,
            "other": [0.01 - 0.5 * value for value in returns],
        }
    )
    one, assets = frame[["date", "return", "rf"]], frame.rename(columns={"return": "fund"})
    expected = ballast.advise_assets(assets, **ONCE)
    assert set(expected["allocation"]) == {"fund", "other"}
    holders: list[Any] = [pl.DataFrame, pa.Table.from_pandas]
    for held in holders:
        assert ballast.read_returns(held(one)) == ballast.read_returns(one)
        assert ballast.advise_assets(held(assets), **ONCE) == expected
    # A gap is read alike in every notation.
    gap = one.assign(**{"return": [math.nan, *returns[1:]]})
    with_null = pl.DataFrame(gap).with_columns(pl.col("return").fill_nan(None))
    for held in (pl.DataFrame(gap), with_null, pa.Table.from_pandas(gap), pa.table(with_null)):
        assert content(ballast.read_returns(held)) == content(ballast.read_returns(gap))
    # A former index of pandas is still read as one.
    indexed = pa.Table.from_pandas(pd.DataFrame({"Price": PRICES}, [f"{day:%d.%m.%Y}" for day in DAYS]))
    assert content(ballast.read_returns(indexed))[0][0] == "2020-01"
    series = ballast.read_returns(pl.Series("Price", PRICES))
    assert series["outcome"] == "read" and series["series"][0]["kind"] == "price"


def test_headings_of_several_levels_are_those_that_tell_columns_apart(ballast: Ballast) -> None:
    days = pd.DatetimeIndex(DAYS[::-1])
    columns = pd.MultiIndex.from_tuples([("Close", "KLM"), ("Volume", "KLM")], names=["Price", "Ticker"])
    downloaded = pd.DataFrame(np.column_stack([PRICES[::-1], range(1000, 1031)]), days, columns)
    reading: Any = ballast.read_returns(downloaded)
    assert reading["series"][0]["column"] == "Close" and reading["frequency"] == "monthly"
    several = downloaded.set_axis(pd.MultiIndex.from_tuples([("Close", "KLM"), ("Close", "NOP")]), axis="columns")
    assert set(ballast.advise_assets(several, rate_per_step=0.001, **ONCE)["allocation"]) == {"KLM", "NOP"}


def test_what_was_read_comes_back_in_every_answer(ballast: Ballast, service: Service) -> None:
    dates = pd.period_range("2020-01", periods=24, freq="M")
    simple = [0.01 + 0.04 * math.sin(1.7 * month) for month in range(24)]
    one = pd.DataFrame({"fund": simple, "rf": 0.001}, dates)
    two = one.assign(other=[0.002 - 0.3 * value for value in simple])
    of_one, of_two = "24 monthly simple returns as fractions, January 2020", "as in columns fund, other."
    small: Any = {"horizon": 2, "design": {"count": 20}, **ONCE}
    training, of_assets = ballast.train(one, **small), ballast.train_assets(two, **small)
    answers: list[tuple[str | None, str]] = [
        (ballast.advise(one, **ONCE)["read"], of_one),
        (ballast.advise_assets(two, **ONCE)["read"], of_two),
        (training.read, of_one),
        (of_assets.read, of_two),
        (ballast.backtest(one, window=12, count=10, alpha=[0.5]).read, of_one),
        (ballast.backtest_assets(two, windows=[12], alpha=0.9).read, of_two),
        (ballast.frontier(one, scales=[0.0], resamples=20).read, of_one),
        (ballast.frontier(two, scales=[0.0], resamples=20).read, of_two),
        (training.session(history=one, kind="simple").read, of_one),
        (of_assets.session(history=two, kind="simple").read, of_two),
    ]
    for read, expected in answers:
        assert read is not None and expected in read
    assert training.session().read is None and ballast.training(training.id).read is None

    async def ask() -> None:
        async with AsyncBallast(service.url) as awaited:
            assert of_one in (await awaited.advise(one, **ONCE))["read"]
            assert of_two in ((await awaited.train_assets(two, **small)).read or "")

    asyncio.run(ask())


def test_numbers_without_a_heading_are_asked_for_their_kind(ballast: Ballast) -> None:
    session = train(ballast, idempotency_key="the policy of the tests").session()
    policy = ballast.policy(session.policy)
    plain, named = list(RETURNS), pd.Series(RETURNS, name="fund")
    calls: list[Any] = [
        lambda: ballast.advise(plain, rate_per_step=0.001),
        lambda: ballast.advise(np.array(plain), rate_per_step=0.001),
        lambda: ballast.train(pd.Series(plain), rate_per_step=0.001),
        lambda: ballast.backtest(pl.Series(plain), rate=0.001, dates=[f"2020-{month:02}" for month in range(1, 11)]),
        lambda: ballast.advise_assets([[value, -value] for value in plain], assets=["a", "b"], rate_per_step=0.001),
        lambda: policy.session(history=plain),
        # Histories of the service are log-returns, even after conversion to another type.
        lambda: policy.session(history=pd.Series(session.history()["history"], name="fund")),
        lambda: policy.session(history=named),
    ]
    for call in calls:
        with pytest.raises(UnclearReturns, match=r"way: choose one with kind\.\nAre these simple") as caught:
            call()
        assert [question["asks"] for question in caught.value.questions] == ["kind"]
        assert "\n  kind='simple': 10 simple returns as fractions" in str(caught.value)
        assert "\n  kind='log': 10 log-returns as fractions" in str(caught.value)
    # If numbers may also be percent, both questions come at once.
    with pytest.raises(UnclearReturns, match="choose one with kind and choices") as caught:
        ballast.advise([0.4, -0.3, 0.8, 0.1], rate_per_step=0.001)
    assert [question["asks"] for question in caught.value.questions] == ["kind", "unit"]
    # Prices raise no question, and a heading counts as in a file.
    assert "returns of prices" in ballast.advise(PRICES[::-1], rate_per_step=0.001, **ONCE)["read"]
    assert "simple returns" in ballast.advise(named, rate_per_step=0.001, **ONCE)["read"]
    assert "log-returns" in ballast.advise(named.rename("log_return"), rate_per_step=0.001, **ONCE)["read"]


def test_a_history_of_the_service_is_taken_bit_for_bit(ballast: Ballast) -> None:
    policy = train(ballast, idempotency_key="the policy of the tests").policy()
    known = [math.log1p(0.01 + 0.043 * math.sin(1.7 * month)) for month in range(17)]
    first = policy.session(history=known, kind="log", wealth=5e4 / 3.0, holding=1.0 / 3.0)
    past = first.history()
    assert past["history"] == known and first.read is not None
    copies = [
        policy.session(history=past),
        policy.session(history=first.history()["history"], wealth=5e4 / 3.0, holding=1.0 / 3.0),
    ]
    for session in (first, *copies):
        session.observe(simple_return=0.0371, flow=12.5).observe(simple_return=-0.0117, rate=0.0021)
    for copy in copies:
        assert copy.read == "17 log-returns as fractions, as the service returned them."
        assert (copy.wealth, copy.holding) == (first.wealth, first.holding)
        assert copy.history()["history"] == known
        pd.testing.assert_frame_equal(copy.frame(), first.frame(), check_exact=True)
    # Other arguments override the history, and the history of a policy is known too.
    assert policy.session(history=past, wealth=7.0).wealth == 7.0
    problem = policy.detail()["specification"]["problem"]
    assert ballast.advise(problem["history"], rate_per_step=0.001)["read"].startswith("10 log-returns")
    with pytest.raises(
        ValueError, match="kind is 'simple': must be 'log' or left out, because history are log-returns"
    ):
        policy.session(history=past, kind="simple")


def test_a_session_of_several_assets_starts_from_rows_and_from_a_history_and_is_replayed(
    ballast: Ballast, tmp_path: Path
) -> None:
    rows = [[value, 0.008 - 0.3 * value] for value in RETURNS]
    policy = ballast.train_assets(
        rows, kind="simple", assets=["stocks", "bonds"], rate_per_step=0.001, horizon=3, design={"count": 20}, **ONCE
    ).policy()
    table = pd.DataFrame(rows, columns=["stocks", "bonds"])
    table[["bonds", "stocks"]].to_csv(tmp_path / "known.csv", index=False)
    sessions = [
        policy.session(history=rows, kind="simple", holdings={"stocks": 0.1, "bonds": 0.2}),
        policy.session(history=pl.DataFrame(table[["bonds", "stocks"]]), kind="simple"),
        policy.session(history=tmp_path / "known.csv"),
    ]
    starts = [session.history()["history"] for session in sessions]
    assert starts[1] == starts[2] == starts[0]
    np.testing.assert_allclose(cast("Any", starts[0]), np.log1p(rows), atol=1e-15)
    sessions.append(policy.session(history=sessions[0].history()))
    held = sessions[3].assets_action()["holdings"]
    assert held == sessions[0].assets_action()["holdings"] and held["bonds"] == 0.2
    lived = pd.DataFrame(
        {"bonds": [0.01, -0.015], "stocks": [0.03, 0.04]}, index=pd.period_range("2024-01", periods=2, freq="M")
    )
    first = sessions[0].replay(lived, kind="simple", rate=0.002)
    by_rows = sessions[3].replay(
        lived[["stocks", "bonds"]].to_numpy(), kind="simple", rate=0.002, dates=["2024-01-31", "2024-02-29"]
    )
    pd.testing.assert_frame_equal(first.set_index("period"), by_rows, check_exact=True)
    assert list(first.index) == list(lived.index) and first["date"].dt.day.tolist() == [31, 29]
    pd.testing.assert_frame_equal(
        sessions[0].assets_frame()[["bonds", "stocks"]].reset_index(drop=True), lived.reset_index(drop=True)
    )
    by_hand = policy.session(history=sessions[0].history())
    for _, row in lived.iterrows():
        by_hand.observe(simple_returns=row, rate=0.002, executed_allocations={"stocks": 0.5, "bonds": 0.25})
    other = policy.session(history=sessions[0].history())
    shares = pd.DataFrame({"bonds": 0.25, "stocks": 0.5}, index=lived.index)
    prices = pd.concat([pd.DataFrame(1.0, [pd.Period("2023-12", "M")], lived.columns), (1.0 + lived).cumprod()])
    other.replay(lived, kind="simple", rate=0.002, executed_allocation=shares)
    assert other.wealth == pytest.approx(by_hand.wealth, rel=1e-14)
    again = policy.session(history=sessions[0].history()).replay(prices, kind="price", rate=0.002)
    np.testing.assert_allclose(again["wealth"], first["wealth"], rtol=1e-12)
    wrong: dict[str, Any] = {
        r"returns has the columns \['gold', 'stocks'\]: must have those of the session": lived.rename(
            columns={"bonds": "gold"}
        ),
        r"returns\[1\] has 1 numbers: must have one for each": [[0.1, 0.1], [0.1]],
        r"returns of bonds\[0\] is '': must be a number": lived.assign(bonds=[None, 0.1]),
    }
    for message, returns in wrong.items():
        with pytest.raises(ValueError, match=message):
            sessions[1].replay(returns, kind="simple")


def test_an_object_behind_its_session_says_so(ballast: Ballast) -> None:
    policy = train(ballast, idempotency_key="the policy of the tests").policy()
    other = train(ballast, trading_cost=0.001).policy()
    session = policy.session(renew={"every": 2})
    stale = [ballast.session(session.id) for _ in range(3)]
    session.observe(log_return=0.01)
    session.correct(1, "a slip", log_return=0.02)
    session.renew(other.id)
    calls: list[tuple[str, Any]] = [
        (
            r"period 1 was observed at \d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC, which",
            lambda: stale[0].observe(log_return=0.03),
        ),
        (r"correction 1 was made at .* UTC, which", lambda: stale[1].correct(1, "another", log_return=0.04)),
        (
            r"renewal 1 was made at .* UTC \(the service renews the session every 2 periods\), which this object "
            r"has not seen: call refresh\(\)",
            lambda: stale[2].renew(policy.id),
        ),
    ]
    for message, call in calls:
        with pytest.raises(ReportConflict, match=message):
            call()
    assert stale[2].refresh().renew(policy.id)["renewal"] == 2
    with pytest.raises(ReportConflict, match="was reported with other content"):
        session.observe(period=1, log_return=0.5)
