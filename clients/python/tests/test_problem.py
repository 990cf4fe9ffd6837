"""Formulas that are written with Python's operators: their texts, and what they are worth."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY

import ballast as package
from ballast import Ballast, Problem
from ballast.problem import Expression, exp, ln, maximum, minimum, sqrt, symbols, where

STOCK, ORDER, DEMAND = symbols("stock order demand")


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (STOCK + ORDER - DEMAND, "stock + order - demand"),
        (STOCK - (ORDER - DEMAND), "stock - (order - demand)"),
        (9 * minimum(STOCK + ORDER, DEMAND) - 0.5 * STOCK, "9*min(stock + order, demand) - 0.5*stock"),
        ((STOCK + 1) / (ORDER * 2), "(stock + 1)/(order*2)"),
        (-STOCK * 2, "-stock*2"),
        (-(STOCK + 1), "-(stock + 1)"),
        (-(STOCK**2), "-stock^2"),
        ((-STOCK) ** 2, "(-stock)^2"),
        (STOCK ** (-0.5), "stock^-0.5"),
        (STOCK**ORDER**2, "stock^order^2"),
        ((STOCK**ORDER) ** 2, "(stock^order)^2"),
        (2**STOCK, "2^stock"),
        (STOCK - -3, "stock - -3"),
        (where(STOCK > 10, 5, STOCK), "if(stock > 10, 5, stock)"),
        ((STOCK > 10) * 5, "(stock > 10)*5"),
        (abs(STOCK) + exp(ln(sqrt(DEMAND))), "abs(stock) + exp(ln(sqrt(demand)))"),
        (maximum(STOCK, "order + 1") * "t + 1", "max(stock, order + 1)*(t + 1)"),
        (np.float64(3) * STOCK + np.int64(2), "3*stock + 2"),
        (1e-7 * STOCK, "1e-07*stock"),
    ],
)
def test_an_expression_is_a_text(expression: Expression, text: str) -> None:
    assert str(expression) == text


def _random(source: random.Random, depth: int) -> tuple[Expression, Callable[[dict[str, float]], float]]:
    """Returns a random expression, and how Python computes it."""
    if depth == 0:
        name = source.choice(["stock", "order", "demand"])
        return symbols(name)[0], lambda at: at[name]
    one, of_one = _random(source, depth - 1)
    two, of_two = _random(source, source.randrange(depth))
    number = source.choice([-2.5, 3.0, 0.25])
    choices: list[tuple[Expression, Callable[[dict[str, float]], float]]] = [
        (one + two, lambda at: of_one(at) + of_two(at)),
        (one - two, lambda at: of_one(at) - of_two(at)),
        (one * two, lambda at: of_one(at) * of_two(at)),
        (number - one, lambda at: number - of_one(at)),
        (one / number, lambda at: of_one(at) / number),
        (-one, lambda at: -of_one(at)),
        (one**2, lambda at: of_one(at) ** 2),
        (minimum(one, two), lambda at: min(of_one(at), of_two(at))),
        (where(one <= two, two, one), lambda at: of_two(at) if of_one(at) <= of_two(at) else of_one(at)),
        (abs(one), lambda at: abs(of_one(at))),
    ]
    return source.choice(choices)


def test_texts_are_worth_what_python_computes() -> None:
    """The grammar of formulas has the precedences of Python, so Python reads the texts too."""
    source = random.Random(5)
    known: dict[str, Any] = {"min": min, "abs": abs, "where": lambda condition, yes, no: yes if condition else no}
    for _ in range(500):
        expression, compute = _random(source, 4)
        at = {name: source.uniform(-2, 2) for name in ("stock", "order", "demand")}
        read = eval(str(expression).replace("^", "**").replace("if(", "where("), {"__builtins__": {}}, {**known, **at})
        assert read == compute(at) or math.isclose(read, compute(at), rel_tol=1e-12), expression


def test_a_formula_has_no_truth() -> None:
    for wrong in (lambda: max(STOCK, ORDER), lambda: bool(STOCK), lambda: 1 if STOCK > 2 else 0):
        with pytest.raises(TypeError, match="where, minimum or maximum"):
            wrong()
    with pytest.raises(ValueError, match="must be finite"):
        STOCK + math.inf


def _stock() -> Problem:
    price, cost, holding, salvage, capacity = symbols("price cost holding salvage capacity")
    left = maximum(STOCK + ORDER - DEMAND, 0)
    return Problem(
        states={"stock": {"start": 4, "low": 0, "high": 60}},
        actions={"order": {"low": 0, "high": capacity - STOCK}},
        noise={"name": "demand", "low": 0, "high": 40},
        parameters={"price": 9, "cost": 5, "holding": 0.5, "salvage": 3, "capacity": 60},
        next={"stock": left},
        reward=price * minimum(STOCK + ORDER, DEMAND) - cost * ORDER - holding * left,
        end=salvage * STOCK,
        horizon=12,
        history=[9.1, 27.3, 11.6, 19.0, 22.3, 21.1, 18.7],
        radius={"rule": "bridge", "alpha": 0.1, "scale": 0.3},
    )


def test_a_problem_is_the_example_that_is_a_file() -> None:
    example = json.loads((REPOSITORY / "examples/problems/stock.json").read_text())
    assert _stock().specification(design={"count": 100}) == example


def test_a_problem_is_trained_and_a_wrong_one_named_by_its_column(ballast: Ballast) -> None:
    problem = _stock()
    problem.horizon = 2
    specification = problem.specification(design={"count": 10}, seed=3)
    policy = ballast.submit(specification).policy()
    assert 0.0 <= policy.decide()["actions"]["order"] <= 56.0
    assert policy.detail()["specification"]["seed"] == 3
    problem.reward = STOCK + symbols("ordr")[0]
    with pytest.raises(package.InvalidField, match="column 9") as refusal:
        ballast.submit(problem.specification())
    assert refusal.value.field == "problem.reward"
    problem.reward, problem.end, problem.utility = None, None, {"kind": "power", "risk_aversion": 3, "of": STOCK + 1}
    problem.actions = {"order": {"values": [0, 5, 10]}}
    problem.states = {"stock": {"start": 4, "low": 0, "high": 70}}
    declared = problem.specification()["problem"]
    assert declared.get("utility") == {"kind": "power", "risk_aversion": 3, "of": "stock + 1"}
    assert declared["actions"] == {"order": {"values": [0, 5, 10]}} and "reward" not in declared
    found = ballast.submit(problem.specification(design={"count": 10})).policy().decide()
    assert found["actions"]["order"] in (0.0, 5.0, 10.0)
