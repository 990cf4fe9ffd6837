#!/usr/bin/env python3
"""Races Ballast against Python programs that do the same work, in one run, and prints medians and ratios.

    cargo build --release -p ballast-lab
    benches/race.py --opponents FOLDER [--runs 3] [--horizon 3]

FOLDER holds `python_reference.py` (a training: numba for the robust step, scikit-learn for the surrogates) and
`gp_fit.py` (scikit-learn's fit and prediction on a CSV). The inner solve races HiGHS, whose value it must match. This
Python needs numpy, scipy, scikit-learn and numba. Both sides train 1000 design points, each with a history of 20 draws of the
paper's mixture, over the same number of steps.
"""
import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time


def output(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def last_json(text):
    return json.loads(text.strip().splitlines()[-1])


def inner_by_highs():
    """Seconds and values, by radius, of the inner problem of `ballast-lab bench kernels` as a linear program in HiGHS:
    max over gamma >= 0 and phi of mean(phi) - gamma radius, phi_j <= payoff_k + gamma |z_k - z_j| for every k."""
    import numpy as np
    from scipy.optimize import linprog
    from scipy.sparse import csr_matrix

    support, atoms = np.linspace(-1.0, 0.6, 120), 30
    centre = support[45:45 + atoms]
    payoff = -np.exp(-2.0 * support)
    atom, place = (index.ravel() for index in np.meshgrid(range(atoms), range(support.size), indexing="ij"))
    rows = np.arange(atom.size)
    distance = np.abs(support[place] - centre[atom])
    matrix = csr_matrix((np.r_[np.ones(atom.size), -distance], (np.r_[rows, rows], np.r_[atom, np.full(atom.size, atoms)])))
    seconds, values = [], {}
    for radius in (0.01, 0.05, 0.1):
        cost = np.r_[np.full(atoms, -1.0 / atoms), radius]
        bounds = [(None, None)] * atoms + [(0.0, None)]
        started = time.perf_counter()
        solved = linprog(cost, A_ub=matrix, b_ub=payoff[place], bounds=bounds, method="highs")
        seconds.append(time.perf_counter() - started)
        values[radius] = -solved.fun
    return statistics.median(seconds), values


def main():
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--opponents", required=True)
    parser.add_argument("--binary", default=os.path.join(root, "target", "release", "ballast-lab"))
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--horizon", type=int, default=3)
    options = parser.parse_args()
    opponent = lambda name: os.path.join(options.opponents, name)
    rows = {}

    def note(name, ours, theirs, unit="s"):
        rows.setdefault(name, (unit, [], []))
        rows[name][1].append(ours)
        rows[name][2].append(theirs)

    with tempfile.TemporaryDirectory() as folder:
        csv = os.path.join(folder, "rows.csv")
        for run in range(options.runs):
            print(f"run {run + 1} of {options.runs}", file=sys.stderr)
            ours = output(options.binary, "bench", "training", "--resampled", "--horizon", str(options.horizon))
            theirs = last_json(output(sys.executable, opponent("python_reference.py"), "--horizon", str(options.horizon), "--json"))
            note("training", float(re.search(r"median ([\d.]+) s", ours)[1]), theirs["total"])
            ours = output(options.binary, "bench", "kernels", "--csv", csv)
            theirs = last_json(output(sys.executable, opponent("gp_fit.py"), csv))
            fit = re.search(r"fit: ([\d.]+) s, log-likelihood per point ([-\d.]+)", ours)
            note("fit, 1000 rows, 6 inputs", float(fit[1]), theirs["fit_seconds"])
            note("mean, 1000 queries", float(re.search(r"queries: ([\d.]+) s", ours)[1]), theirs["predict_seconds"])
            seconds, values = inner_by_highs()
            note("inner solve", 1e-6 * float(re.search(r"support points: ([\d.]+) us", ours)[1]), seconds)
            for radius, value in values.items():
                found = float(re.search(rf"at radius {radius}: ([-\d.]+)", ours)[1])
                assert abs(found - value) < 1e-7, f"HiGHS finds {value} at radius {radius}, Ballast {found}"
            note("log-likelihood per point", float(fit[2]), theirs["log_likelihood_per_point"], unit="")
    print(f"{'':<28} {'Ballast':>10} {'Python':>10} {'ratio':>8}   medians of {options.runs}")
    for name, (unit, ours, theirs) in rows.items():
        ours, theirs = statistics.median(ours), statistics.median(theirs)
        ratio, digits = (f"{theirs / ours:.1f}", 4) if unit else ("", 7)
        print(f"{name:<28} {ours:>10.{digits}g} {theirs:>10.{digits}g} {ratio:>8}")


if __name__ == "__main__":
    main()
