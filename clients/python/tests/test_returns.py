"""Returns in every type that holds numbers. The client refuses invalid ones before it sends them."""

from __future__ import annotations

import asyncio
import math
import subprocess
import sys
from collections.abc import Callable
from inspect import signature
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from conftest import RETURNS, Service, train

from ballast import AsyncBallast, Ballast, UnclearReturns, wire
from ballast.policy import Opening
from ballast.returns import Kind, dates_of, log_returns, per_period

SIMPLE = [0.02, -0.05, 0.0]
LOGS = [math.log(1.02), math.log(0.95), 0.0]
INDEX = pd.date_range("2008-01", periods=3, freq="MS")


@pytest.mark.parametrize(
    "held",
    [
        SIMPLE,
        tuple(SIMPLE),
        iter(SIMPLE),
        pd.Series(SIMPLE, index=INDEX),
        pd.Series(SIMPLE).to_numpy(),
        pd.DataFrame({"market": SIMPLE}, index=INDEX),
        pd.DataFrame({"market": SIMPLE}).to_numpy(),
    ],
    ids=lambda held: type(held).__name__,
)
def test_every_holder_gives_the_same_numbers(held: Any) -> None:
    found = log_returns(held, "simple")
    assert found == pytest.approx(LOGS, abs=1e-15)
    assert all(type(number) is float for number in found)


def test_kinds_agree() -> None:
    prices = [50.0]
    for simple in SIMPLE:
        prices.append(prices[-1] * (1 + simple))
    assert log_returns(prices, "price") == pytest.approx(LOGS, abs=1e-15)
    assert log_returns(LOGS, "log") == LOGS


@pytest.mark.parametrize(
    ("returns", "kind", "message"),
    [
        (pd.Series([1.0, 2.0]).pct_change(), "simple", r"returns\[0\] is nan: must be finite"),
        ([0.1, math.inf], "log", r"returns\[1\] is inf: must be finite"),
        ([0.1, -1.0], "simple", r"returns\[1\] is -1.0: must be above -1"),
        ([3.0, 0.0], "price", r"returns\[1\] is 0.0: must be above 0"),
        ([0.1], "prices", "kind is 'prices': must be"),
        (pd.DataFrame({"a": [0.1], "b": [0.2]}), "log", r"\(1, 2\), \['a', 'b'\]: must be one column"),
        (pd.Series([1.0, 2.0], index=[2, 1]), "price", "index of returns begins with 2: must hold dates"),
        (pd.Series(SIMPLE, index=["31.12.2024", "29.11.2024", "31.10.2024"]), "log", "begins with 31.12.2024: must"),
        (pd.Series(SIMPLE, index=[20241231, 20241130, 20241031]), "log", "begins with 20241231: must hold dates"),
        (pd.Series(SIMPLE, index=["a", "b", "c"]), "log", "begins with a: must hold dates"),
        (pd.Series([0.1, pd.NA]), "log", r"returns\[1\] is <NA>: must be a number"),
        ([0.1, "n/a"], "log", r"returns\[1\] is 'n/a': must be a number"),
        (pd.Series(SIMPLE, index=INDEX[::-1]), "simple", "has 2008-02-01 after 2008-03-01: dates must increase"),
        (pd.Series(SIMPLE, index=INDEX[[0, 1, 1]]), "log", "returns has 2008-02-01 twice: must have each date once"),
        (pd.Series(SIMPLE, index=[INDEX[0], pd.NaT, INDEX[2]]), "log", "has NaT after 2008-01-01: dates must increase"),
        (pd.Series(SIMPLE, index=["2008-02", "2008-01", "2008-03"]), "log", "has 2008-01 after 2008-02"),
        (pd.DataFrame({"a": SIMPLE}, index=INDEX[[1, 0, 2]].to_period("M")), "log", "has 2008-01-31 after 2008-02-29"),
        ([100 * value for value in SIMPLE], "log", r"a standard deviation of 2\.94 a period: must be at most 0\.3"),
        ([2.0, -0.5, 0.0], "simple", r"must be at most 0\.3; give fractions, 0\.01 for 1 %"),
    ],
)
def test_what_cannot_be_meant_is_refused(returns: Any, kind: Kind, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        log_returns(returns, kind)


def test_what_cannot_be_meant_of_several_assets_is_refused(ballast: Ballast) -> None:
    months = pd.DataFrame({"stocks": [*SIMPLE, 0.03], "bonds": [0.01, 0.0, -0.01, 0.02]}, index=MONTHS[:4])
    given: dict[str, Any] = {"kind": "simple", "rate_per_step": 0.0}
    refused = {
        r"line 3: date is \"2005-01-31\": must be later than 2005-03-31": months.iloc[[2, 0, 1, 3]],
        r"line 3: bonds is \"\": there is no number in 1 of 4 rows": months.assign(bonds=[0.01, math.nan, 0.02, 0.01]),
        "assets has 'stocks' twice": months.set_axis(["stocks", "stocks"], axis="columns"),
        r"returns\[1\] has 1 numbers: must have one for each of \['stocks', 'bonds'\]": [[0.1, 0.2], [0.1]],
        "assets is None: must name the columns because returns is no DataFrame, text or file": months.to_numpy(),
    }
    for message, wrong in refused.items():
        names = ["stocks", "bonds"] if isinstance(wrong, list) else None
        with pytest.raises(ValueError, match=message):
            ballast.advise_assets(wrong, assets=names, **given)


def test_what_a_vendor_writes_beside_a_price_is_no_asset(ballast: Ballast) -> None:
    quotes = pd.DataFrame(
        {"Close": [100.0, 101.0, 99.5, 102.0], "Adj Close": [90.0, 91.0, 89.5, 92.0]}, index=MONTHS[:4]
    )
    quotes = quotes.assign(Open=[99.0, 100.5, 101.0, 99.0], Volume=[120300, 133200, 120900, 140100])
    with pytest.raises(ValueError, match="returns holds one asset, in column Adj Close: assets must name several"):
        ballast.advise_assets(quotes, rate_per_step=0.001, **ONCE)
    with pytest.raises(ValueError, match="Column Volume holds the traded volume"):
        ballast.advise_assets(quotes, assets=["Adj Close", "Volume"], rate_per_step=0.001, **ONCE)


def test_several_assets_are_the_same_in_rows_in_a_frame_and_in_a_file(ballast: Ballast, tmp_path: Path) -> None:
    rows = [[value, 0.002 - 0.3 * value] for value in RECORD]
    # Column names that are numbers, such as those of deciles, are not read as a row of numbers.
    table = pd.DataFrame(rows, index=MONTHS, columns=["1", "2"])
    # The dates show how many periods make a year, and the column of the bank shows its rates.
    given: dict[str, Any] = {"kind": "simple", "rate_per_step": BANK[-1], "periods_per_year": 12.0, **ONCE}
    plain = ballast.advise_assets(rows, assets=["1", "2"], **given)
    assert set(plain["allocation"]) == {"1", "2"} and plain["sample_size"] == 24
    assert plain.pop("read").startswith("24 simple returns as fractions, as in columns asset 1, asset 2")  # type: ignore[misc]
    assert unread(ballast.advise_assets(table, rate_per_step=BANK[-1], **ONCE)) == plain
    assert unread(ballast.advise_assets(table.assign(rf=BANK), assets=["1", "2"], **ONCE)) == plain
    assert unread(ballast.advise_assets(table.rename(columns=int), rate_per_step=BANK[-1], **ONCE)) == plain
    named = table.set_axis(["one", "two"], axis="columns").assign(rf=BANK)
    named.to_csv(tmp_path / "named.csv")
    for held in (pl.DataFrame(rows, schema=["1", "2"], orient="row"), pa.table({"1": table["1"], "2": table["2"]})):
        assert unread(ballast.advise_assets(held, **given)) == plain
    # Dates and the rates of the bank are no assets, in whichever column they are.
    for returns in (
        named,
        named.rename_axis("month").reset_index(),
        tmp_path / "named.csv",
        str(tmp_path / "named.csv"),
    ):
        for assets in (None, ["one", "two"]):
            found = ballast.advise_assets(returns, assets=assets, **ONCE)
            assert found["allocation"] == {"one": plain["allocation"]["1"], "two": plain["allocation"]["2"]}
    with pytest.raises(FileNotFoundError):
        ballast.advise_assets("missing.csv")
    # The bank is no second asset of a frontier either.
    inputs: list[tuple[Any, float | None]] = [(named[["one", "rf"]], None), (named["one"], BANK[-1])]
    ends = [
        ballast.frontier(returns, rate_per_step=rate, scales=[0.0], resamples=20).report() for returns, rate in inputs
    ]
    assert ends[0]["resampled"] == ends[1]["resampled"]
    with pytest.raises(UnclearReturns, match="or all of them as several assets: advise_assets"):
        ballast.advise(table, rate_per_step=0.0)


def test_a_volatile_record_can_be_given_as_prices() -> None:
    assert log_returns([1.0, 3.0, 1.0, 4.0], "price") == [math.log(3.0), -math.log(3.0), math.log(4.0)]
    assert log_returns([1.5], "log") == [1.5]


@pytest.mark.parametrize(
    ("index", "dates"),
    [
        (INDEX, ["2008-01-01", "2008-02-01", "2008-03-01"]),
        (INDEX.tz_localize("America/New_York"), ["2008-01-01", "2008-02-01", "2008-03-01"]),
        (INDEX.to_period("M"), ["2008-01-31", "2008-02-29", "2008-03-31"]),
        (pd.period_range("2008Q1", periods=3, freq="Q"), ["2008-03-31", "2008-06-30", "2008-09-30"]),
        (pd.Index([date.date() for date in INDEX]), ["2008-01-01", "2008-02-01", "2008-03-01"]),
        (["2008-01", "2008-02", "2008-03"], ["2008-01", "2008-02", "2008-03"]),
        ([2008, 2009, 2010], ["2008-12-31", "2009-12-31", "2010-12-31"]),
        ([7, 8, 9], None),
        (None, None),
    ],
)
def test_dates_come_from_the_index(index: Any, dates: list[str] | None) -> None:
    assert dates_of(pd.Series(SIMPLE, index=index)) == dates_of(pd.DataFrame({"a": SIMPLE}, index=index)) == dates
    assert dates_of(SIMPLE) is None


def test_a_walk_forward_takes_dates_and_rates_from_pandas(ballast: Ballast) -> None:
    quarters = pd.date_range("2020-01", periods=13, freq="QS")
    simple = [0.02 + 0.03 * math.sin(1.7 * quarter) for quarter in range(12)]
    prices = pd.Series(100.0, quarters) * pd.Series([1.0, *(1.0 + pd.Series(simple)).cumprod()], quarters)
    rate = pd.Series([math.nan] + [0.002] * 12, quarters)
    choices: dict[str, Any] = {"window": 8, "count": 10, "alpha": [0.5]}
    report = ballast.backtest(prices, kind="price", rate=rate, **choices).report()
    assert report["dates"] == ["2022-04", "2022-07", "2022-10", "2023-01"] and report["frequency"] == "quarterly"
    plain = ballast.backtest(
        prices.to_list(), kind="price", rate=rate.to_list(), dates=[str(date) for date in quarters], **choices
    ).report()
    assert plain == report
    # The first price has no change, so neither it nor the rate of the bank beside it is a period.
    changes = prices.pct_change()
    later = ballast.backtest(changes.dropna(), kind="simple", rate=rate[1:], **choices).report()
    assert ballast.backtest(changes, kind="simple", rate=rate, **choices).report() == later
    table = pd.DataFrame({"stocks": changes, "bonds": 0.3 * changes.shift(-1)}).shift(-1)
    assert per_period("rate", range(13), table, 12, "simple") == list(range(12))
    with pytest.raises(ValueError, match="rate has another index than returns: align the two first"):
        ballast.backtest(prices, kind="price", rate=rate.shift(freq="D"), **choices)
    with pytest.raises(ValueError, match="dates has 12 entries: must have 13, one for each entry of returns"):
        ballast.backtest(prices, kind="price", rate=0.002, dates=quarters[1:], **choices)


def test_a_text_a_file_and_a_table_are_read_alike(ballast: Ballast, tmp_path: Path) -> None:
    table = pd.Series(SIMPLE, index=INDEX, name="fund")
    text = "date,fund\n2008-01-01,0.02\n2008-02-01,-0.05\n2008-03-01,0\n"
    for encoding in ("utf-8-sig", "utf-16"):
        (tmp_path / encoding).write_text(text, encoding)
    for source in (text, table, table.to_frame(), tmp_path / "utf-8-sig", tmp_path / "utf-16"):
        reading: Any = ballast.read_returns(source)
        assert reading["outcome"] == "read" and reading["frequency"] == "monthly", reading
        assert reading["series"][0]["log_returns"] == pytest.approx(LOGS, abs=1e-15)
    percent: Any = ballast.read_returns("0.2 -0.15 0.3", unit="percent")
    assert percent["series"][0]["log_returns"][0] == pytest.approx(math.log(1.002), abs=1e-15)
    unclear: Any = ballast.read_returns("0.2 -0.15 0.3")
    assert [question["asks"] for question in unclear["questions"]] == ["unit"]


def unread(answer: Any) -> dict[str, Any]:
    """Returns an answer without the sentence that says how the returns were read."""
    assert answer["read"]
    return {name: value for name, value in answer.items() if name != "read"}


MONTHS = pd.period_range("2005-01", periods=24, freq="M")
RECORD = [0.01 + 0.04 * math.sin(1.7 * month) for month in range(24)]
BANK = [0.002 + 0.0001 * month for month in range(24)]
ONCE: dict[str, Any] = {"radius": {"rule": "fixed", "radius": 0.004}}


def test_what_a_quant_has_is_read_by_the_service(ballast: Ballast, tmp_path: Path) -> None:
    prices = [100.0]
    for value in RECORD:
        prices.append(prices[-1] * (1.0 + value))
    table = pd.DataFrame({"fund": RECORD, "rf": BANK}, index=MONTHS)
    path = tmp_path / "fund.csv"
    table.to_csv(path)
    given = {"rate_per_step": BANK[-1], **ONCE}
    plain = ballast.advise(RECORD, kind="simple", **given)
    held = [RECORD, tuple(RECORD), np.array(RECORD), np.array(RECORD)[:, None], pd.Series(RECORD), pl.Series(RECORD)]
    held += [pd.Series(RECORD, MONTHS), pa.array(RECORD), pd.DataFrame(RECORD)]
    for returns in held:
        with pytest.raises(UnclearReturns, match=r"kind='log': 24 (monthly )?log-returns as fractions"):
            ballast.advise(returns, **given)
        found = ballast.advise(returns, kind="simple", **given)
        assert found["allocation"] == pytest.approx(plain["allocation"], abs=1e-6), returns
    for returns in (table["fund"], pd.Series(RECORD, MONTHS.to_timestamp(), name="fund"), pl.Series("fund", RECORD)):
        found = ballast.advise(returns, **given)
        assert found["allocation"] == pytest.approx(plain["allocation"], abs=1e-6), returns
    days = pd.period_range("2004-12", periods=25, freq="M")
    for priced in (prices, pd.Series(prices, days, name="close")):
        found = ballast.advise(priced, choices={"kind": "price"}, **given)
        assert found["allocation"] == pytest.approx(plain["allocation"], abs=1e-6)
    # The column of the bank gives its rates.
    for source in (table, path, path.read_text()):
        assert ballast.advise(source, **ONCE)["allocation"] == pytest.approx(plain["allocation"], abs=1e-6)
    detail = ballast.train(path, horizon=2, design={"count": 20}, **ONCE).policy().detail()
    problem = cast(wire.ProblemSpecification, detail["specification"]["problem"])
    assert problem["rate_per_step"] == BANK[-1]
    assert problem.get("periods_per_year") == 12
    report = ballast.backtest(table, window=12, count=10, alpha=[0.5]).report()
    assert report["dates"] == [str(month) for month in MONTHS[12:]]
    same = ballast.backtest(table["fund"], kind="simple", rate=table["rf"], window=12, count=10, alpha=[0.5]).report()
    assert report["strategies"] == same["strategies"]


def test_what_can_be_read_in_two_ways_is_asked_by_name(ballast: Ballast) -> None:
    calm = pd.DataFrame({"fund": [0.022 + value for value in RECORD]}, index=MONTHS)
    for call in (ballast.advise, ballast.train):
        with pytest.raises(UnclearReturns) as caught:
            call(calm, rate_per_step=0.001)
        assert caught.value.argument == "returns"
        assert [question["asks"] for question in caught.value.questions] == ["unit"]
        text = str(caught.value)
        assert text.startswith("returns can be read in more than one way: choose one with choices.")
        assert "choices={'unit': 'fraction'}: 24 monthly simple returns as fractions" in text
        assert "choices={'unit': 'percent'}: 24 monthly simple returns in percent" in text
    advised = ballast.advise(calm, choices={"unit": "percent"}, rate_per_step=0.0, **ONCE)
    assert advised["sample_size"] == 24
    refused: dict[str, Any] = {
        r"returns: line 1: column 2 is \"x\": must be a number": "0.1 x 0.3",
        "returns: The numbers do not vary": [-0.01, -0.01, -0.01],
        r"line 2: column 1 is \"NaN\": there is no number in 1 of 3 rows": pd.Series([0.01, math.nan, -0.02]),
        r"line 3: fund is \"NaN\": there is no number in 1 of 3 rows": pd.DataFrame(
            {"fund": [0.01, None, -0.02], "rf": [0.0, None, 0.0]}
        ),
    }
    for message, wrong in refused.items():
        with pytest.raises(ValueError, match=message):
            ballast.advise(wrong, rate_per_step=0.0)
    with pytest.raises(ValueError, match="rate_per_step is missing: must be given"):
        ballast.advise(RECORD, kind="simple")
    with pytest.raises(ValueError, match="rate is missing: must be given"):
        ballast.backtest(RECORD, kind="simple")


def test_a_calm_record_in_percent_is_asked_about_though_its_kind_is_said(ballast: Ballast) -> None:
    """0.4 % and 40 % look alike, even if the caller says that they are simple returns."""
    percent = [0.4, -0.3, 0.8, 0.1, -0.2, 0.5, 0.3, -0.1]
    table = pd.DataFrame({"one": percent, "two": percent[::-1]})
    given: dict[str, Any] = {"rate_per_step": 0.0005}
    calls: list[Callable[..., Any]] = [
        lambda **more: ballast.advise(percent, **given, **more),
        lambda **more: ballast.train(percent, design={"count": 20}, horizon=2, **given, **more),
        lambda **more: ballast.frontier(percent, scales=[0.0], resamples=20, **given, **more),
        lambda **more: ballast.backtest(percent, rate=0.0005, window=4, periods_per_year=12, **more),
        lambda **more: ballast.advise_assets(table, **given, **more),
        lambda **more: ballast.train_assets(table, design={"count": 20}, horizon=2, **given, **more),
        lambda **more: ballast.frontier(table, scales=[0.0], resamples=20, **given, **more),
    ]
    for call in calls:
        for kind in ("simple", "log"):
            with pytest.raises(UnclearReturns) as caught:
                call(kind=kind)
            assert [question["asks"] for question in caught.value.questions] == ["unit"]
            assert "choices={'unit': 'percent'}: " in str(caught.value)
    in_percent = ballast.advise(percent, kind="simple", choices={"unit": "percent"}, **given)
    fractions = ballast.advise([value / 100.0 for value in percent], kind="simple", **given)
    assert unread(in_percent) == unread(fractions)
    of_both = ballast.advise_assets(table, kind="simple", choices={"unit": "percent"}, **given)
    assert of_both["allocation"] == pytest.approx(
        ballast.advise_assets(table / 100.0, kind="simple", **given)["allocation"], abs=1e-9
    )
    # Prices have no unit.
    assert ballast.advise([100.4, 100.1, 100.9, 101.0], kind="price", **given)["sample_size"] == 3


def test_it_is_read_alike_where_it_is_awaited(service: Service) -> None:
    async def ask() -> None:
        async with AsyncBallast(service.url) as ballast:
            table = pd.DataFrame({"fund": RECORD, "rf": BANK}, index=MONTHS)
            assert (await ballast.advise(table, **ONCE))["sample_size"] == 24
            with pytest.raises(UnclearReturns):
                await ballast.advise(0.022 + table[["fund"]], rate_per_step=0.0)

    asyncio.run(ask())


def test_the_history_of_a_session_is_named(ballast: Ballast) -> None:
    with pytest.raises(ValueError, match=r"line 2: column 1 is .NaN.: there is no number in 1 of 3 rows"):
        ballast.policy("x").session(history=[0.01, math.nan, 0.02])


def test_a_series_trains_as_its_list_does(ballast: Ballast) -> None:
    series = pd.Series(RETURNS, index=pd.date_range("2007-01", periods=len(RETURNS), freq="MS"))
    count = pd.Series([3]).iloc[0]
    assert not isinstance(count, int)
    from_series = ballast.train(series, kind="log", horizon=count, rate_per_step=0.001, design={"count": 20})
    # Its dates show that the periods are months.
    assert from_series.policy().id == train(ballast, periods_per_year=12).policy().id


def test_a_strategy_of_one_s_own_is_a_formula_or_shares_by_period(ballast: Ballast) -> None:
    dates = [f"{2000 + month // 12}-{1 + month % 12:02}" for month in range(40)]
    returns = [0.01 * ((7 * month) % 5 - 1.9) for month in range(40)]
    trend = [0.0 if month < 3 else float(sum(returns[month - 3 : month]) > 0) for month in range(40)]
    own: dict[str, str | list[float]] = {"Formula": "if(mean3 > 0, 1, 0)", "Shares": trend}
    choices: dict[str, Any] = {"window": 24, "every": 4, "alpha": [0.5], "count": 10, "weights": own}
    report = ballast.backtest(returns, kind="simple", rate=0.001, dates=dates, **choices).report()
    wealth = {line["strategy"]: line["wealth"] for line in report["periods"]}
    assert set(trend[24:]) == {0.0, 1.0}
    np.testing.assert_allclose(wealth["Formula"], wealth["Shares"], rtol=1e-12)


def test_nothing_imports_pandas_or_numpy() -> None:
    code = "import ballast, sys; sys.exit(bool({'pandas', 'numpy'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_what_is_learned_from_is_read_everywhere_by_one_rule(ballast: Ballast) -> None:
    public = [getattr(Ballast, name) for name in dir(Ballast) if not name.startswith("_")]
    calls = [call for call in public if callable(call) and "kind" in signature(call).parameters]
    assert len(calls) == 9
    for call in calls:
        defaults = {name: signature(call).parameters[name].default for name in ("kind", "choices")}
        assert defaults == {"kind": None, "choices": None}, call
    assert {"kind", "choices"} <= Opening.__optional_keys__
    policy = train(ballast).policy()
    kinds: list[tuple[Kind, list[float]]] = [("simple", [math.log1p(value) for value in RETURNS]), ("log", RETURNS)]
    for kind, expected in kinds:
        known = policy.session(history=RETURNS, kind=kind).history()["history"]
        np.testing.assert_allclose(cast("Any", known), expected, atol=1e-15)
