"""The tutorials run from the first cell to the last and show what their text describes."""

from __future__ import annotations

import ast
import math
from typing import Any

import nbformat
import pandas as pd
import pytest
from conftest import REPOSITORY, Service
from nbclient import NotebookClient
from test_documents import URL

from ballast import Ballast

FOLDER = REPOSITORY / "clients/python/examples"


def ran(service: Service, name: str) -> list[Any]:
    """Runs a notebook in its folder and returns its code cells."""
    stored = nbformat.read(FOLDER / name, as_version=4)  # type: ignore[no-untyped-call]
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in stored.cells), "stored with outputs"
    sources = [cell.source for cell in stored.cells]
    assert sum(URL in source for source in sources) == 1
    for cell in stored.cells:
        cell.source = cell.source.replace(URL, service.url)
    # A cell that hangs is ended. One walk takes minutes beside the other checks, at the lowest priority.
    client = NotebookClient(stored, timeout=900, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}})
    client.execute()
    return [cell for cell in stored.cells if cell.cell_type == "code"]


@pytest.fixture(scope="module")
def cells(service: Service) -> list[Any]:
    return ran(service, "first_advice.ipynb")


@pytest.fixture(scope="module")
def own(service: Service) -> list[Any]:
    return ran(service, "own_problem.ipynb")


def shown(cell: Any, media: str) -> list[str]:
    return [output["data"][media] for output in cell.outputs if media in output.get("data", {})]


def test_it_draws_what_became_of_wealth(cells: list[Any]) -> None:
    pictures = [cell.source for cell in cells if shown(cell, "image/png")]
    assert len(pictures) == 4 and {"walk.plot();", "session.plot();"} < set(pictures)


def test_its_advice_is_that_of_the_service(cells: list[Any], service: Service) -> None:
    (advice,) = [cell for cell in cells if "advice = ballast.advise(" in cell.source]
    market = pd.read_csv(REPOSITORY / "data/us_market_monthly.csv")
    past = market[(market["month"] >= "1988") & (market["month"] < "2008")]
    with Ballast(service.url) as ballast:
        rate = float(past["risk_free_return"].iloc[-1])
        simple = past["market_return"].to_list()
        direct = ballast.advise([math.log1p(value) for value in simple], kind="log", rate_per_step=rate)
    first = shown(advice, "text/plain")[0].splitlines()[0].split()
    assert first[0] == "allocation" and float(first[1]) == pytest.approx(direct["allocation"], abs=1e-6)


def test_they_say_nothing_that_they_should_not(cells: list[Any], own: list[Any]) -> None:
    assert not [output for cell in cells + own for output in cell.outputs if output.get("name") == "stderr"]


def test_a_problem_of_ones_own_does_what_its_text_says(own: list[Any]) -> None:
    assert [len(shown(cell, "image/png")) for cell in own] == [0, 0, 0, 1, 0, 1, 0, 1]
    first = ast.literal_eval(shown(own[2], "text/plain")[0])
    assert 15 < first["order"] < 30 and first["guessed"] < 0.2
    year, table = (shown(own[place], "text/plain")[0].splitlines() for place in (4, 6))
    months = [[float(number) for number in line.split()] for line in year[2:]]
    assert len(months) == 12 and "executed.order" in year[0]
    # What is left is what was there and came, less what was asked for, but never less than nothing.
    for before, (_, demand, order, _, left) in zip([[4.0], *months], months, strict=False):
        assert left == pytest.approx(max(before[-1] + order - demand, 0.0), abs=0.21)
    apart = {" ".join(line.split()[:-4]): [float(number) for number in line.split()[-2:]] for line in table[2:]}
    assert list(apart) == ["cautious", "trusting", "fill to 18", "fill to 25"]
    assert apart["trusting"][0] < 0 < apart["trusting"][1]
    assert apart["fill to 18"][1] < 0 and apart["fill to 25"][1] < 0
