#!/usr/bin/env python3
"""Races the robust step of several assets against cvxpy with Clarabel, in one run, and compares the values.

    cargo build --release -p ballast-lab
    benches/race_assets.py [--costs 60] [--assets 2,5,12] [--months 60,240]
    benches/race_assets.py --tables 5

With --tables it races on so many tables a row of normal months like those of `ballast-lab bench assets --random`, and prints medians.

Under the norm `sup`, if the adversary moves date j at the cost D, the investor's wealth is (1 - sum a) + sum a_i g_ij e^(-D)
times what the bank makes, which is linear in the shares a. With D from a grid the step is a cone program,

    max over a, gamma >= 0, t of  mean(t) - gamma radius,   t_j <= u(wealth_jk(a)) + gamma D_k  for every date j and cost k,

whose value is above that of the step, because its adversary has fewer moves. Both use the same months of the same file. This
Python needs cvxpy, clarabel and numpy. The time of the opponent is that of Clarabel alone, without the setup by cvxpy.
"""
import argparse
import csv
import json
import math
import os
import subprocess
import tempfile
import warnings

import cvxpy as cp
import numpy as np

# Largest cost of moving an atom, far above every move in the answers.
LARGEST_COST = 1.5
# Random tables: assets and months, mean and deviation of a month's log-return, the bank's return, and the radius in deviations
# over the root of the months.
SIZES = [(5, 240), (20, 120), (10, 500), (12, 1000)]
MEAN, DEVIATION, RATE, SCALE = 0.006, 0.04, 0.003, 0.15


def log_returns(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))[1:]
    return np.log1p(np.array([[float(value) for value in row[1:-1]] for row in rows]))


def by_clarabel(growths, radius, risk_aversion, count):
    """Returns the seconds, and the log certainty equivalent over the bank."""
    dates, assets = growths.shape
    # The grid is finer for small moves.
    costs = LARGEST_COST * np.linspace(0.0, 1.0, count) ** 1.5
    shares, price, tops = cp.Variable(assets, nonneg=True), cp.Variable(nonneg=True), cp.Variable(dates)
    power = 1.0 - risk_aversion
    rules = [cp.sum(shares) <= 1.0]
    for cost in costs:
        wealth = (1.0 - cp.sum(shares)) + math.exp(-cost) * (growths @ shares)
        rules.append(tops <= cp.power(wealth, power) / power + price * cost)
    program = cp.Problem(cp.Maximize(cp.sum(tops) / dates - price * radius), rules)
    with warnings.catch_warnings():
        # Clarabel stops when rounding stalls it, about 1e-3 basis points off. The values are compared below.
        warnings.simplefilter("ignore")
        program.solve(solver=cp.CLARABEL)
    assert program.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE), program.status
    return program.solver_stats.solve_time, math.log(power * program.value) / power


def ballast(options, *more):
    """Returns the findings of `ballast-lab bench assets` under the norm `sup`."""
    command = [options.binary, "bench", "assets", "--json", *more]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return [found for found in map(json.loads, output.splitlines()) if found["ground_norm"] == "sup"]


def race(found, returns, costs):
    """Returns the milliseconds of both, the value in basis points, and how far that of the cone program is above it."""
    window = returns[-found["months"] :, : found["assets"]]
    growths = np.exp(window) / (1.0 + found["rate"])
    seconds, value = by_clarabel(growths, found["radius"], found["risk_aversion"], costs)
    above = 1e4 * (value - found["value"])
    # Allows for the rounding of Clarabel.
    assert above > -1e-2, f"{above} below the exact value"
    return 1e3 * found["cold"], 1e3 * seconds, 1e4 * found["value"], above


def show(assets, months, ours, theirs, ratio, value, above):
    print(f"{assets:>6} {months:>6} {ours:>12.2f} {theirs:>13.0f} {ratio:>7.0f} {value:>10.4f} {above:>13.4f}", flush=True)


def on_windows(options):
    returns = log_returns(options.file)
    for found in ballast(options, "--file", options.file, "--assets", options.assets, "--months", options.months):
        ours, theirs, value, above = race(found, returns, options.costs)
        show(found["assets"], found["months"], ours, theirs, theirs / ours, value, above)


def on_tables(options):
    draw = np.random.default_rng(1)
    for assets, months in SIZES:
        races = []
        for correlation in np.linspace(0.0, 0.9, options.tables):
            common = math.sqrt(correlation) * draw.standard_normal((months, 1))
            own = math.sqrt(1.0 - correlation) * draw.standard_normal((months, assets))
            simple = np.expm1(MEAN + DEVIATION * (common + own))
            with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
                rows = csv.writer(file)
                rows.writerow(["date", *(f"asset_{index}" for index in range(assets)), "bank"])
                rows.writerows([month, *row, RATE] for month, row in enumerate(simple))
                file.flush()
                sizes = ["--assets", str(assets), "--months", str(months), "--windows", "1", "--radius", str(SCALE)]
                (found,) = ballast(options, "--file", file.name, *sizes)
                races.append(race(found, log_returns(file.name), options.costs))
        ours, theirs, value, above = np.median(races, axis=0)
        show(assets, months, ours, theirs, np.median([theirs / ours for ours, theirs, *_ in races]), value, above)


def main():
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=os.path.join(root, "target", "release", "ballast-lab"))
    parser.add_argument("--file", default=os.path.join(root, "data", "us_industries_monthly.csv"))
    parser.add_argument("--costs", type=int, default=60)
    parser.add_argument("--assets", default="2,5,12")
    parser.add_argument("--months", default="60,240")
    parser.add_argument("--tables", type=int)
    options = parser.parse_args()
    print(f"{'assets':>6} {'months':>6} {'Ballast, ms':>12} {'Clarabel, ms':>13} {'ratio':>7} {'value, bp':>10} {'above it, bp':>13}")
    if options.tables:
        on_tables(options)
    else:
        on_windows(options)


if __name__ == "__main__":
    main()
