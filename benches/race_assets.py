#!/usr/bin/env python3
"""Races the robust step of several assets against cvxpy with Clarabel, in one run, and compares the values.

    cargo build --release -p ballast-lab
    benches/race_assets.py [--costs 60] [--assets 2,5,12] [--months 60,240]

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
import warnings

import cvxpy as cp
import numpy as np

# Largest cost of moving an atom, far above every move in the answers.
LARGEST_COST = 1.5


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


def main():
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=os.path.join(root, "target", "release", "ballast-lab"))
    parser.add_argument("--file", default=os.path.join(root, "data", "us_industries_monthly.csv"))
    parser.add_argument("--costs", type=int, default=60)
    parser.add_argument("--assets", default="2,5,12")
    parser.add_argument("--months", default="60,240")
    options = parser.parse_args()
    command = [options.binary, "bench", "assets", "--json", "--file", options.file]
    command += ["--assets", options.assets, "--months", options.months]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    returns = log_returns(options.file)
    title = f"{'assets':>6} {'months':>6} {'Ballast, ms':>12} {'Clarabel, ms':>13} {'ratio':>7} {'value, bp':>10} {'above it, bp':>13}"
    print(title)
    for line in output.splitlines():
        found = json.loads(line)
        if found["ground_norm"] != "sup":
            continue
        window = returns[-found["months"] :, : found["assets"]]
        growths = np.exp(window) / (1.0 + found["rate"])
        seconds, value = by_clarabel(growths, found["radius"], found["risk_aversion"], options.costs)
        above = 1e4 * (value - found["value"])
        # Allows for the rounding of Clarabel.
        assert above > -1e-2, f"{above} below the exact value"
        ratio = seconds / found["cold"]
        print(
            f"{found['assets']:>6} {found['months']:>6} {1e3 * found['cold']:>12.2f} {1e3 * seconds:>13.0f}"
            f" {ratio:>7.0f} {1e4 * found['value']:>10.4f} {above:>13.4f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
