"""Follows a policy through 2008 as `ballast demo` does, and prints the same table.

It needs a running service, `ballast serve --data ballast-data`; `--count 60` trains a coarser policy faster.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from ballast import Ballast, ProgressPrinter

DATA = Path(__file__).resolve().parents[3] / "data" / "us_market_monthly.csv"
HISTORY = 240
YEAR = "2008"
INITIAL_WEALTH = 100.0


def main() -> None:
    parser = argparse.ArgumentParser(description="Follows a policy through 2008 on the bundled returns.")
    parser.add_argument("--url", default="http://127.0.0.1:8080", help="address of the service")
    parser.add_argument("--count", type=int, default=500, help="design points per step")
    arguments = parser.parse_args()

    market = pd.read_csv(DATA, index_col="month")
    past, year = market[market.index < f"{YEAR}-01"].tail(HISTORY), market[market.index.str.startswith(YEAR)]
    rate = float(past["risk_free_return"].iloc[-1])
    with Ballast(arguments.url) as ballast:
        session = ballast.train(
            past["market_return"],
            kind="simple",
            horizon=len(year),
            rate_per_step=rate,
            initial_wealth=INITIAL_WEALTH,
            utility={"kind": "power", "risk_aversion": 3.0},
            radius={"rule": "bridge", "alpha": 0.1},
            support={"rule": "none"},
            design={"count": arguments.count},
        ).session(watch=ProgressPrinter())
        rows = []
        for month, realised in year["market_return"].items():
            action = session.action()
            session.observe(simple_return=realised, confirm=True)  # October 2008 is unusual but correct
            rows.append((month, action["radius"], action["allocation"], realised, session.wealth))

    table = pd.DataFrame(rows, columns=["month", "radius", "allocation", "return", "wealth"]).set_index("month")
    table["All in the bank"] = [INITIAL_WEALTH * (1 + rate) ** period for period in range(1, len(table) + 1)]
    table["All in stocks"] = INITIAL_WEALTH * (1 + table["return"]).cumprod()
    print(f"The year {YEAR}, month by month (the bank pays {100 * rate:.2f} % throughout):")
    print(shown(table))


def shown(table: pd.DataFrame) -> str:
    """Formats the table with the columns of the demo."""
    head = "{:<8} {:>8} {:>11} {:>10} {:>9} {:>16} {:>14}".format(table.index.name, *table.columns)
    line = "{:<8} {:>8.4f} {:>11.3f} {:>8.2f} % {:>9.2f} {:>16.2f} {:>14.2f}"
    in_percent = table.assign(**{"return": 100 * table["return"]})
    return "\n".join([head, *(line.format(*row) for row in in_percent.itertuples())])


if __name__ == "__main__":
    main()
