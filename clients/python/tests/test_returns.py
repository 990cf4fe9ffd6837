"""Returns come in whatever holds numbers; what cannot be meant is refused here, before it is sent."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import pandas as pd
import pytest
from conftest import RETURNS, train

from ballast import Ballast
from ballast.returns import Kind, log_returns

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
        (pd.Series([1.0, 2.0], index=[2, 1]), "price", "must come oldest first"),
    ],
)
def test_what_cannot_be_meant_is_refused(returns: Any, kind: Kind, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        log_returns(returns, kind)


def test_a_series_trains_as_its_list_does(ballast: Ballast) -> None:
    series = pd.Series(RETURNS, index=pd.date_range("2007-01", periods=len(RETURNS), freq="MS"))
    count = pd.Series([3]).iloc[0]
    assert not isinstance(count, int)
    from_series = ballast.train(series, kind="log", horizon=count, rate_per_step=0.001, design={"count": 20})
    assert from_series.policy().id == train(ballast).policy().id


def test_nothing_imports_pandas_or_numpy() -> None:
    code = "import ballast, sys; sys.exit(bool({'pandas', 'numpy'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
