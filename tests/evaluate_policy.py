"""Evaluates an exported policy by docs/policy-format.md alone: the standard library and nothing of Ballast.

Reads {"policy": .., "questions": [{"step", "wealth", "holding", "returns"}, ..]} from standard input, where a question may give the
"radius" and the "radius_ahead" of a bridge rule, whose random numbers nobody else has. Answers one object a question.
Returns are in the order in which they came. With the argument "bridge" it reads {"learning", "returns", "alpha", "paths"} and answers
the quantiles Q and Q' of its own bridges. With "declared" the policy is of a declared problem, a question has "step", "state" and
"noises", and an answer is a number.
"""

import json
import math
import random
import sys


def retention(learning):
    """d, what of a return's weight is left one return later."""
    return 1.0 if learning["kind"] == "equal" else 0.5 ** (1 / learning["half_life"])


def masses(learning, count):
    """Of so many returns, the oldest first."""
    weights = [retention(learning) ** age for age in reversed(range(count))]
    return [weight / sum(weights) for weight in weights]


def mean(values, w):
    return sum(value * mass for value, mass in zip(values, w))


def cap(returns, w, radius, lowest):
    """c from sum w_j max(z_j - c, 0) = radius, by bisection, and at least the lowest return of the support."""
    low, high = min(returns) - radius - 1.0, max(returns)
    for _ in range(200):
        middle = (low + high) / 2
        if mean([max(z - middle, 0.0) for z in returns], w) > radius:
            low = middle
        else:
            high = middle
    return max(high, lowest)


def share_seen(problem, size):
    """Of the centre of the ball, where it is not made of the returns seen alone."""
    centre = problem.get("centre", {"kind": "empirical"})
    return size / (size + centre["weight"]) if centre["kind"] == "mixed" else 1.0


def radius_of(problem, size):
    """The rules of docs/problem.md that look at the effective number of returns alone."""
    rule, share = problem["radius"], share_seen(problem, size)
    if problem["framework"] == "plug_in":
        return 0.0
    if rule["rule"] == "fixed":
        return rule["radius"]
    if rule["rule"] == "root_n":
        return share * rule["kappa"] / math.sqrt(size)
    if rule["rule"] == "concentration":
        length, alpha = problem["support"]["max"] - problem["support"]["min"], rule["alpha"]
        bounds = [0.5 + math.sqrt(math.log(1 / alpha) / 2)]
        if problem["learning"]["kind"] == "equal":
            bounds.append(math.sqrt(math.log(2 / alpha) / 2))
        return share * length * min(bounds) / math.sqrt(size)
    raise ValueError(f"{rule['rule']} must be asked for with its radius")


def moment_features(returns, w, count):
    m = mean(returns, w)
    s = math.sqrt(mean([(z - m) ** 2 for z in returns], w))
    shape = lambda order: mean([(z - m) ** order for z in returns], w) / s**order
    features = {
        "mean": m,
        "log_standard_deviation": math.log(s),
        "skewness": shape(3),
        "log_kurtosis": math.log(shape(4)),
        "shape_5": shape(5),
        "shape_6": math.log(shape(6)),
    }
    return list(features.values())[:count]


def least_return(problem, returns, w):
    """The lowest log-return that the adversary may use: given, or the lower of so many times the worst and five deviations."""
    support = problem.get("support") or {"rule": "none"}
    if support["rule"] == "worst_seen":
        m = mean(returns, w)
        s = math.sqrt(mean([(z - m) ** 2 for z in returns], w))
        return max(min(support["factor"] * min(returns), m - 5 * s, min(returns)), -20.0)
    return support.get("min", -math.inf)


def merton_features(problem, returns, w, radius):
    utility, bank = problem["utility"], 1 + problem["rate_per_step"]
    rho = {
        "exponential": lambda: utility["risk_aversion"] * (problem["initial_wealth"] + to_come(problem, 0)[0]),
        "power": lambda: utility["risk_aversion"],
        "log": lambda: 1.0,
    }[utility["kind"]]()
    lowest = least_return(problem, returns, w)
    c = cap(returns, w, radius, lowest)
    capped = [math.exp(min(z, c)) / bank for z in returns]
    e = mean(capped, w) - 1
    v = mean([(x - mean(capped, w)) ** 2 for x in capped], w)
    s2 = mean([(z - mean(returns, w)) ** 2 for z in returns], w)
    return [math.asinh(e / (rho * s2)), math.asinh(e / (rho * max(v, s2 / 100)))]


def contributions(problem):
    """One amount for each period."""
    given = problem["contributions"]
    return given if isinstance(given, list) else [given] * problem["horizon"]


def to_come(problem, step):
    """P and D: what the contributions from a step on are worth, and what must stay in the bank for them."""
    worth, reserve, bank = 0.0, 0.0, 1 + problem["rate_per_step"]
    for amount in reversed(contributions(problem)[step:]):
        worth, reserve = (worth + amount) / bank, max(0.0, (reserve - amount) / bank)
    return worth, reserve


def sees_wealth(problem):
    return problem["utility"]["kind"] == "exponential" or any(contributions(problem))


def features(specification, question):
    problem, surrogate = specification["problem"], specification["surrogate"]
    framework, returns = problem["framework"], question["returns"]
    w = masses(problem["learning"], len(returns))
    wealth = question["wealth"] + to_come(problem, question["step"])[0]
    learns = framework in ("adaptive", "plug_in", "parametric_adaptive")
    count = surrogate["moment_count"] if learns else 0
    if framework == "parametric_adaptive":
        count = min(count, 2)
    if surrogate["features"] == "raw_moments":
        raw = [mean([z**order for z in returns], w) for order in range(1, count + 1)]
        return ([wealth] if sees_wealth(problem) else []) + raw
    found = [math.log(wealth)] if sees_wealth(problem) else []
    if not learns:
        return found
    found += moment_features(returns, w, count)
    if framework == "parametric_adaptive":
        return found
    size = 1 / sum(mass * mass for mass in w)
    radius = question["radius"] if "radius" in question else radius_of(problem, size)
    if problem["radius"]["rule"] == "bridge" and framework == "adaptive":
        found += [math.log(radius), math.log(question["radius_ahead"] / radius)]
    return found + merton_features(problem, returns, w, radius / share_seen(problem, size))


def kernel(hyper, left, right):
    r = math.sqrt(5 * sum(((a - b) / l) ** 2 for a, b, l in zip(left, right, hyper["lengthscales"])))
    return hyper["signal_variance"] * (1 + r + r * r / 3) * math.exp(-r)


def nearest(coordinate, column):
    """Half of the range of the design beyond its ends, a value is as at these ends."""
    beyond = 0.5 * (max(column) - min(column))
    return min(max(coordinate, min(column) - beyond), max(column) + beyond)


def predictions(process, points, x):
    covariances = [kernel(process["hyperparameters"], point, x) for point in points]
    totals = [sum(w * k for w, k in zip(weights, covariances)) for weights in process["weights"]]
    return [process["offset"] + process["scale"] * total for total in totals]


def at_holding(values, holding):
    """The cubic through the four of the even holdings around this one, in Lagrange's form."""
    if len(values) == 1:
        return values[0]
    position = holding * (len(values) - 1)
    first = min(max(math.floor(position) - 1, 0), len(values) - 4)
    nodes = range(first, first + 4)
    basis = lambda i: math.prod((position - j) / (i - j) for j in nodes if j != i)
    return sum(basis(i) * values[i] for i in nodes)


def into(band, holding):
    return min(max(holding, band[0]), band[-1])


def predicted_variance(hyper, points, x):
    """s2 - k^T (K + noise_variance I)^-1 k, by a Cholesky factor L of the matrix: the square of L^-1 k is taken off."""
    factor, solved = [], []
    for i, point in enumerate(points):
        row = []
        for j in range(i + 1):
            entry = kernel(hyper, point, points[j]) + (hyper["noise_variance"] if i == j else 0.0)
            entry -= sum(a * b for a, b in zip(row, factor[j] if j < i else row))
            row.append(math.sqrt(entry) if i == j else entry / factor[j][j])
        factor.append(row)
        known = sum(a * b for a, b in zip(row, solved))
        solved.append((kernel(hyper, point, x) - known) / row[i])
    return hyper["signal_variance"] - sum(a * a for a in solved)


def certainty_equivalent(utility, value):
    if utility["kind"] == "log":
        return math.exp(value)
    a = utility["risk_aversion"]
    if utility["kind"] == "exponential":
        return -math.log(1 - a * value) / a
    return (1 + (1 - a) * value) ** (1 / (1 - a))


def largest_gain(problem, question):
    """G, of frameworks that learn the law of the returns seen; the others are far from theirs."""
    if problem["framework"] not in ("adaptive", "plug_in"):
        return math.inf
    periods, centre = problem["horizon"] - question["step"], problem.get("centre", {"kind": "empirical"})
    best = max(question["returns"])
    if centre["kind"] == "smoothed":
        step = centre["bandwidth"] * math.sqrt(5 + math.sqrt(10))
        best = min(best + periods * step, (problem.get("support") or {}).get("max", 5.0))
    if centre["kind"] == "mixed":
        best = max(best, *centre["history"])
    highest = 1.0 if any(contributions(problem)) else problem["action_interval"][1]
    growth = periods * math.log1p(highest * max(math.exp(best) / (1 + problem["rate_per_step"]) - 1, 0.0))
    later = to_come(problem, question["step"])[0]
    sold = question["wealth"] * (1 - problem["trading_cost"] * question["holding"])
    return growth + math.log((question["wealth"] + later) / (sold + later))


def evaluate(policy, question):
    specification, step = policy["specification"], question["step"]
    problem, holding = specification["problem"], question["holding"]
    cost, highest = problem["trading_cost"], problem["action_interval"][1]
    known = min(holding, highest)
    # Total wealth once everything is sold, and of the highest share at which the value is known.
    later, reserve = to_come(problem, step)
    liquidated = question["wealth"] * (1 - cost * holding) + later
    wealth = question["wealth"] * (1 - cost * known) + later
    in_hand = (liquidated - later) / liquidated
    kept = (1 - cost * (holding - known)) * (1 - cost * known) / (1 - cost * holding)
    beyond = math.log(in_hand * kept + 1 - in_hand)
    solution, most = policy["steps"][step]["solution"], largest_gain(problem, question)
    bank = (1 + problem["rate_per_step"]) ** (problem["horizon"] - step)
    if solution["kind"] == "single":
        gain = min(max(at_holding(solution["floor_gains"], known / highest), 0.0) + beyond, most)
        allocation = into(solution["band"], holding)
        return {"allocation": allocation, "floor_gain": gain, "certainty_equivalent": liquidated * bank * math.exp(gain)}
    found, scaling = features(specification, question), solution["scaling"]
    scales = zip(scaling["active"], scaling["centre"], scaling["spread"])
    x = [(found[feature] - centre) / spread for feature, centre, spread in scales]
    points = list(zip(*solution["inputs"]))
    near = [nearest(coordinate, column) for coordinate, column in zip(x, solution["inputs"])]
    value = at_holding(predictions(solution["value"], points, near), known / highest)
    if specification["surrogate"]["target"] == "value":
        # Under power and log utility of a wealth of 1, for whose multiples the policy is the same.
        unit = 1.0 if sees_wealth(problem) else wealth
        value = math.log(certainty_equivalent(problem["utility"], value) * unit / (wealth * bank))
    gain = min(min(max(value, 0.0), most) + beyond, most)
    free = 1 - reserve / (question["wealth"] * (1 - cost))
    low, high = 0.0, max(0.0, min(problem["action_interval"][1], free))
    share = question["wealth"] / (question["wealth"] + later)
    deviation = math.sqrt(predicted_variance(solution["value"]["hyperparameters"], points, x))
    band = [min(max(end / share, low), high) for end in predictions(solution["policy"], points, x)]
    # A radius of 0, which a fixed rule may have, ruins nobody.
    unbounded = (problem.get("support") or {"rule": "none"})["rule"] == "none"
    has_ball = problem["framework"] in ("adaptive", "static") and problem["radius"].get("radius") != 0
    ruined = has_ball and unbounded and problem["utility"]["kind"] == "power" and max(band) >= 1.0
    return {
        "allocation": into([band[0], max(band[-1], band[0])], holding),
        "floor_gain": gain,
        "certainty_equivalent": liquidated * bank * math.exp(gain),
        "deviation": deviation,
        "in_design": deviation <= solution["deviation_limit"] and not ruined,
    }


def worth_of(formula, specification, state):
    """A formula of the states, whose operators and functions are those of Python but for three."""
    text = formula.replace("^", "**").replace("if(", "choose(").replace("ln(", "log(")
    choose = lambda condition, yes, no: yes if condition else no
    known = {"choose": choose, "log": math.log, "exp": math.exp, "sqrt": math.sqrt, "min": min, "max": max, "abs": abs}
    known |= specification["problem"]["parameters"] | state | {"T": specification["problem"]["horizon"]}
    return eval(text, {"__builtins__": {}}, known)


def declared_value(policy, question):
    """What the periods from a step on, 1 at least, are worth at a state."""
    specification, step, solution = policy["specification"], question["step"], policy["steps"][question["step"] - 1]["solution"]
    problem, state = specification["problem"], question["state"]
    low, high = problem["noise"]["low"], problem["noise"]["high"]
    radius = dict(problem["radius"])
    for name in ("radius", "kappa"):
        if name in radius:
            radius[name] /= high - low
    seen = problem["history"] + (question["noises"] if problem["framework"] != "static" else [])
    law = {
        "framework": problem["framework"], "learning": problem["learning"], "radius": radius, "horizon": problem["horizon"],
        "utility": {"kind": "log"}, "rate_per_step": 0.0, "contributions": 0.0, "support": {"rule": "between", "min": -0.5, "max": 0.5},
    }
    asked = question | {"returns": [(noise - low) / (high - low) - 0.5 for noise in seen], "wealth": 1.0}
    found = [state[name] for name in sorted(state)] + features({"problem": law, "surrogate": specification["surrogate"]}, asked)
    scaling = solution["scaling"]
    x = [(found[i] - centre) / spread for i, centre, spread in zip(scaling["active"], scaling["centre"], scaling["spread"])]
    near = [nearest(coordinate, column) for coordinate, column in zip(x, solution["inputs"])]
    gain = predictions(solution["value"], list(zip(*solution["inputs"])), near)[0]
    if not policy["baselines"]:
        return worth_of(problem["utility"]["of"], specification, state) * math.exp(gain)
    baseline = policy["baselines"][step - 1]
    level = baseline["constant"] + sum(slope * state[name] for slope, name in zip(baseline["slopes"], sorted(state)))
    return (level + policy["unit"] * gain) / problem["discount"] ** step


def bridge(times):
    """|B| at ascending times: a random walk, tied down at 1."""
    walk, before, path = 0.0, 0.0, []
    for time in [*times, 1.0]:
        walk += random.gauss(0.0, math.sqrt(max(time - before, 0.0)))
        before = time
        path.append(walk)
    return [abs(b - walk * time) for b, time in zip(path, times)]


def gaps(returns, w):
    """The time and the length of each gap: the mass of the returns below it, and its width."""
    ordered, below, found = sorted(zip(returns, w)), 0.0, []
    for (low, mass), (high, _) in zip(ordered, ordered[1:]):
        below += mass
        found.append((below, high - low))
    return found


def quantile(gaps, alpha, paths):
    """The (1 - alpha)-quantile of sum |B(time)| length, and half the width that 1 standard error of its rank has."""
    times, lengths = zip(*sorted(gaps))
    values = sorted(sum(b * length for b, length in zip(bridge(times), lengths)) for _ in range(paths))
    rank, error = (1 - alpha) * paths, math.sqrt(alpha * (1 - alpha) * paths)
    return {"value": values[round(rank)], "standard_error": (values[round(rank + error)] - values[round(rank - error)]) / 2}


def quantiles(learning, returns, alpha, paths):
    random.seed(20260101)
    now, later = (masses(learning, len(returns) + more) for more in (0, 1))
    ahead = [(time, mass * length) for again, mass in zip(returns, now) for time, length in gaps(returns + [again], later)]
    return {"now": quantile(gaps(returns, now), alpha, paths), "ahead": quantile(ahead, alpha, paths)}


if __name__ == "__main__":
    asked = json.load(sys.stdin)
    if sys.argv[1:] == ["bridge"]:
        json.dump(quantiles(**asked), sys.stdout)
    elif sys.argv[1:] == ["declared"]:
        json.dump([declared_value(asked["policy"], question) for question in asked["questions"]], sys.stdout)
    else:
        json.dump([evaluate(asked["policy"], question) for question in asked["questions"]], sys.stdout)
