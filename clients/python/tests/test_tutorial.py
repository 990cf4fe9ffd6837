"""The tutorial runs from the first cell to the last and shows what its text describes."""

from __future__ import annotations

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


@pytest.fixture(scope="module")
def cells(service: Service) -> list[Any]:
    """Runs the notebook in its folder and returns its code cells."""
    stored = nbformat.read(FOLDER / "first_advice.ipynb", as_version=4)  # type: ignore[no-untyped-call]
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in stored.cells), "stored with outputs"
    sources = [cell.source for cell in stored.cells]
    assert sum(URL in source for source in sources) == 1
    for cell in stored.cells:
        cell.source = cell.source.replace(URL, service.url)
    # A cell that hangs is ended. One walk takes minutes beside the other checks, at the lowest priority.
    client = NotebookClient(stored, timeout=900, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}})
    client.execute()
    return [cell for cell in stored.cells if cell.cell_type == "code"]


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


def test_it_says_nothing_that_it_should_not(cells: list[Any]) -> None:
    assert not [output for cell in cells for output in cell.outputs if output.get("name") == "stderr"]
