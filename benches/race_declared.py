#!/usr/bin/env python3
"""Races `ballast solve` on problems declared in formulas against other solvers, in one run, and prints medians and ratios.

    cargo build --release
    benches/race_declared.py [--runs 3] [--threads 1]

Everyone solves `examples/problems/stock.json`, first with a known law of the demand, then with one that is learned over 2 and 3 periods.
The exact value for 2 periods is that of `tests/data/general.json`. The others come from a fine grid, with which a coarser one agrees.

Everyone takes the smallest size in a list whose value is within a tolerance of the exact value, and nobody proves its error. The size is
the `design.count` of Ballast, or the intervals, orders or rounds of an opponent. A row that ends with `missed` has the largest size, and
even that is not close enough. Grids and the enumeration approach the exact value from below, and cutting planes from above. The error of
Ballast does not fall with every larger count, so its count can be right by chance. Over 3 periods the enumeration has only its sizes of 2
periods. If the law is learned, opponents know that the worst law moves demand only to an end of the support, and try no others.

The time of Ballast is that of the whole command with so many threads. Opponents have one thread, and the time to start Python and to
compile is not counted. What takes more than 10 s runs once. This Python needs numpy, numba and highspy.
"""
import argparse
import json
import os
import statistics
import subprocess
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import highspy
import numpy as np
from numba import njit

COUNTS, GRIDS, ROUNDS = (100, 200, 300, 500, 1000), (8, 16, 32, 64, 128, 256, 512, 1024), range(1, 200)
KNOWN, LEARNED = (1e-3, 1e-4), (2e-3, 2e-4)


def read_shop(problem):
    """Reads the numbers of the declaration. The radius is `kappa` over the root of the sample size, and 0 if the law is known."""
    kappa, history, noise = problem["radius"].get("kappa", 0.0), np.array(problem["history"]), problem["noise"]
    support = np.linspace(noise["low"], noise["high"], 17) if kappa else history
    few, many = np.union1d(history, support[[0, -1]]), np.union1d(history, support)
    start, horizon = float(problem["states"]["stock"]["start"]), problem["horizon"]
    return SimpleNamespace(**problem["parameters"], start=start, horizon=horizon, history=history, few=few, many=many, kappa=kappa)


def by_numpy(shop, intervals):
    """Tries even orders at even stocks against each demand, all at once."""
    stocks, shares = np.linspace(0.0, shop.capacity, intervals + 1), np.linspace(0.0, 1.0, intervals + 1)
    worth = shop.salvage * stocks
    for step in reversed(range(shop.horizon)):
        solved = stocks if step else np.array([shop.start])
        orders = (shop.capacity - solved)[:, None] * shares
        filled = (solved[:, None] + orders)[:, :, None]
        left = np.maximum(filled - shop.history, 0.0)
        earned = shop.price * np.minimum(filled, shop.history) - shop.holding * left
        worth = ((earned + np.interp(left, stocks, worth)).mean(axis=2) - shop.cost * orders).max(axis=1)
    return float(worth[0])


class Stage:
    """One step as a linear program that stays in HiGHS, which starts each solve from the last basis. The variables are the stock after the
    order, and for each demand what is sold and what comes after. A cut (a, b) says that a stock s that is left is worth at most a + b s."""

    def __init__(self, shop, cut):
        self.shop, self.count, self.program = shop, shop.history.size, highspy.Highs()
        self.program.silent()
        self.program.changeObjectiveSense(highspy.ObjSense.kMaximize)
        sold = [((shop.price + shop.holding) / self.count, 0.0, demand) for demand in shop.history]
        after = [(1.0 / self.count, -highspy.kHighsInf, highspy.kHighsInf)] * self.count
        for column in [(-shop.cost - shop.holding, 0.0, shop.capacity), *sold, *after]:
            self.program.addCol(*column, 0, [], [])
        for index in range(1, self.count + 1):
            self.program.addRow(-highspy.kHighsInf, 0.0, 2, [0, index], [-1.0, 1.0])
        self.add_cut(*cut)

    def add_cut(self, level, slope):
        for index in range(1, self.count + 1):
            self.program.addRow(-highspy.kHighsInf, level, 3, [0, index, self.count + index], [-slope, slope, 1.0])

    def solve(self, stock):
        """Returns the value of a stock, its slope, and the stock after the order."""
        self.program.changeColBounds(0, stock, self.shop.capacity)
        self.program.run()
        value, solution = self.program.getInfo().objective_function_value, self.program.getSolution()
        return value + self.shop.cost * stock, self.shop.cost + min(solution.col_dual[0], 0.0), solution.col_value[0]


def by_cutting_planes(shop, rounds):
    """Bounds the concave value of each step from above by cuts at the stocks that drawn demands lead to."""
    draw, last = np.random.default_rng(1), shop.horizon - 1
    most = [shop.price * shop.history.max() * (last - step) + shop.salvage * shop.capacity for step in range(last)]
    stages = [Stage(shop, (level, 0.0)) for level in most] + [Stage(shop, (0.0, shop.salvage))]
    for _ in range(rounds):
        path = [shop.start]
        for stage in stages[:-1]:
            path.append(max(stage.solve(path[-1])[2] - draw.choice(shop.history), 0.0))
        for step in range(last, 0, -1):
            value, slope, _ = stages[step].solve(path[step])
            stages[step - 1].add_cut(value - slope * path[step], slope)
    return stages[0].solve(shop.start)[0]


@njit
def worst_mean(worth, apart, atoms, radius):
    """Maximises the dual over the price of moving atoms. It is concave and piecewise linear, so each new price is where tangents meet."""
    high, high_slope, low, low_slope, price = 0.0, -radius, np.inf, 0.0, 0.0
    for atom in atoms:
        high += worth[atom]
    high /= atoms.size
    while True:
        level, slope = 0.0, -radius
        for atom in atoms:
            best, moved = np.inf, 0.0
            for place in range(worth.size):
                if worth[place] + price * apart[atom, place] < best:
                    best, moved = worth[place] + price * apart[atom, place], apart[atom, place]
            level, slope = level + (best - price * moved) / atoms.size, slope + moved / atoms.size
        if (price == 0.0 and slope <= 0.0) or level + slope * price >= low + low_slope * price - 1e-9:
            return level + slope * price
        low, low_slope, high, high_slope = (level, slope, high, high_slope) if slope > 0.0 else (low, low_slope, level, slope)
        price = (high - low) / (low_slope - high_slope)


@njit
def recursion(solved, grid, periods, orders, atoms, law):
    """Returns what the solved stocks are worth. Each demand joins the atoms unless the law is known. Later stocks lie on a grid for each
    history, or if `grid` is empty are solved where they are. Without `orders` it chooses the stock after the order among the solved."""
    price, cost, holding, salvage, capacity, kappa, demands, apart = law
    if periods == 0:
        return salvage * solved
    histories = 0 if grid.size == 0 else demands.size if kappa else 1
    later, worth, best, most = np.empty((histories, grid.size)), np.empty(demands.size), np.empty(solved.size), -np.inf
    for place in range(histories):
        later[place] = recursion(grid, grid, periods - 1, orders, np.append(atoms, place) if kappa else atoms, law)
    for index in range(solved.size - 1, -1, -1):
        most = -np.inf if orders else most
        for choice in range(orders + 1):
            filled, total = solved[index] + (capacity - solved[index]) * choice / max(orders, 1), 0.0
            for place in range(demands.size):
                left = max(filled - demands[place], 0.0)
                worth[place] = price * min(filled, demands[place]) - holding * left
                if grid.size:
                    at, row = left * (grid.size - 1) / capacity, min(place, histories - 1)
                    low = min(int(at), grid.size - 2)
                    worth[place] += later[row, low] + (at - low) * (later[row, low + 1] - later[row, low])
                elif periods == 1:
                    worth[place] += salvage * left
                else:
                    worth[place] += recursion(np.array([left]), grid, periods - 1, orders, np.append(atoms, place), law)[0]
                total += worth[place]
            most = max(most, (worst_mean(worth, apart, atoms, kappa / atoms.size**0.5) if kappa else total / demands.size) - cost * filled)
        best[index] = most + cost * solved[index]
    return best


def by_recursion(shop, orders, intervals=None, demands=None):
    """Tries so many even orders, on a grid as fine unless `intervals` says otherwise. Without intervals it enumerates."""
    intervals, demands = orders if intervals is None else intervals, shop.few if demands is None else demands
    grid = np.linspace(0.0, shop.capacity, intervals + 1) if intervals else np.empty(0)
    solved, apart = np.array([shop.start]) if orders else grid, np.abs(demands[:, None] - demands)
    law = (shop.price, shop.cost, shop.holding, shop.salvage, shop.capacity, shop.kappa, demands, apart)
    return np.interp(shop.start, solved, recursion(solved, grid, shop.horizon, orders, np.searchsorted(demands, shop.history), law))


def by_ballast(options, problem, count):
    declaration = json.dumps({"problem": problem, "design": {"count": count}})
    command, environment = [options.binary, "solve", "/dev/stdin", "--json"], os.environ | {"RAYON_NUM_THREADS": str(options.threads)}
    return json.loads(subprocess.check_output(command, input=declaration, text=True, env=environment))["value"]


def race(contenders, exact, tolerance, runs):
    """Finds the size of each contender, runs all in turns, and returns the sizes by name."""
    sizes, seconds, values = {}, {name: [] for name in contenders}, {}
    for name, (choices, solve) in contenders.items():
        sizes[name] = next((size for size in choices[:-1] if abs(solve(size) / exact - 1.0) <= tolerance), choices[-1])
    for _ in range(runs):
        for name, (_, solve) in contenders.items():
            if not seconds[name] or seconds[name][0] < 10.0:
                started = time.perf_counter()
                values[name] = solve(sizes[name])
                seconds[name].append(time.perf_counter() - started)
    print(f"\n{f'within {tolerance:g}':<26} {'size':>5} {'seconds':>9} {'ratio':>8} {'value':>10} {'error':>9}   medians of {runs}")
    for name, value in values.items():
        median, error = statistics.median(seconds[name]), value / exact - 1.0
        ratio, end = median / statistics.median(seconds["Ballast"]), "   missed" if abs(error) > tolerance else ""
        print(f"{name:<26} {sizes[name]:>5} {median:>9.3g} {ratio:>8.2g} {value:>10.4f} {error:>+9.1e}{end}", flush=True)
    return sizes


def race_problem(options, problem, exact, orders):
    """Races on one problem with some numbers of orders for the enumeration. Without an exact value it takes that of the fine grid."""
    # Steps of a tenth reach every demand, the start and the capacity. The fine grid also tries demands inside the support.
    shop, tenths = read_shop(problem), round(10 * problem["parameters"]["capacity"])
    fine = by_recursion(shop, 0, 2 * tenths, shop.many)
    started = time.perf_counter()
    coarse = by_recursion(shop, 0, tenths)
    elapsed, exact = time.perf_counter() - started, exact or fine
    assert max(abs(fine / exact - 1.0), abs(coarse / exact - 1.0)) < 1e-6, (fine, coarse, exact)
    print(f"\nStock over {shop.horizon} periods with a {'learned' if shop.kappa else 'known'} law: exactly {exact:.6f}")
    print(f"A grid by numba finds it within 1e-6 in {elapsed:.2g} s, if told that only the stock after the order matters.")
    contenders, grid = {"Ballast": (COUNTS, partial(by_ballast, options, problem))}, (GRIDS, partial(by_recursion, shop))
    if shop.kappa:
        contenders |= {"grid for each history": grid, "enumeration": (orders, partial(by_recursion, shop, intervals=0))}
    else:
        contenders |= {"grid by numpy": (GRIDS, partial(by_numpy, shop)), "grid by numba": grid}
        contenders["cutting planes by highspy"] = ROUNDS, partial(by_cutting_planes, shop)
    return [race(contenders, exact, tolerance, options.runs) for tolerance in (LEARNED if shop.kappa else KNOWN)]


def main():
    root = Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=root / "target/release/ballast")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    declared = json.loads((root / "examples/problems/stock.json").read_text())["problem"]
    sought = {"problem": "stock", "horizon": 2, "framework": "adaptive", "history": declared["history"]}
    (case,) = (case for case in json.loads((root / "tests/data/general.json").read_text())["cases"] if sought.items() <= case.items())
    learned = declared | {"framework": "adaptive", "radius": {"rule": "root_n", "kappa": case["radius_times_sqrt_sample_size"]}}
    race_problem(options, declared | {"framework": "static", "radius": {"rule": "fixed", "radius": 0}}, None, [])
    orders = [sizes["enumeration"] for sizes in race_problem(options, learned | {"horizon": 2}, case["value"], GRIDS)]
    race_problem(options, learned | {"horizon": 3}, None, orders)
    demands = len(declared["history"]) + 2
    factors = " or ".join(str(demands * (size + 1)) for size in orders)
    print(f"\nOne more period multiplies the time of the grids by {demands} demands, and of the enumeration also by the orders: {factors}.")


if __name__ == "__main__":
    main()
