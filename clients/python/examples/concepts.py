"""Draws the pictures of `docs/concepts.md` from the bundled returns, and prints the figures that the page quotes.

It needs a running service, `ballast serve --data ballast-data`, and writes four SVG files into the folder of `--out`.
"""

from __future__ import annotations

import argparse
import math
import random
from html import escape
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

from ballast import Ballast, wire

DATA = Path(__file__).resolve().parents[3] / "data"
WIDTH = 640
#: Number of randomly drawn records, and how many of them are shown.
DRAWN, SHOWN = 1000, 200
#: Months with a smaller loss are not shown.
SMALL_LOSS = 0.07
#: A smaller share of wealth counts as 0.
SMALL_SHARE = 0.0005
#: Left edges of the columns of the last picture.
MEANS, WITHOUT, WITH = 180, 372, 520
#: Light by default and dark on a dark screen. The colours of Okabe and Ito suit colour-blind readers.
STYLE = """
.ground { fill: #fff }
text { font: 15px system-ui, sans-serif; fill: #1c2430 }
.soft { fill: #566171 }
.end { text-anchor: end }
.middle { text-anchor: middle }
.rule { stroke: #c9d0d8 }
.ink { stroke: #1c2430; stroke-width: 2; fill: none }
.dashed { stroke-dasharray: 5 4 }
.blue { fill: #0072b2 }
.faint { fill: #0072b2; fill-opacity: .5 }
.area { fill: #0072b2; fill-opacity: .16 }
.edge { stroke: #0072b2; stroke-width: 2; fill: none }
.orange { fill: #d55e00 }
.ring { stroke: #d55e00; stroke-width: 1.5; fill: none }
.arrow { stroke: #d55e00; stroke-width: 2 }
@media (prefers-color-scheme: dark) {
  .ground { fill: #12161c }
  text { fill: #e7ebf0 }
  .soft { fill: #a3aebb }
  .rule { stroke: #3a4450 }
  .ink { stroke: #e7ebf0 }
  .blue, .faint, .area { fill: #4aa8e8 }
  .edge { stroke: #4aa8e8 }
  .orange { fill: #ff8f3f }
  .ring, .arrow { stroke: #ff8f3f }
}
"""


class Picture:
    """An SVG with marks and texts. The picture is 640 units wide, and y points downwards."""

    def __init__(self, title: str, height: float) -> None:
        size = f'viewBox="0 0 {WIDTH} {height:g}" width="{WIDTH}" height="{height:g}"'
        self._parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
            f"<title>{escape(title)}</title><style>{STYLE}</style>",
        ]
        self.mark("rect", "ground", width=WIDTH, height=height)

    def mark(self, element: str, names: str, **attributes: float | str) -> None:
        def shown(value: float | str) -> str:
            return value if isinstance(value, str) else f"{value:.1f}".removesuffix(".0")

        written = "".join(f' {name}="{shown(value)}"' for name, value in attributes.items())
        self._parts.append(f'<{element} class="{names}"{written}/>')

    def text(self, x: float, y: float, words: str, names: str = "") -> None:
        self._parts.append(f'<text class="{names}" x="{x:.1f}" y="{y:.1f}">{escape(words)}</text>')

    def line(self, names: str, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.mark("line", names, x1=start[0], y1=start[1], x2=end[0], y2=end[1])

    def write(self, path: Path) -> None:
        path.write_text("\n".join([*self._parts, "</svg>"]) + "\n")


def percent(share: float, decimals: int) -> str:
    return f"{100 * share:.{decimals}f} %"


def span(shares: list[float]) -> str:
    return f"{percent(min(shares), 2)} to {percent(max(shares), 2)}"


def read(ballast: Ballast, file: str, **choices: Any) -> tuple[dict[str, list[float]], float]:
    """Returns the log-returns of a bundled file by the name of their column, and the last rate of the bank."""
    record = ballast.read_returns(DATA / file, **choices)
    assert record["outcome"] == "read"
    bank = record.get("rate")
    assert bank is not None
    return {series["column"]: series["log_returns"] for series in record["series"]}, bank["rates"][-1]


def advised(ballast: Ballast, record: list[float], rate: float, trading_cost: float = 0.0) -> wire.Advised:
    """Returns the advice of `ballast advise --caution paper --support none`."""
    utility: wire.UtilitySpecification = {"kind": "power", "risk_aversion": 3.0}
    return ballast.advise(
        record,
        kind="log",
        rate_per_step=rate,
        utility=utility,
        trading_cost=trading_cost,
        caution="paper",
        support={"rule": "none"},
    )


def ball(ballast: Ballast, market: list[float], rate: float) -> Picture:
    """Draws the balls of the whole record and of its last 20 years, with random records from each.

    The distance of a record from the centre is the distance of the two laws. Its horizontal position is the difference
    of the means. Records with a larger deviation are above the centre.
    """
    picture = Picture("The ball around a long record and around a short one", 400)
    unit, middle = 19500.0, 180.0
    for centre, record in ((205.0, market), (490.0, market[-240:])):
        advice = advised(ballast, record, rate)
        radius, allocation = advice["radius"], advice["allocation"]
        picture.mark("circle", "area", cx=centre, cy=middle, r=unit * radius)
        generator = random.Random(1)
        inside = 0
        for index in range(DRAWN):
            drawn = generator.choices(record, k=len(record))
            # For samples of one size the distance is the mean absolute difference of values of the same rank.
            distance = fmean(abs(one - other) for one, other in zip(sorted(drawn), sorted(record), strict=True))
            inside += distance <= radius
            if index >= SHOWN:
                continue
            along = fmean(drawn) - fmean(record)
            above = math.copysign(math.sqrt(max(distance**2 - along**2, 0.0)), pstdev(drawn) - pstdev(record))
            picture.mark("circle", "faint", cx=centre + unit * along, cy=middle - unit * above, r=2.5)
        picture.mark("circle", "edge", cx=centre, cy=middle, r=unit * radius)
        picture.mark("circle", "ink", cx=centre, cy=middle, r=5)
        if allocation > 0:
            moved = sum(move["mass"] * (move["atom"] - move["moved_to"]) for move in advice["worst_case"]["transport"])
            picture.mark("circle", "orange", cx=centre - unit * moved, cy=middle, r=6)
        premium = math.log(fmean(map(math.exp, record)) / (1 + rate))
        at = centre - unit * premium
        picture.line("ink dashed", (at, 56), (at, 304))
        picture.text(at, 322, "as good as", "middle soft")
        picture.text(at, 340, "the bank", "middle soft")
        picture.text(centre, 20, f"{len(record)} months, radius {percent(radius, 3)}", "middle")
        hold = f"hold {percent(allocation, 1)}" if allocation > 0 else "hold nothing"
        picture.text(centre, 40, hold, "middle soft")
        print(
            f"{len(record)} months: the radius is {percent(radius, 3)}. Of {DRAWN} records drawn from them "
            f"{inside} lie in the ball. They paid {percent(premium, 2)} a month beyond the bank: {hold}."
        )
    for x, names, radius, words in (
        (40, "ink", 5, "the record"),
        (170, "faint", 4, "records that chance draws from it"),
        (480, "orange", 6, "the worst law"),
    ):
        picture.mark("circle", names, cx=x, cy=378, r=radius)
        picture.text(x + 14, 383, words)
    return picture


def worst_law(ballast: Ballast, market: list[float], rate: float) -> Picture:
    """Draws the months with the largest losses, as observed and under the worst law, a dot for each."""
    picture = Picture("The worst months of the record, as seen and under the worst law", 420)
    moves = advised(ballast, market, rate)["worst_case"]["transport"]
    left, unit = 30.0, 2280.0

    def stacked(below: float, dots: list[tuple[float, str]]) -> None:
        """Draws dots above a line, and stacks those within one per cent."""
        heights: dict[int, int] = {}
        for log_return, names in sorted(dots):
            column = math.floor(100 * math.expm1(log_return))
            heights[column] = heights.get(column, 0) + 1
            picture.mark(
                "circle", names, cx=left + unit * (column + 32.5) / 100, cy=below - 7.5 * heights[column], r=3.2
            )

    seen: list[tuple[float, str]] = []
    worst: list[tuple[float, str]] = []
    moved = lowest = 0.0
    for move in moves:
        mass, atom, to = move["mass"], move["atom"], move["moved_to"]
        goes = to < atom
        if goes:
            moved, lowest = moved + mass, min(lowest, math.expm1(to))
        # The law may move only a part of the mass of a month.
        if math.expm1(atom) < -SMALL_LOSS and (months := round(mass * len(market))):
            seen += [(atom, "ring" if goes else "blue")] * months
            worst += [(to, "orange" if goes else "blue")] * months
    for below, title, dots in ((135, "as they were", seen), (365, "under the worst law", worst)):
        picture.line("rule", (left, below), (WIDTH - 20, below))
        picture.text(WIDTH / 2, below - 100, title, "middle")
        stacked(below, dots)
    picture.text(
        WIDTH / 2, 160, f"{len(seen)} months of {len(market)} lost more than {percent(SMALL_LOSS, 0)}", "middle soft"
    )
    for loss in range(30, 5, -5):
        x = left + unit * (32 - loss) / 100
        picture.line("rule", (x, 365), (x, 371))
        picture.text(x, 388, f"\u2212{loss} %", "middle soft")
    picture.text(WIDTH / 2, 410, "return of the month", "middle soft")
    print(
        f"The worst law moves {percent(moved, 1)} of the months, {moved * len(market):.1f} of {len(market)}, "
        f"to a loss of {percent(-lowest, 1)}."
    )
    return picture


def band(ballast: Ballast, market: list[float], rate: float) -> Picture:
    """Draws the no-trade range of the coming month over the trading cost."""
    picture = Picture("The band over the cost of trading", 380)
    costs = [step / 4000 for step in range(21)]
    bands = [advised(ballast, market, rate, cost)["band"] for cost in costs]
    left, right, top, bottom = 70.0, WIDTH - 20.0, 40.0, 310.0

    def at(cost: float, share: float) -> tuple[float, float]:
        return left + (right - left) * cost / costs[-1], bottom - (bottom - top) * share / 0.6

    for share in (0.0, 0.2, 0.4, 0.6):
        _, y = at(0, share)
        picture.line("rule", (left, y), (right, y))
        picture.text(left - 8, y + 5, percent(share, 0), "end soft")
    for tenth in range(6):
        x, _ = at(tenth / 1000, 0)
        picture.text(min(x, right - 22), bottom + 22, f"{tenth / 10} %", "middle soft")
    picture.text((left + right) / 2, bottom + 48, "lost of what is bought or sold", "middle soft")
    picture.text(4, 20, "share of wealth that is held", "soft")
    low, high = ([at(cost, ends[end]) for cost, ends in zip(costs, bands, strict=True)] for end in (0, 1))
    outline = " ".join(f"{x:.1f},{y:.1f}" for x, y in [*low, *reversed(high)])
    picture.mark("polygon", "area", points=outline)
    for edge in (low, high):
        picture.mark("polyline", "edge", points=" ".join(f"{x:.1f},{y:.1f}" for x, y in edge))
    picture.text(*at(0.0041, 0.27), "nothing is traded", "middle")
    picture.text(*at(0.0025, 0.54), "more is held: sell down to the edge", "middle")
    picture.text(*at(0.0012, 0.14), "less is held: buy up to the edge", "middle")
    for cost, (lowest, highest) in zip(costs[::4], bands[::4], strict=True):
        ends = f"{percent(lowest, 1)} to {percent(highest, 1)}"
        print(f"If trading costs {percent(cost, 1)}, the no-trade range is {ends}.")
    return picture


def row_of_shares(picture: Picture, y: float, name: str, names: str, without: float, with_ball: float) -> None:
    """Draws a row with the shares of wealth without a ball and with it."""
    picture.text(MEANS - 15, y + 5, name, "end")
    for x, share in ((WITHOUT, without), (WITH, with_ball)):
        if share >= SMALL_SHARE:
            picture.mark("rect", names, x=x, y=y - 8, width=150 * share, height=16)
            picture.text(x + 150 * share + 5, y + 5, percent(share, 0), "soft")


def industries(ballast: Ballast) -> Picture:
    """Draws the mean of each of twelve industries, as seen and under the worst law, and the shares with and without a
    ball."""
    columns, rate = read(ballast, "us_industries_monthly.csv", columns=[str(number) for number in range(2, 14)])
    names = list(columns)
    rows = [list(row) for row in zip(*columns.values(), strict=True)]
    utility: wire.UtilitySpecification = {"kind": "power", "risk_aversion": 3.0}
    alone, robust = (
        ballast.advise_assets(
            rows,
            kind="log",
            rate_per_step=rate,
            assets=names,
            utility=utility,
            radius={"rule": "bridge", "scale": scale},
            support={"rule": "none"},
        )
        for scale in (0.0, 1.0)
    )
    means = robust["worst_means"]
    picture = Picture("Twelve industries: the worst move of each, and the shares held", 470)
    for x, title in ((MEANS, "mean of a month"), (WITHOUT, "held, no ball"), (WITH, "held, with it")):
        picture.text(x, 22, title)
    bottom = 45 + 25 * len(names)

    def place(mean: float) -> float:
        return MEANS + 15000 * mean

    for mean, names_of_mark, words in (
        (rate, "ink dashed", "bank"),
        (0.005, "rule", "0.5 %"),
        (0.01, "rule", "1 %"),
    ):
        picture.line(names_of_mark, (place(mean), 36), (place(mean), bottom))
        picture.text(place(mean), bottom + 18, words, "middle soft")
    ordered = sorted(names, key=lambda name: -means[name]["seen"])
    for row, name in enumerate(ordered):
        y = 56 + 25 * row
        seen, worst = place(means[name]["seen"]), place(means[name]["worst"])
        picture.line("arrow", (seen, y), (worst, y))
        picture.mark("circle", "blue", cx=seen, cy=y, r=5)
        picture.mark("circle", "orange", cx=worst, cy=y, r=5)
        row_of_shares(picture, y, name.replace("_", " "), "blue", alone["allocation"][name], robust["allocation"][name])
    row_of_shares(picture, bottom + 50, "in the bank", "faint", 1 - alone["total"], 1 - robust["total"])
    for x, colour, words in ((MEANS, "blue", "as seen"), (MEANS + 100, "orange", "under the worst law")):
        picture.mark("circle", colour, cx=x, cy=bottom + 88, r=5)
        picture.text(x + 12, bottom + 93, words, "soft")
    seen_means, worst_means = [mean["seen"] for mean in means.values()], [mean["worst"] for mean in means.values()]
    print(
        f"{len(rows)} months of {len(names)} industries: means of {span(seen_means)} a month as seen, "
        f"of {span(worst_means)} under the worst law; the bank pays {percent(rate, 2)}."
    )
    for title, answer in (("without a ball", alone), ("with the ball", robust)):
        held = sorted((share for share in answer["allocation"].values() if share >= SMALL_SHARE), reverse=True)
        print(
            f"Best {title}: {percent(answer['total'], 1)} of wealth in {len(held)} industries, "
            f"{percent(held[0], 1)} in the largest and {percent(held[-1], 1)} in the smallest."
        )
    return picture


def main() -> None:
    parser = argparse.ArgumentParser(description="Draws the pictures of docs/concepts.md.")
    parser.add_argument("--url", default="http://127.0.0.1:8080", help="address of the service")
    parser.add_argument("--out", type=Path, default=Path("pictures"), help="folder to write to")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with Ballast(arguments.url) as ballast:
        columns, rate = read(ballast, "us_market_monthly.csv")
        market = columns["market_return"]
        ball(ballast, market, rate).write(arguments.out / "ball.svg")
        worst_law(ballast, market, rate).write(arguments.out / "worst-law.svg")
        band(ballast, market, rate).write(arguments.out / "band.svg")
        industries(ballast).write(arguments.out / "worst-moves.svg")


if __name__ == "__main__":
    main()
