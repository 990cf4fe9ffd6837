"""A problem declared in formulas, written with Python's own operators.

    stock, order, demand = symbols("stock order demand")
    problem = Problem(
        states={"stock": {"start": 4, "low": 0, "high": 60}},
        actions={"order": {"low": 0, "high": 60 - stock}},
        noise={"name": "demand", "low": 0, "high": 40},
        next={"stock": maximum(stock + order - demand, 0)},
        reward=9 * minimum(stock + order, demand) - 5 * order,
        end=3 * stock,
        horizon=12,
        history=[9.1, 27.3, 11.6, 19.0, 22.3, 21.1, 18.7],
    )
    policy = ballast.submit(problem.specification(design={"count": 100})).policy()

Every formula may be a text, a number or an :class:`Expression`. The service reads the text, checks it and says at which
column one is wrong (``docs/declared.md``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, SupportsFloat, TypeAlias, cast

from . import wire

#: How tightly the parts of a formula hold together, from the loosest to the tightest.
_COMPARED, _ADDED, _MULTIPLIED, _SIGNED, _RAISED, _WHOLE = range(6)


class Expression:
    """A formula. ``+ - * / **``, unary minus, ``< <= > >=`` and the functions of this module make new ones of it.

    ``==`` compares objects, as everywhere in Python; write a formula that needs it as a text. ``if``, ``and``, ``min``
    and ``max`` need a truth that a formula does not have, and raise ``TypeError``: use :func:`where`, :func:`minimum`
    and :func:`maximum`.
    """

    #: Lets a number of numpy leave an operation with a formula to the formula.
    __array_ufunc__ = None

    def __init__(self, text: str, tightness: int = _WHOLE) -> None:
        self._text = text
        self._tightness = tightness

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"Expression({self._text!r})"

    def __bool__(self) -> bool:
        raise TypeError("a formula is neither true nor false: must use where, minimum or maximum of ballast.problem")

    def __add__(self, other: Formula) -> Expression:
        return _joined(self, "+", other, _ADDED)

    def __radd__(self, other: Formula) -> Expression:
        return _joined(other, "+", self, _ADDED)

    def __sub__(self, other: Formula) -> Expression:
        return _joined(self, "-", other, _ADDED)

    def __rsub__(self, other: Formula) -> Expression:
        return _joined(other, "-", self, _ADDED)

    def __mul__(self, other: Formula) -> Expression:
        return _joined(self, "*", other, _MULTIPLIED)

    def __rmul__(self, other: Formula) -> Expression:
        return _joined(other, "*", self, _MULTIPLIED)

    def __truediv__(self, other: Formula) -> Expression:
        return _joined(self, "/", other, _MULTIPLIED)

    def __rtruediv__(self, other: Formula) -> Expression:
        return _joined(other, "/", self, _MULTIPLIED)

    def __pow__(self, other: Formula) -> Expression:
        return Expression(f"{_within(self, _WHOLE)}^{_within(other, _SIGNED)}", _RAISED)

    def __rpow__(self, other: Formula) -> Expression:
        return _expression(other) ** self

    def __neg__(self) -> Expression:
        return Expression(f"-{_within(self, _SIGNED)}", _SIGNED)

    def __lt__(self, other: Formula) -> Expression:
        return _compared(self, "<", other)

    def __le__(self, other: Formula) -> Expression:
        return _compared(self, "<=", other)

    def __gt__(self, other: Formula) -> Expression:
        return _compared(self, ">", other)

    def __ge__(self, other: Formula) -> Expression:
        return _compared(self, ">=", other)

    def __abs__(self) -> Expression:
        return _called("abs", self)


#: A formula as a text, a number or an expression.
Formula: TypeAlias = "str | SupportsFloat | Expression"


def symbols(names: str) -> tuple[Expression, ...]:
    """Returns an expression for each of the names, which are apart by spaces."""
    return tuple(Expression(name) for name in names.split())


def where(condition: Formula, yes: Formula, no: Formula) -> Expression:
    """Returns ``yes`` where the condition holds, that is, is not 0, and elsewhere ``no``."""
    return _called("if", condition, yes, no)


def minimum(*formulas: Formula) -> Expression:
    """Returns the least of two formulas or more."""
    return _called("min", *formulas)


def maximum(*formulas: Formula) -> Expression:
    """Returns the largest of two formulas or more."""
    return _called("max", *formulas)


def exp(formula: Formula) -> Expression:
    """Returns e raised to the formula."""
    return _called("exp", formula)


def ln(formula: Formula) -> Expression:
    """Returns the natural logarithm."""
    return _called("ln", formula)


def sqrt(formula: Formula) -> Expression:
    """Returns the square root."""
    return _called("sqrt", formula)


@dataclass(kw_only=True)
class Problem:
    """A declared problem; ``docs/declared.md`` explains the fields, of which the formulas may be expressions.

    ``utility`` has its formula in ``of``. A field that is left out has the default of the service.
    """

    states: Mapping[str, wire.DeclaredState]
    actions: Mapping[str, Mapping[str, Formula | Sequence[float]]]
    noise: wire.Noise
    next: Mapping[str, Formula]
    horizon: int
    history: Sequence[float]
    parameters: Mapping[str, float] | None = None
    reward: Formula | None = None
    end: Formula | None = None
    discount: float | None = None
    utility: Mapping[str, Any] | None = None
    framework: wire.Framework | None = None
    learning: wire.Learning | None = None
    radius: wire.RadiusRule | None = None

    def specification(
        self,
        *,
        design: wire.DeclaredDesign | None = None,
        surrogate: wire.SurrogateSpecification | None = None,
        seed: int | None = None,
    ) -> wire.DeclaredSpecification:
        """Returns the request of a training, which ``Ballast.submit`` sends."""
        declared: dict[str, Any] = {
            "states": {name: dict(state) for name, state in self.states.items()},
            "actions": {name: _action(action) for name, action in self.actions.items()},
            "noise": dict(self.noise),
            "parameters": None if self.parameters is None else dict(self.parameters),
            "next": {name: _text(formula) for name, formula in self.next.items()},
            "reward": _text_or_none(self.reward),
            "end": _text_or_none(self.end),
            "discount": self.discount,
            "utility": None if self.utility is None else {**self.utility, "of": _text(self.utility["of"])},
            "horizon": self.horizon,
            "history": [float(noise) for noise in self.history],
            "framework": self.framework,
            "learning": self.learning,
            "radius": self.radius,
        }
        whole = {"problem": _given(declared), "design": design, "surrogate": surrogate, "seed": seed}
        return cast(wire.DeclaredSpecification, _given(whole))


def _given(fields: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if value is not None}


def _action(action: Mapping[str, Formula | Sequence[float]]) -> dict[str, Any]:
    """Returns an action whose bounds are texts; a list of values stays one."""
    bounds = {name: _text(cast(Formula, action[name])) for name in ("low", "high") if name in action}
    return {**action, **bounds}


def _expression(formula: Formula) -> Expression:
    """Returns the formula as an expression. A text may be anything, so it is put into brackets when it is joined."""
    if isinstance(formula, Expression):
        return formula
    if isinstance(formula, str):
        return Expression(formula, _COMPARED)
    number = float(formula)
    if not math.isfinite(number):
        raise ValueError(f"a number of a formula is {number}: must be finite")
    text = repr(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)
    return Expression(text, _SIGNED if number < 0 or text.startswith("-") else _WHOLE)


def _text(formula: Formula) -> str:
    return str(_expression(formula))


def _text_or_none(formula: Formula | None) -> str | None:
    return None if formula is None else _text(formula)


def _within(formula: Formula, least: int) -> str:
    """Returns the text, in brackets if its parts hold together less than ``least``."""
    expression = _expression(formula)
    return str(expression) if expression._tightness >= least else f"({expression})"


def _joined(left: Formula, sign: str, right: Formula, tightness: int) -> Expression:
    """Returns a sum or a product. The service computes from the left, so the right side holds together more."""
    spaced = f" {sign} " if tightness == _ADDED else sign
    return Expression(f"{_within(left, tightness)}{spaced}{_within(right, tightness + 1)}", tightness)


def _compared(left: Formula, sign: str, right: Formula) -> Expression:
    return Expression(f"{_within(left, _ADDED)} {sign} {_within(right, _ADDED)}", _COMPARED)


def _called(function: str, *formulas: Formula) -> Expression:
    return Expression(f"{function}({', '.join(_text(formula) for formula in formulas)})")
