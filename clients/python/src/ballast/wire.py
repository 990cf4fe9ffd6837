"""The types of requests and answers, generated from api/openapi.json by ./generate."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias, TypedDict

from typing_extensions import NotRequired

AdviceSource: TypeAlias = Literal["policy_surrogate", "resolved", "resolved_outside_design", "resolved_other_radius", "unsolved"]
"""How an advice was computed."""


class Annualised(TypedDict):
    """Annual rate and returns of a problem, with p periods in a year. All are fractions, capped at the largest double."""

    rate: float
    """Annual return of the bank, compounded: `(1 + r)^p - 1`."""
    mean_return: float
    """
    Annual return of the asset, compounded: `m^p - 1`, with m the mean of `e^z` over the log-returns z of the
    history.
    """
    deviation: float
    """
    Annual standard deviation of the history's simple returns, for independent periods: `sqrt(p)` times the sample
    standard deviation of one period.
    """


Asset: TypeAlias = str


LogReturnItem: TypeAlias = float | None


LogReturn: TypeAlias = list[LogReturnItem]


SimpleReturnItem: TypeAlias = float | None


SimpleReturn: TypeAlias = list[SimpleReturnItem]


Window: TypeAlias = int | None


class AssetsNow(TypedDict):
    """A period of several assets after all corrections."""

    log_returns: NotRequired[dict[str, float | None]]
    """
    Log-returns by asset name; null if they are missing. Null for an asset whose price did not come, or that lost
    everything, which `notes` says.
    """


class AssetsPeriods(TypedDict):
    """The decisions and results of one strategy, one number per period."""

    strategy: str
    """Name of the strategy."""
    allocations: dict[str, list[float]]
    """Share of wealth held in each asset, by its name."""
    radius: list[float]
    """Radius of the ball, in log-return; 0 if there was none."""
    traded: list[float]
    """Share of wealth that was bought and sold at the start of the period."""
    wealth: list[float]
    """Wealth at the end of the period, from 100."""


ActionIntervalItem: TypeAlias = float


HistoryItemItem: TypeAlias = float | None


HistoryItem: TypeAlias = list[HistoryItemItem]


class AuditEntry(TypedDict):
    """One recorded action."""

    at_ms: int
    """Time of the action, in milliseconds since 1970."""
    tenant: str
    key: NotRequired[str | None]
    """Name of the key; null if no key was needed, or if a command on the store did it."""
    roles: str
    """
    Roles of the key. `anybody` if no key was needed, `operator` for a command on the store, or `service`. Empty for
    `session.observe`, because an observation keeps only the name of the key.
    """
    action: str
    object: str
    """The object of the action."""
    outcome: str
    """Result of the action."""
    number: int
    """
    Number of the entry, from 1, among those of its key in this tenant. For `session.observe`, among those of its
    session.
    """
    seal: str
    """
    SHA-256 over the entry and the seal of the entry before it, in hexadecimal digits. A saved copy proves later
    that this entry and all before it are unchanged.
    """


class AuditPage(TypedDict):
    """A page of the audit log, newest first."""

    entries: list[AuditEntry]
    next: NotRequired[int | None]
    """Cursor to pass as `after` for the next page; null on the last page."""


class BacktestIntervals(TypedDict):
    """
    How the intervals were made: for certainty equivalents from each year's contribution to them, for chances from whole
    years, for other figures from circular blocks of the periods, the same for all strategies.
    """

    confidence: float
    """Intended coverage probability of an interval; intervals of differences hold simultaneously with it."""
    comparisons: int
    """
    Differences from one strategy, whose intervals hold simultaneously. Differences from own mixes number as many as
    there are strategies with one.
    """
    resamples: int
    """Number of resamples, for figures that are resampled."""
    period_block: int
    """Periods per block in these resamples."""
    year_block: int
    """Consecutive years that may depend on each other."""


class BacktestPeriods(TypedDict):
    """The decisions and results of one strategy, one number per period."""

    strategy: str
    """Name of the strategy."""
    allocation: list[float]
    """Share of wealth held in the period."""
    low: list[float]
    """Lower end of the no-trade region."""
    high: list[float]
    """Upper end of the no-trade region."""
    radius: list[float]
    """Radius of the ball, in log-return; 0 if there was none."""
    traded: list[float]
    """Share of wealth moved between bank and asset at the start of the period."""
    wealth: list[float]
    """Wealth at the end of the period, from 100."""


LogReturn1: TypeAlias = float


SimpleReturn1: TypeAlias = float


AlphaItem: TypeAlias = float


class BankRate(TypedDict):
    """The rate that the bank paid in each period, as a fraction."""

    column: str
    """The name of the column."""
    rates: list[float]
    """Rates in the order of the returns."""


class Benchmarks(TypedDict):
    """
    Wealth at the end of a period, had a simple rule been followed from the start of the session: with the same wealth,
    holdings, rates, flows, spending and trading cost. Null once a rule cannot pay them.
    """

    equal_weights: NotRequired[float | None]
    """Equal shares of all wealth in every asset, restored at the start of each period."""
    initial_composition: NotRequired[float | None]
    """
    All wealth in the fund's first composition, restored at the start of each period. The share of an asset that
    leaves is spread over those that stay, in proportion.
    """
    bank: NotRequired[float | None]
    """All wealth in the bank."""


class Bootstrap1(TypedDict):
    """Independent draws of the past returns, spread by a kernel."""

    bandwidth: float
    """Deviation of the kernel over that of the record, before the variance is restored."""
    kind: Literal["smoothed"]


class Bootstrap2(TypedDict):
    """The smoothed law with each asset's returns shifted so that its mean is the bank's: no premium."""

    bandwidth: float
    """Deviation of the kernel over that of the record, before the variance is restored."""
    kind: Literal["without_premium"]


class Bootstrap3(TypedDict):
    """Blocks of consecutive past returns; the last is followed by the first."""

    length: int
    """Periods per block."""
    kind: Literal["block"]


Bootstrap: TypeAlias = Bootstrap1 | Bootstrap2 | Bootstrap3
"""How records are drawn from the given one."""


class BootstrapEstimate(TypedDict):
    """A figure with its interval."""

    value: float
    """Value on the actual record."""
    interval: list[float]
    """Lower and upper end."""


class BreakingReturn(TypedDict):
    """The mean return that decides whether an amount lasts, or whether the goal aimed at is reached."""

    mean_return: float
    """Mean simple return of the risky asset a period, as a fraction."""
    mean_seen: float
    """That of the record."""
    standard_errors: float
    """Their distance in standard errors of the record's mean: negative if the breaking return is lower."""


class CareCount(TypedDict):
    """Numbers of sessions that need care, by reason; a session may have several reasons."""

    sessions: int
    """Sessions that match."""
    any: int
    """Sessions that need care for any of the reasons."""
    overdue: int
    """Sessions whose next report is late."""
    renewal: int
    """Sessions that wait for their next policies."""
    alarm: int
    """Sessions whose returns have changed (drift alarm)."""
    ending: int
    """Sessions that are completed, or in their last period without automatic renewal."""


CareReason: TypeAlias = Literal["overdue", "renewal", "alarm", "ending"]
"""Reason why a session needs care."""


CautionCode: TypeAlias = Literal["short_record", "one_return", "not_certified", "waiting"]
"""The kinds of reasons."""


class CautionLevel1(TypedDict):
    """A fixed share, from 0 to 10, independent of the record. At 0 the record is taken as the true law."""

    scale: float
    """A fixed share, from 0 to 10, independent of the record. At 0 the record is taken as the true law."""


CautionLevel: TypeAlias = Literal["paper"] | Literal["bold"] | Literal["balanced"] | Literal["cautious"] | CautionLevel1
"""
Share of the radius that is used: a named level, or a number. `bold`, `balanced` and `cautious` are found by
simulation in three worlds: with no premium, with half of it, and with the whole of it.
"""


class CautionScale(TypedDict):
    """A share of the radius and its cost in the three worlds. Losses are in log certainty equivalent per step."""

    scale: float
    """Share of the radius."""
    standard_error: float
    """Standard error of the share, from the simulation of records."""
    regrets: list[float]
    """Loss relative to the best share in each of the three worlds: without a premium, with half, and with the whole."""
    spared: float
    """Loss avoided relative to taking the record as the true law, in the world without a premium."""


class CentreSpecification1(TypedDict):
    """The empirical law of the returns seen."""

    kind: Literal["empirical"]


class CentreSpecification2(TypedDict):
    """
    The perturbed empirical law: a return seen plus a normal error. Its radius is that of the returns seen, because
    smoothing does not add returns.
    """

    bandwidth: float
    """Standard deviation of the error, in log-return, 0 to 1. At 0 the centre is that of `empirical`."""
    kind: Literal["smoothed"]


class CentreSpecification3(TypedDict):
    """
    The law of the returns seen, each rescaled to the volatility expected for the coming period. That volatility is
    estimated by an exponentially weighted mean of squares. This needs the framework `static` or one period, because
    the effect of later returns on the volatility is not part of a state.
    """

    half_life: float
    """Number of periods in which the weight of a square halves, 1 to 1e15."""
    kind: Literal["volatility_scaled"]


HistoryItem1: TypeAlias = float


Change: TypeAlias = Literal["replace", "insert", "remove"]
"""A change to observed periods."""


class ComparedPeriod(TypedDict):
    """Means of a period over all paths."""

    states: dict[str, float]
    """States before the noise, by name."""
    actions: dict[str, float]
    """Actions by name."""


class CompositionRule1(TypedDict):
    """These shares, one for each asset in order; they sum to 1."""

    given: list[float]
    """These shares, one for each asset in order; they sum to 1."""


CompositionRule: TypeAlias = Literal["one_step"] | Literal["equal"] | Literal["inverse_volatility"] | CompositionRule1
"""How the composition of the fund is chosen. Default: `one_step`."""


Contributions: TypeAlias = float | list[float]
"""
C, the money added at the end of each period, or withdrawn if negative: one number for all periods, or a list with
one number for each. Default 0.
"""


class Correct(TypedDict):
    """A change of observed periods: a period is reported again in full, inserted between others, or removed."""

    correction: int
    """Number of the correction, from 1."""
    period: int
    """The period to correct or remove, or the one to insert before."""
    change: NotRequired[Change]
    reason: str
    """The reason, in at most 200 characters."""
    confirm: NotRequired[bool]
    """Confirms the correction despite any doubts."""
    log_return: NotRequired[float | None]
    simple_return: NotRequired[float | None]
    """`price / previous price - 1`; -1 is a total loss."""
    price: NotRequired[float | None]
    """Price at the end of the period; 0 is a total loss."""
    previous_price: NotRequired[float | None]
    """Price at the start of the period. Default: the price reported for the period before."""
    log_returns: NotRequired[dict[str, float | None]]
    """Log-returns of several assets by name. Each has one, or null if its price did not come."""
    simple_returns: NotRequired[dict[str, float | None]]
    """
    `price / previous price - 1` of several assets by name; -1 is a total loss. The return after a null
    covers every period since the last price.
    """
    prices: NotRequired[dict[str, float | None]]
    """Prices of several assets at the end of the period; 0 is a total loss."""
    previous_prices: NotRequired[dict[str, float | None]]
    """
    Prices of several assets at the start of the period, or the last one that came. Default: those reported
    before.
    """
    noise: NotRequired[float | None]
    """The noise that a declared problem's period brought."""
    executed: NotRequired[dict[str, float]]
    """Actions that were executed in a declared problem's period, each by its name. Default: the advised ones."""
    state: NotRequired[dict[str, float]]
    """States that a declared problem's period led to, each by its name. Default: those that the formulas give."""
    missing: NotRequired[bool]
    """Given instead of a return or a noise if none is known: the law does not change, and holdings count as unmoved."""
    date: NotRequired[str | None]
    """The last day of the period, later than that of the period before."""
    rate: NotRequired[float | None]
    """Rate that the bank paid in the period. Default: the policy's rate."""
    flow: NotRequired[float | None]
    """Money added at the end of the period; negative if withdrawn. Default: the policy's contribution."""
    spent: NotRequired[float | None]
    """Money spent from wealth at the start of the period. Default: what was advised; nothing without spending."""
    executed_allocation: NotRequired[float | None]
    """Share of wealth held in the risky asset through the period. Default: the advised allocation."""
    executed_allocations: NotRequired[dict[str, float]]
    """Share of wealth held in each of several assets through the period. Default: the advised allocations."""
    wealth: NotRequired[float | None]
    """Wealth reached, with what was added, if it differs from what the fields above give."""


class Costs(TypedDict):
    """Run times of the evaluation, the only part that differs between two runs."""

    training_seconds: float
    """Seconds of all trainings."""
    simulation_seconds: float
    """Seconds of the simulation."""
    resolve_seconds: NotRequired[float | None]
    """Mean seconds of one re-solved step; null if there was none."""


class Covariate1(TypedDict):
    """The exponentially weighted mean of the log-returns before."""

    half_life: float
    """Number of periods in which the weight of a return halves, 1 to 1e15."""
    kind: Literal["trend"]


class Covariate2(TypedDict):
    """The root of the exponentially weighted mean of their squares."""

    half_life: float
    """Number of periods in which the weight of a square halves, 1 to 1e15."""
    kind: Literal["volatility"]


Value: TypeAlias = float


class Covariate3(TypedDict):
    """Numbers of your own."""

    values: list[Value]
    """
    The figure before each return of the history, oldest first, and the present one: one number more than the
    history has.
    """
    kind: Literal["column"]


Covariate: TypeAlias = Covariate1 | Covariate2 | Covariate3
"""A figure known before each period that tells times apart."""


class DeclaredAction(TypedDict):
    """An action: any number between two bounds, or one of some values."""

    low: NotRequired[str | None]
    """Formula of the lowest action, of the states, the parameters, `t` and `T`."""
    high: NotRequired[str | None]
    """Formula of the highest action, of the same."""
    values: NotRequired[list[float] | None]
    """The actions that there are, instead of bounds."""


class DeclaredDesign(TypedDict):
    """The states that the surrogates of a declared problem are trained on."""

    accuracy: NotRequired[float | None]
    """
    Target accuracy of the worth, in its own unit as of the start: the root mean square error over the states of a step,
    including the errors of later steps. Design points are added until fresh states show that it is reached, or until
    there are `count`. Default: none, and `count` decides.
    """
    count: NotRequired[int | None]
    """Number of design points per step, 10 to 10,000; with an `accuracy`, the largest number. Default 1000."""


class DeclaredNow(TypedDict):
    """A period of a declared problem after all corrections."""

    noise: NotRequired[float | None]
    """Null if it is missing."""
    executed: dict[str, float]
    """The actions executed, by name."""
    reward: NotRequired[float | None]
    """The reward of the period by the problem's formula; null if the noise is missing or the formula gives no number."""
    earned: float
    """Rewards since the start of the session, discounted to it."""
    state: dict[str, float]
    """The states after the period, by name."""
    date: NotRequired[str | None]
    """Its last day, if it is known."""


class DeclaredState(TypedDict):
    """A state: where it starts, and the range that it never leaves."""

    start: float
    """Value at the start."""
    low: float
    """Lowest value."""
    high: float
    """Highest value."""


class DeclaredUtility1(TypedDict):
    """`(1 - exp(-risk_aversion x)) / risk_aversion`."""

    risk_aversion: float
    """Absolute risk aversion, per unit of the amount."""
    of: str
    """Formula of the amount."""
    kind: Literal["exponential"]


class DeclaredUtility2(TypedDict):
    """`(x^(1 - risk_aversion) - 1) / (1 - risk_aversion)` of a positive amount."""

    risk_aversion: float
    """Relative risk aversion, above 1 and at most 100."""
    of: str
    """Formula of the amount."""
    kind: Literal["power"]


class DeclaredUtility3(TypedDict):
    """`ln x` of a positive amount."""

    of: str
    """Formula of the amount."""
    kind: Literal["log"]


DeclaredUtility: TypeAlias = DeclaredUtility1 | DeclaredUtility2 | DeclaredUtility3
"""A utility of the amount that a formula of the states gives at the end."""


DoubtReason: TypeAlias = Literal["missing_periods", "early_day", "future_day", "unusual_return", "unusual_noise", "total_loss", "repeated", "differs_from_peers"]
"""Why a report is doubted."""


DriftLevel: TypeAlias = Literal["none", "warning", "alarm"]
"""The meaning of the highest value."""


class Estimate(TypedDict):
    """A figure and its interval."""

    value: float
    """The estimate."""
    low: float
    """Lower end of the interval."""
    high: float
    """Upper end of the interval."""


ConstantMix: TypeAlias = float


EventKind: TypeAlias = Literal["job_ended", "advice_changed", "left_band", "drift_alarm", "renewal_failed", "report_due", "report_late"]
"""
The kind of an event: `job_ended`, `advice_changed`, `left_band`, `drift_alarm`, `renewal_failed`, `report_due` or
`report_late`.
"""


class ExpectedError(TypedDict):
    """
    Root mean square errors of the value of a step, in basis points of the certainty equivalent, at any holding; for a
    declared problem, unless its utility is power or log, in ten-thousandths of the size of its amounts. They
    are over the design's own law of its states, of which one in eight leaps beyond the record: one or more of the returns
    on the way to it may be anything within the support.
    """

    own: float
    """The error of the surrogate of the step alone."""
    total: float
    """
    The error with those of the steps after it. Along one record the errors of neighbouring steps are alike, so they
    add up to more than independent errors would: to 1.6 times as much over a dozen steps.
    """


Explain: TypeAlias = Literal["worst_case"]
"""The explanation shown beside an allocation."""


class FanPeriod(TypedDict):
    """Quantiles after some periods."""

    after: int
    """Number of periods since the start."""
    wealth: list[float]
    """Wealth before spending."""
    spending: NotRequired[list[float] | None]
    """Spending of the period that begins, negative if money is put in; null at the horizon."""


class FanPoint(TypedDict):
    """Quantiles over paths at one time."""

    low: float
    """Value below which a tenth of the paths lie."""
    median: float
    """The median."""
    high: float
    """Value below which nine tenths of the paths lie."""


FeatureMap: TypeAlias = Literal["standardized", "raw_moments"]
"""The map from a state to the inputs of a surrogate."""


class Firm(TypedDict):
    """The firm that writes letters. Only a link keeps it, without the logo."""

    name: NotRequired[str]
    """At most 80 letters, without control characters. Default: none."""
    closing: NotRequired[str]
    """The last line of the letter, at most 200 letters. Default: none."""
    disclaimer: NotRequired[str]
    """Text in small print below it, at most 600 letters. Default: none."""
    logo: NotRequired[str | None]
    """A PNG, JPEG or WebP picture of at most 200 KB, as a data URL in base64. Default: none."""


Framework: TypeAlias = Literal["adaptive", "static", "known_law", "plug_in", "parametric_static", "parametric_adaptive"]
"""The framework: what the advice is robust against, and whether new returns change it. Default: `adaptive`."""


class FrontierPoint(TypedDict):
    """The loss at one multiple of the radius."""

    scale: float
    """Multiple of the radius."""
    lost: Estimate
    """Basis points of certainty equivalent below the best allocation, on average over records."""
    deviation: Estimate
    """Standard deviation of that loss from record to record."""
    beyond_least: NotRequired[Estimate | None]
    beyond_own_mix: Estimate
    """
    Gain of the advice over a constant mix of its own average allocation over all records, in the unit of `lost`. It
    is at most 0, up to rounding, because worth under one law is concave in the allocation.
    """
    total: float
    """Share of wealth held in all assets together, on average over records."""


Scale: TypeAlias = float


HistoryItem2Item: TypeAlias = float | None


HistoryItem2: TypeAlias = list[HistoryItem2Item]


class GivenUpDelivery(TypedDict):
    """A delivery that was given up."""

    delivery: str
    """The identifier under which every attempt was sent, in the header `webhook-id`, or of an e-mail in `Message-ID`."""
    event: EventKind
    created_ms: int
    """Time of the event, in milliseconds since 1970."""
    attempts: int
    error: str
    """Why the last attempt failed."""
    body: str
    """The body that was sent."""


GroundNorm: TypeAlias = Literal["scaled_one", "sup"]
"""The distance between the log-returns of two dates. Default: `scaled_one`."""


class GroupLimit(TypedDict):
    """A group of assets, and the least and the greatest sum of their shares in the risky holdings."""

    name: str
    """Name of the group; all differ."""
    assets: list[Asset]
    """Names of its assets, all different."""
    min: NotRequired[float]
    """The least sum, 0 to 1. Default 0."""
    max: NotRequired[float]
    """The greatest sum, 0 to 1. Default 1."""


class GrowthInBothLaws(TypedDict):
    """Growth if the record is the truth, and under the law that is worst for the share."""

    record: float
    """Growth under the law of the record."""
    worst: NotRequired[float | None]
    """
    Growth under the worst law; -1 if it takes everything. Null for the Kelly share of several strategies, or if the share
    is 0.
    """


class Health(TypedDict):
    """The state of the service."""

    status: str
    version: str
    jobs_queued: int
    jobs_running: int
    sessions: int


class HistoryReport(TypedDict):
    """Results at one initial history."""

    quantile: NotRequired[float | None]
    """The bridge quantile there; null under radius rules other than `bridge`, `calibrated` and `joint`."""
    radius: float
    """Radius of the first framework with a ball, in log-return; 0 if there is none."""
    promised: list[float]
    """Certainty equivalent that each framework promises there, in its first advice."""
    mean_utility: list[float]
    """Mean terminal utility of each strategy, in their order."""


Holds: TypeAlias = Literal["dates", "values", "rate", "other"]
"""The contents of a column."""


LengthscaleItem: TypeAlias = float


SignalVarianceItem: TypeAlias = float


NoiseVarianceItem: TypeAlias = float


class HyperparameterBounds(TypedDict):
    """Bounds of the maximum-likelihood search, lowest first, for inputs and targets scaled to unit variance."""

    lengthscale: NotRequired[list[LengthscaleItem]]
    """Length scales, in standard deviations of an input over the design. Default: `[0.05, 1000]`."""
    signal_variance: NotRequired[list[SignalVarianceItem]]
    """Signal variances, in mean squares of the target over the design. Default: `[0.001, 100000]`."""
    noise_variance: NotRequired[list[NoiseVarianceItem]]
    """Noise variances, in mean squares of the target over the design. Default: `[1e-10, 1]`."""


class Imported(TypedDict):
    """An imported policy."""

    policy: str


class InBothWorlds(TypedDict):
    """A figure on paths of either law."""

    record: Estimate
    """Returns are drawn from the centre of the ball: from the record, unless `problem.centre` says otherwise."""
    worst: Estimate
    """Each of these returns is moved as the law that is worst for the plan moves it in its period."""


class InitialHistories1(TypedDict):
    """The problem's own history."""

    kind: Literal["given"]


class InitialHistories2(TypedDict):
    """Histories drawn from the true law, each as long as the problem's own."""

    count: int
    """Number of histories, 2 to 1000."""
    kind: Literal["drawn"]


InitialHistories: TypeAlias = InitialHistories1 | InitialHistories2
"""Histories that paths start from."""


InitialHistory: TypeAlias = list[float] | list[list[float | None]]
"""Log-returns known at the start of a session, oldest first."""


InitialLaws: TypeAlias = Literal["given", "resampled"]
"""Starting point of the design's empirical laws."""


InputRange = TypedDict(
    "InputRange",
    {
        "input": str,
        "from": float,
        "to": float,
        "points": int,
    },
)


class InputValues(TypedDict):
    """The values of an input."""

    input: str
    values: list[float]


class Interval(TypedDict):
    """A closed interval."""

    min: float
    """The lower end."""
    max: float
    """The upper end."""


JobKind: TypeAlias = Literal["train", "evaluate", "backtest", "frontier"]
"""The kind of computation that a job runs."""


JobState: TypeAlias = Literal["queued", "running", "succeeded", "failed", "cancelled"]


class KeyHolder(TypedDict):
    """The caller that the key belongs to."""

    key: NotRequired[str | None]
    """Name of the key, which is no secret; null if the store needs no keys."""
    tenant: str
    """Tenant whose jobs, policies and sessions the key reaches."""
    roles: list[str]
    """Roles of the key: `read`, `operate`, `train`, `admin`. An admin may do everything that the others may."""
    expires_ms: NotRequired[int | None]
    """Expiry of the key, in milliseconds since 1970; null if it does not expire."""


Kind: TypeAlias = Literal["simple", "log", "price", "gross", "cumulated"]
"""The kind of the numbers."""


class Labels(TypedDict):
    """The labels of a policy or a session; a part that was not set is empty."""

    name: str
    """The name, which need not be unique."""
    notes: str
    tags: list[str]


class Learning1(TypedDict):
    """All returns have the same weight."""

    kind: Literal["equal"]


class Learning2(TypedDict):
    """A return has half the weight of one that is `half_life` periods newer: the law forgets the distant past."""

    half_life: float
    """Half-life, in periods, 1 to 1e15."""
    kind: Literal["decay"]


Learning: TypeAlias = Learning1 | Learning2
"""Weight of a return in the learned law, for the history and for later returns alike. Default: `equal`."""


class LeftOut(TypedDict):
    """The advice without one return."""

    index: int
    """Index of the return in the record, from 0; the first of equal ones."""
    log_return: float
    """The return that is left out."""
    simple_return: float
    """The return as `price / previous price - 1`."""
    allocation: float
    """The share of wealth that would be advised."""


class LetterLink(TypedDict):
    """A link, without its secret."""

    link: str
    created_ms: int
    """In milliseconds since 1970."""
    expires_ms: int
    """In milliseconds since 1970."""


class LetterLinks(TypedDict):
    """The links of a session, oldest first."""

    links: list[LetterLink]


class LevelAdvised(TypedDict):
    """A level, its share of the radius, its price, and its allocation."""

    level: CautionLevel
    """Name of the level."""
    scale: float
    """Share of the radius."""
    regrets: list[float]
    """Loss of log certainty equivalent per step against the best share of the radius, in the three worlds."""
    spared: float
    """Gain per step in the world without a premium, against taking the record as true."""
    allocation: NotRequired[float | None]
    """
    Share of wealth that the level would hold; null if it would take long to compute, for several assets in long
    records.
    """
    allocation_error: NotRequired[float | None]
    """Standard error of the allocation, from the simulation behind the level; only for the level that is followed."""


class LevelsAdvised(TypedDict):
    """The levels of caution on a record."""

    followed: CautionLevel
    """The level that is followed."""
    premium_seen: float
    """Mean simple return of the record beyond the bank, per step."""
    standard_error: float
    """Standard error of this premium."""
    premiums: list[float]
    """
    Mean simple return beyond the bank in the three worlds for which losses are reported: none, half, and the whole
    of the observed premium plus its standard error. A negative premium counts as 0.
    """
    levels: list[LevelAdvised]
    """The levels, from the boldest to the paper's."""


class MadeLink(TypedDict):
    """A new link."""

    link: str
    path: str
    """The address of the letter on this service. It is shown once."""
    expires_ms: int
    """When it expires, in milliseconds since 1970."""


class MapPoint(TypedDict):
    """The decision at one point of a map."""

    actions: NotRequired[dict[str, float]]
    """The best actions, by name; null if there are none."""
    value: NotRequired[float | None]
    """Worth of this period and those after it, as in a decision at a state."""
    untrained_share: NotRequired[float | None]
    """Share of the worst law's outcomes whose worth is a guess, as in a decision at a state."""
    fault: NotRequired[str | None]
    """The reason why nothing can be decided here: an action that the solver tries may lead a state out of its range."""


class MeansRule1(TypedDict):
    """The means of the returns seen."""

    kind: Literal["sample"]


class MeansRule2(TypedDict):
    """The means moved towards their average over the assets."""

    intensity: float
    """Share of the way, 0 to 1. At 0 the means are those of `sample`, at 1 all assets have one mean."""
    kind: Literal["shrunk"]


class MeansRule3(TypedDict):
    """The means moved towards that of the minimum-variance portfolio, as far as the record's noise says (Jorion 1986)."""

    kind: Literal["bayes_stein"]


MeansRule: TypeAlias = MeansRule1 | MeansRule2 | MeansRule3
"""
The means of the assets under the law at the centre of the ball. Shrunk means move every return of an asset by the same
factor; risks and correlations stay. They are found anew with each return. Default: `sample`.
"""


class MixtureComponent(TypedDict):
    """One normal law of a mixture, of log-returns per step."""

    weight: float
    """Probability of the component, above 0 and at most 1."""
    mean: float
    """Mean, in log-return, -1 to 1."""
    variance: float
    """Variance, in squared log-return, 1e-12 to 1."""


class NextAdvice(TypedDict):
    """The advice after one more return."""

    quantile: float
    """Share of the record below it; interpolated between its returns (Hyndman and Fan, type 7)."""
    log_return: float
    """The hypothetical return."""
    simple_return: float
    """The return as `price / previous price - 1`."""
    allocation: float
    """The share of wealth that would be advised."""


class Noise(TypedDict):
    """The noise, observed each period, and its support."""

    name: str
    """Its name in the formulas."""
    low: float
    """Lowest value."""
    high: float
    """Highest value."""


NoiseMove = TypedDict(
    "NoiseMove",
    {
        "from": float,
        "to": float,
        "share": float,
    },
)


NoteReason: TypeAlias = Literal["total_loss", "learned_in_part", "price_missing", "price_late"]
"""The reason for a note."""


class Observe(TypedDict):
    """The return of one period, given in exactly one of three ways or as missing, and the trades in it."""

    session: str
    period: int
    """Number of the period, from 1."""
    confirm: NotRequired[bool]
    """Confirms the report despite any doubts."""
    log_return: NotRequired[float | None]
    simple_return: NotRequired[float | None]
    """`price / previous price - 1`; -1 is a total loss."""
    price: NotRequired[float | None]
    """Price at the end of the period; 0 is a total loss."""
    previous_price: NotRequired[float | None]
    """Price at the start of the period. Default: the price reported for the period before."""
    log_returns: NotRequired[dict[str, float | None]]
    """Log-returns of several assets by name. Each has one, or null if its price did not come."""
    simple_returns: NotRequired[dict[str, float | None]]
    """
    `price / previous price - 1` of several assets by name; -1 is a total loss. The return after a null
    covers every period since the last price.
    """
    prices: NotRequired[dict[str, float | None]]
    """Prices of several assets at the end of the period; 0 is a total loss."""
    previous_prices: NotRequired[dict[str, float | None]]
    """
    Prices of several assets at the start of the period, or the last one that came. Default: those reported
    before.
    """
    noise: NotRequired[float | None]
    """The noise that a declared problem's period brought."""
    executed: NotRequired[dict[str, float]]
    """Actions that were executed in a declared problem's period, each by its name. Default: the advised ones."""
    state: NotRequired[dict[str, float]]
    """States that a declared problem's period led to, each by its name. Default: those that the formulas give."""
    missing: NotRequired[bool]
    """Given instead of a return or a noise if none is known: the law does not change, and holdings count as unmoved."""
    date: NotRequired[str | None]
    """The last day of the period, later than that of the period before."""
    rate: NotRequired[float | None]
    """Rate that the bank paid in the period. Default: the policy's rate."""
    flow: NotRequired[float | None]
    """Money added at the end of the period; negative if withdrawn. Default: the policy's contribution."""
    spent: NotRequired[float | None]
    """Money spent from wealth at the start of the period. Default: what was advised; nothing without spending."""
    executed_allocation: NotRequired[float | None]
    """Share of wealth held in the risky asset through the period. Default: the advised allocation."""
    executed_allocations: NotRequired[dict[str, float]]
    """Share of wealth held in each of several assets through the period. Default: the advised allocations."""
    wealth: NotRequired[float | None]
    """Wealth reached, with what was added, if it differs from what the fields above give."""


Tag: TypeAlias = str


OrderSide: TypeAlias = Literal["buy", "sell"]
"""Side of an order."""


class OrdersQuestion(TypedDict):
    """A question for the orders that follow a session's advice."""

    session: str
    prices: dict[str, float]
    """Price of a unit of each asset, by name, 1e-12 to 1e15; of a session of one asset its name is `asset`."""
    units: dict[str, float]
    """Units held of each asset, by name, 0 to 1e15."""
    cash: float
    """Money in the bank, 0 to 1e15."""
    lots: NotRequired[dict[str, float]]
    """Units that can be traded at once, by name, 1e-9 to 1e9. Default: 1 of each asset."""
    smallest: NotRequired[float]
    """Smallest amount of money that is traded, 0 to 1e15. Default 0."""
    buys_only: NotRequired[bool]
    """If true, nothing is sold. Default false."""
    trading_cost: NotRequired[float]
    """Cost of trading, as a share of the amount traded, 0 to 0.1. Default 0."""


class OwnMix(TypedDict):
    """
    The constant mix of a strategy's own average allocation, on the same returns. Nobody could have chosen it
    beforehand.
    """

    allocation: float
    """The average allocation, over all periods of all paths."""
    beyond: Estimate
    """
    Certainty equivalent of the strategy less that of the mix, in terminal wealth: the gain from changing the
    allocation.
    """


OwnSharesVecF64: TypeAlias = list[list[float]] | str
"""Shares of a strategy: given for every period, or found by a formula."""


OwnSharesF64: TypeAlias = list[float] | str
"""Shares of a strategy: given for every period, or found by a formula."""


class Performance(TypedDict):
    """The worth of a strategy and its variation; returns are fractions."""

    yearly_certainty_equivalent: BootstrapEstimate
    """Certainty equivalent of mean utility over the whole years, each from wealth 100."""
    beyond_own_mix: NotRequired[BootstrapEstimate | None]
    annual_mean: BootstrapEstimate
    """Mean simple return per year, compounded: `(1 + m)^p - 1`, m the mean per period and p the periods per year."""
    annual_volatility: BootstrapEstimate
    """Standard deviation of simple returns, per square root of a year."""
    sharpe_ratio: BootstrapEstimate
    """Mean excess over the bank divided by its deviation."""
    annual_turnover: BootstrapEstimate
    """Share of wealth that is bought and sold per year."""
    chance_of_loss: BootstrapEstimate
    """Share of years that end with a loss, among the years that begin with every period."""
    worst_twentieth: BootstrapEstimate
    """Mean return of the worst twentieth of these years."""
    max_drawdown: float
    """Largest fall below the highest wealth so far, as a share of it."""
    final_wealth: float
    """Terminal wealth, from 100."""
    mean_allocation: float
    """Mean share of wealth in the risky asset, or in all assets together."""


class PeriodAccount(TypedDict):
    """Money of a period, after all corrections."""

    rate: float
    """Rate that the bank paid."""
    flow: float
    """Money added at the end; negative if withdrawn."""
    spent: NotRequired[float | None]
    """Money spent at the start; left out if it is none."""
    turnover: float
    """Share of wealth bought and sold at the start, in all assets together."""
    cost: float
    """Money that these trades cost."""
    benchmarks: Benchmarks


class PeriodByState(TypedDict):
    """Spending and holding of a period in some states; linear between them."""

    period: int
    """Number of the period, from 1."""
    states: list[float]
    """The numbers of the states, ascending."""
    spent: NotRequired[list[float] | None]
    """Share of wealth to spend in each; left out if the plan aims at a goal and spends the amount wanted."""
    held: list[float]
    """Share of what is left to hold in the risky asset in each."""


class PeriodNote(TypedDict):
    """A note on a recorded period."""

    reason: NoteReason
    asset: NotRequired[str | None]
    """The asset, if there are several."""
    sentence: str
    """The note, in one sentence."""


Phase: TypeAlias = Literal["solving", "fitting", "simulating"]
"""The phase of a job."""


PlanAim: TypeAlias = Literal["spending", "goal"]
"""The aim of a plan."""


class PlanFan(TypedDict):
    """Quantiles of the plan's paths."""

    shares: list[float]
    """The shares of paths below the quantiles."""
    record: list[FanPeriod]
    """If returns are drawn from the centre."""
    worst: list[FanPeriod]
    """If each is moved as the worst law moves it."""


PlanRule: TypeAlias = Literal["plan", "trusting", "sixty_forty", "four_percent", "share_of_wealth"]
"""Rules for spending and holding."""


PlanStateNumber: TypeAlias = Literal["funded", "of_peak"]
"""The number by which the state of a plan is described."""


class PlanStrategy(TypedDict):
    """Figures of a rule."""

    rule: PlanRule
    """The rule."""
    ruin: InBothWorlds
    """Probability that the money runs out before the horizon."""
    mean_spending: InBothWorlds
    """Spending of a period, the mean over a path, in the middle case."""
    lowest_spending: InBothWorlds
    """Lowest spending of a period on a path, in the middle case."""
    poor_spending: InBothWorlds
    """Lowest spending of a period on a path, in the worst twentieth of cases."""
    bequest: InBothWorlds
    """Wealth at the horizon, in the middle case."""
    reaches_goal: NotRequired[InBothWorlds | None]
    shortfall: NotRequired[InBothWorlds | None]
    max_drawdown: InBothWorlds
    """Largest drawdown of money that stays invested, in the worst twentieth of cases."""
    certainty_equivalent: NotRequired[InBothWorlds | None]


class PlannedPeriod(TypedDict):
    """Spending and holding of a period."""

    period: int
    """Number of the period, from 1."""
    spent: float
    """Share of wealth to spend at its start; of the surplus, beside what is secured, if anything is."""
    held: float
    """Share of what is left to hold in the risky asset; of the surplus that is left, if anything is secured."""
    reserve: NotRequired[float | None]
    """Wealth that must be in the bank at its start for all that is secured, in money of now; left out if nothing is."""


class PlannedStates(TypedDict):
    """Spending and holding of a plan by its state."""

    described_by: PlanStateNumber
    """The meaning of the numbers of the states."""
    periods: list[PeriodByState]
    """The plan in some periods, ascending."""


class PolicyEntry(Labels):
    """A policy in a list."""

    policy: str
    created_ms: int
    bytes: int
    """Length of the exported document, in bytes."""


class PolicyMap(TypedDict):
    """The actions of a period over ranges of inputs."""

    policy: str
    period: int
    """The period decided, from 1."""
    across: list[InputValues]
    """The values of each input, in the order of the question."""
    points: list[MapPoint]
    """The decisions, those of each value of the first input in the order of the values of the second."""


class PolicyPage(TypedDict):
    """A page of policies, newest first."""

    policies: list[PolicyEntry]
    next: NotRequired[int | None]
    """Cursor to pass as `after` for the next page; null on the last page."""


class Premium(TypedDict):
    """The record's mean return beyond the bank, and the mean at which the advice changes."""

    present: float
    """
    Mean simple return of the record, by its weights, less `rate_per_step`: its excess per period over what the bank
    pays now.
    """
    needed: NotRequired[float | None]
    """
    The premium after every log-return is shifted by the amount at which the advice leaves the bank, to 1e-6. It is
    above `present` if all is in the bank now, or else below it. Null if no shift separates the two. A shift is at
    most the distance between the lowest and the highest return, and keeps all of them in `support`. In one period
    without trading cost the shift is `ln(1 + rate_per_step)` less the log of the least mean of e^Z in the ball.
    Checked by: tests/solver/sensitivity.rs against that.
    """
    periods_more: NotRequired[int | None]
    """
    Number of further returns, of the law of the record, after which the advice leaves the bank: the least m at
    which the step with the radius times sqrt(n / (n + m)) advises anything. 0 if it has left already; null if it
    does not within 10000 periods, or the radius rule is `fixed`.
    """


HistoryItem3: TypeAlias = float


class RadiusRule1(TypedDict):
    """`scale Q / sqrt(n)`, with Q the (1 - alpha)-quantile of the bridge statistic over simulated paths."""

    alpha: NotRequired[float]
    """Miscoverage: the probability that the ball misses the true law, 0.001 to 0.999. Default 0.1."""
    paths: NotRequired[int]
    """Number of simulated paths, 100 to 100,000. Default 2000."""
    scale: NotRequired[float]
    """Factor on the radius, 0 to 100. Default 1."""
    correction: NotRequired[float | None]
    """
    Factor on every simulated quantile that makes the quantile of the history exact. The service computes it and
    replaces any value in a request.
    """
    rule: Literal["bridge"]


class RadiusRule2(TypedDict):
    """
    The radius of `bridge` times a factor found once, from the history. For records drawn from the smoothed law of
    the history, a share 1 - alpha of the balls with this factor contain that law.
    """

    alpha: NotRequired[float]
    """Miscoverage, 0.01 to 0.999. Default 0.1."""
    paths: NotRequired[int]
    """Number of simulated paths, 100 to 100,000. Default 2000."""
    scale: NotRequired[float]
    """Further factor on the radius, 0 to 100. Default 1."""
    rule: Literal["calibrated"]


class RadiusRule3(TypedDict):
    """
    The radius of `bridge` times a factor found once, from the history, with which the balls of all steps of the
    horizon hold the law together in a share 1 - alpha of all cases. With one step, or a ball frozen at the history,
    the factor is 1. The weights of returns must be equal.
    """

    alpha: NotRequired[float]
    """Miscoverage: the probability that the ball of any step misses the true law, 0.001 to 0.999. Default 0.1."""
    paths: NotRequired[int]
    """Number of simulated paths, 100 to 100,000. Default 2000."""
    rule: Literal["joint"]


class RadiusRule4(TypedDict):
    """
    `D min(sqrt(ln(2 / alpha) / (2 n)), (1/2 + sqrt(ln(1 / alpha) / 2)) / sqrt(n))`, with D the length of the
    `support`, which must be `between`. At every n and for every law on the support, a ball misses the law with
    probability at most alpha, if returns are independent. If weights decay, only the second term applies. Sources:
    Massart (1990) for the constant of the Dvoretzky-Kiefer-Wolfowitz inequality, and McDiarmid (1989).
    """

    alpha: NotRequired[float]
    """Miscoverage, 0.001 to 0.999. Default 0.1."""
    rule: Literal["concentration"]


class RadiusRule5(TypedDict):
    """`kappa / sqrt(n)`."""

    kappa: float
    """kappa, in log-return, 0 to 100."""
    rule: Literal["root_n"]


class RadiusRule6(TypedDict):
    """A fixed radius at every sample size."""

    radius: float
    """Radius, in log-return, 0 to 10."""
    rule: Literal["fixed"]


class RadiusRule7(TypedDict):
    """
    `sqrt(kappa / n)` estimated standard deviations, with kappa the (1 - alpha)-quantile of chi-square with two
    degrees of freedom. The region is `n (mu - m)^2 / v + n (s2 - v)^2 / (2 v^2) <= kappa`, with m and v the
    sample's mean and variance.
    """

    alpha: NotRequired[float]
    """Miscoverage, 0.001 to 1. Default 0.1."""
    rule: Literal["chi_square"]


RadiusRule: TypeAlias = RadiusRule1 | RadiusRule2 | RadiusRule3 | RadiusRule4 | RadiusRule5 | RadiusRule6 | RadiusRule7
"""
Rule by which the radius of the uncertainty set follows from the sample of size n. `chi_square` is for the
confidence region of the parametric frameworks, every other rule for the Wasserstein ball.
"""


class RadiusSpread(TypedDict):
    """The radius over paths."""

    mean: float
    """Mean over paths; all fields are in log-return."""
    quantile_10: float
    """Value below which a tenth of the paths lie."""
    quantile_50: float
    """The median."""
    quantile_90: float
    """Value below which nine tenths of the paths lie."""
    first_path: float
    """Radius on the first path."""


RateUnit: TypeAlias = Literal["fraction", "percent", "unused"]
"""The unit of the bank's rates, if a column holds them."""


Rates: TypeAlias = float | list[float]
"""Return of the bank in each period."""


RecordUnit: TypeAlias = Literal["periods", "trades"]
"""The values of a record."""


class Refutation(TypedDict):
    """Findings that would change the answer. The radius of the ball shrinks with the root of the number of returns."""

    break_even_mean: NotRequired[float | None]
    """
    Mean simple return at which the share becomes 0, or rises above it if it is 0, when all log-returns are shifted alike;
    null for several strategies, or if no shift does so.
    """
    break_even_shift: NotRequired[float | None]
    """
    Shift of all returns at which the share becomes 0, or rises above it if it is 0, as a fraction of the price: -0.001 lowers
    each by 0.1 %. Null if no shift does so.
    """
    until_any: NotRequired[int | None]
    """
    Number of further returns, of the law of the record, at which the share rises above 0: 0 if it has. Null if 10,000 are
    not enough, or the radius rule is `fixed`.
    """
    until_half_kelly: NotRequired[int | None]
    """
    Number of further returns, of the law of the record, at which the share reaches half of the Kelly share: 0 if it has.
    Null if 10,000 are not enough, the Kelly share is null or 0, or the radius rule is `fixed`.
    """
    until_three_quarters_kelly: NotRequired[int | None]
    """Number of further returns at which the share reaches three quarters of the Kelly share, as for half."""
    losses_in_a_row: NotRequired[int | None]
    """
    Losses in a row, each as large as the mean loss of the record, after which the share is 0; null if it is 0 now, 60 are not
    enough, the record has no loss, or there are several strategies.
    """
    mean_loss: NotRequired[float | None]
    """That mean loss, a simple return below 0; null if `losses_in_a_row` is."""


class Relabel(TypedDict):
    """A change of labels: an absent field stays, a null or empty one is cleared."""

    name: NotRequired[str | None]
    """At most 100 letters, without control characters."""
    notes: NotRequired[str | None]
    """At most 2,000 letters, without control characters except line breaks."""
    tags: NotRequired[list[Tag] | None]
    """At most 20 distinct tags, each of 1 to 50 letters without control characters."""


Record1: TypeAlias = float | None


LeavingItem: TypeAlias = str


class Renew(TypedDict):
    """A request to continue a session with another policy."""

    renewal: int
    """Number of the renewal, from 1."""
    policy: str
    """The next policy."""
    window: NotRequired[int | None]
    """Number of last returns that the law is made of. Default: all observed returns."""
    records: NotRequired[dict[str, list[Record1]]]
    """
    Log-returns of each asset that enters the session, by name, oldest first. The last one is that of the last
    observed period, and null stands for a period without one. The law keeps the periods with a return of every
    asset.
    """
    leaving: NotRequired[list[LeavingItem]]
    """Names of the assets that leave the session. What is held of them is sold before the coming period."""


RenewalState: TypeAlias = Literal["due", "training", "failed", "trained"]


class Renewing(TypedDict):
    """How a session renews itself."""

    every: int
    """Periods with one policy until the next is trained; fewer than its horizon."""
    window: NotRequired[int | None]
    """Number of last returns that the next policy is trained on. Default: all observed returns."""


class Report(TypedDict):
    """The record of a period: its return, given in exactly one of three ways or as missing, and the trades in it."""

    log_return: NotRequired[float | None]
    simple_return: NotRequired[float | None]
    """`price / previous price - 1`; -1 is a total loss."""
    price: NotRequired[float | None]
    """Price at the end of the period; 0 is a total loss."""
    previous_price: NotRequired[float | None]
    """Price at the start of the period. Default: the price reported for the period before."""
    log_returns: NotRequired[dict[str, float | None]]
    """Log-returns of several assets by name. Each has one, or null if its price did not come."""
    simple_returns: NotRequired[dict[str, float | None]]
    """
    `price / previous price - 1` of several assets by name; -1 is a total loss. The return after a null
    covers every period since the last price.
    """
    prices: NotRequired[dict[str, float | None]]
    """Prices of several assets at the end of the period; 0 is a total loss."""
    previous_prices: NotRequired[dict[str, float | None]]
    """
    Prices of several assets at the start of the period, or the last one that came. Default: those reported
    before.
    """
    noise: NotRequired[float | None]
    """The noise that a declared problem's period brought."""
    executed: NotRequired[dict[str, float]]
    """Actions that were executed in a declared problem's period, each by its name. Default: the advised ones."""
    state: NotRequired[dict[str, float]]
    """States that a declared problem's period led to, each by its name. Default: those that the formulas give."""
    missing: NotRequired[bool]
    """Given instead of a return or a noise if none is known: the law does not change, and holdings count as unmoved."""
    date: NotRequired[str | None]
    """The last day of the period, later than that of the period before."""
    rate: NotRequired[float | None]
    """Rate that the bank paid in the period. Default: the policy's rate."""
    flow: NotRequired[float | None]
    """Money added at the end of the period; negative if withdrawn. Default: the policy's contribution."""
    spent: NotRequired[float | None]
    """Money spent from wealth at the start of the period. Default: what was advised; nothing without spending."""
    executed_allocation: NotRequired[float | None]
    """Share of wealth held in the risky asset through the period. Default: the advised allocation."""
    executed_allocations: NotRequired[dict[str, float]]
    """Share of wealth held in each of several assets through the period. Default: the advised allocations."""
    wealth: NotRequired[float | None]
    """Wealth reached, with what was added, if it differs from what the fields above give."""


Reports: TypeAlias = Observe | list[Observe]
"""One report, or a list of reports, each for another session."""


class ResampledFrontier(TypedDict):
    """The frontier on records drawn from one law."""

    bootstrap: Bootstrap
    """How the records were drawn."""
    best: list[float]
    """The best allocation under the known law: the share of wealth in each asset."""
    points: list[FrontierPoint]
    """Results scale by scale."""


class Resent(TypedDict):
    """The number of dead letters that were queued again."""

    queued: int


class ReturnAndLog(TypedDict):
    """A return in both units."""

    log_return: float
    """`ln(price / previous price)`."""
    simple_return: float
    """`price / previous price - 1`."""


class ReturnMoments(TypedDict):
    """Moments of a simple return, a period or trade."""

    mean: float
    """Mean."""
    standard_deviation: float
    """Standard deviation, with the divisor n."""


class RotatedSecret(TypedDict):
    """The new secret of a subscription."""

    secret: str
    """Signs every delivery from now on. It is shown again only to a repeat of the request."""
    previous_until_ms: int
    """Until this time, in milliseconds since 1970, the secret before signs too."""


class RpcError(TypedDict):
    """The reason why a request has no result."""

    code: int
    """Code of JSON-RPC or of the protocol."""
    message: str
    data: NotRequired[dict[str, Any] | None]
    """Revisions of the protocol that are supported, if the requested one is not."""


RpcId: TypeAlias = str | int
"""An identifier of a request: text or a whole number."""


RpcVersion: TypeAlias = Literal["2.0"]
"""The version of JSON-RPC."""


class SamplingLaw1(TypedDict):
    """A mixture of normal laws."""

    components: list[MixtureComponent]
    """Components of the mixture, 1 to 32; their weights sum to 1."""
    kind: Literal["gaussian_mixture"]


class SamplingLaw2(TypedDict):
    """Smoothed bootstrap of the history with the weights of its returns, with the same weighted mean and variance."""

    kind: Literal["bootstrap"]


class SamplingLaw3(TypedDict):
    """A Student t law, shifted and scaled."""

    location: float
    """Mean, in log-return per step, -1 to 1."""
    scale: float
    """Factor on a standard t variable, in log-return, 1e-6 to 1."""
    degrees_of_freedom: float
    """Degrees of freedom, 2.1 to 1e6: above 2 the variance is finite."""
    kind: Literal["student_t"]


SamplingLaw: TypeAlias = SamplingLaw1 | SamplingLaw2 | SamplingLaw3
"""A law of log-returns that can be drawn from."""


SessionStatus: TypeAlias = Literal["active", "waiting", "completed"]


class ShareRange(TypedDict):
    """The least and the greatest share of an asset in the risky holdings."""

    min: NotRequired[float]
    """The least share, 0 to 1. Default 0."""
    max: NotRequired[float]
    """The greatest share, 0 to 1. Default 1."""


class SleeveGrowth(TypedDict):
    """Growth of the capital as a fraction of it, compounded."""

    bank: float
    """Growth with everything in the bank."""
    share: GrowthInBothLaws
    """Growth with the share."""
    kelly: NotRequired[GrowthInBothLaws | None]


class SmallestTrade(TypedDict):
    """The smallest trade that is named, as an amount of money, as a share of wealth, or as both."""

    amount: NotRequired[float]
    """Amount of money, 0 to 1e15. Default 0."""
    share: NotRequired[float]
    """Share of wealth, 0 to 1. Default 0."""


SurvivalItem: TypeAlias = float


class Spending(TypedDict):
    """
    Spending at the start of every period, which the policy chooses together with the allocation. Then utility is of what
    is spent in each period and of the wealth left at the horizon, all in money of the same prices:

      sum over t of  d_t u(c_t / p_t)  +  d_T bequest u(x_T / p_T),   d_t = discount^t times the chance to live so long,

    where u is the utility and p_t the level of prices. Utility must be log or power, nothing may be added or withdrawn
    besides, and trading must cost nothing: then the best shares of wealth depend on the law alone.

    Amounts may be secured: a level s that is spent in every period, and wealth k that is left at the horizon, whatever
    returns do. Then utility is of what exceeds them, u(c_t / p_t - s) and u(x_T / p_T - k). The money that pays for them
    from the bank is the reserve, and all shares are of the surplus, wealth above the reserve:

      R_T = k p_T,   R_t = s p_t + R_(t+1) / (1 + r),   c_t = s p_t + share (x_t - R_t).

    The surplus moves as wealth does where nothing is secured, so the best shares are the same; no return of a total loss
    of what is held reaches the reserve. Source: Merton (1971), section 6, and Black and Perold (1992), whose constant
    proportion portfolio insurance this is for a known law.
    """

    lowest: NotRequired[float]
    """Least share of wealth, or of the surplus, that is spent in a period, 0 to 1. Default 0."""
    highest: NotRequired[float]
    """Greatest share of wealth, or of the surplus, that is spent in a period, 0.000001 to 1, and at least `lowest`. Default 1."""
    discount: NotRequired[float]
    """Weight of a period's spending beside that of the period before, 0.5 to 1.5. Default 1."""
    inflation: NotRequired[float]
    """Rise of prices per period, as a fraction, -0.2 to 0.2. Default 0."""
    survival: NotRequired[list[SurvivalItem] | None]
    """For each period the chance to live to the next if alive in it, 0.001 to 1: `horizon` numbers. Default: certain."""
    bequest: NotRequired[float]
    """
    Weight of the wealth left at the horizon, as a number of periods of spending, 0.000001 to 1,000,000. Default 1:
    it counts as much as the spending of one more period.
    """
    secured: NotRequired[float]
    """Amount spent in every period whatever returns do, in money of the start, 0 to 1e15. Default 0."""
    secured_left: NotRequired[float]
    """Wealth left at the horizon whatever returns do, in money of the start, 0 to 1e15. Default 0."""


class SpendingAdvice(TypedDict):
    """Spending that is advised for a period."""

    share: float
    """Share of wealth."""
    amount: float
    """Amount, in the currency of wealth."""
    secured: NotRequired[float]
    """Part of it that is secured; left out if nothing is."""
    reserve: NotRequired[float]
    """Wealth that pays from the bank for this and for what is secured later; left out if nothing is."""


class Spread(TypedDict):
    """Mean and quantiles over paths."""

    mean: float
    """Mean over paths."""
    quantile_10: float
    """Value below which a tenth of the paths lie."""
    quantile_90: float
    """Value below which nine tenths of the paths lie."""


StrategyFamily: TypeAlias = Literal["policy", "one_step"]
"""Strategies of a walk-forward of several assets that are compared with the rules that people use."""


StrategyKind: TypeAlias = Literal["adaptive", "cost_blind", "static", "plug_in", "sixty_forty", "all_stock", "all_bank", "own_mix", "policy", "robust", "robust_sup", "robust_static", "minimum_variance", "inverse_volatility", "equal_shares", "sixty_equal", "own"]
"""A kind of strategy in a walk-forward, which decides its colour and its sentences."""


Session1: TypeAlias = str


class Subscribe(TypedDict):
    """A request to be told of events."""

    url: str
    """
    The address that each event is sent to, by POST. It begins with https:// and leads to public addresses, unless
    the operator allows the host by `--webhook-allow`. If the operator configured a mail server, it may be `mailto:`
    and one address instead, such as `mailto:someone@example.com`: each event is then an e-mail in plain words.
    """
    events: list[EventKind]
    """The kinds of events."""
    sessions: NotRequired[list[Session1]]
    """The sessions whose events are sent; every session of the tenant if left out. `job_ended` is about no session."""
    least_change: NotRequired[float]
    """
    `advice_changed` is sent if a report changes the advised share of some asset by more than this share of wealth,
    or an action of a declared problem by more than this number.
    """


class Subscribed(TypedDict):
    """A new subscription."""

    subscription: str
    secret: str
    """
    Signs every delivery as Standard Webhooks defines it. It is shown again only to a repeat of the request. E-mails
    are not signed.
    """


class SubscriptionState(TypedDict):
    """A subscription and the state of its deliveries."""

    subscription: str
    url: str
    events: list[EventKind]
    sessions: list[str]
    """Empty for every session of the tenant."""
    least_change: float
    created_ms: int
    """In milliseconds since 1970."""
    last_delivered_ms: NotRequired[int | None]
    """Time of the last event that the receiver accepted, in milliseconds since 1970."""
    last_error: NotRequired[str | None]
    """Why the last attempt failed; null if it succeeded."""
    failures: int
    """Attempts that failed since the last delivery."""
    delivered: int
    """Events that the receiver accepted."""
    waiting: int
    """Events that are still to be delivered; at most 1,000."""
    dead: int
    """Deliveries given up after ten attempts; at most 1,000."""
    dropped: int
    """Events and dead letters that were lost because as many were kept already."""
    dead_letters: list[GivenUpDelivery]
    """The newest ten dead letters."""


class Support1(TypedDict):
    """
    From `min(factor z_min, m - 5 s)` to `max(factor z_max, m + 5 s)`, with z_min and z_max the worst and the best
    log-return of the ball's centre, and m and s its mean and standard deviation. Never narrower than from z_min to
    z_max.
    """

    factor: NotRequired[float]
    """Multiple of the worst and the best log-return, 1 to 10. Default 2."""
    rule: Literal["worst_seen"]


class Support2(TypedDict):
    """All log-returns, as in the paper."""

    rule: Literal["none"]


class Support3(TypedDict):
    """The log-returns between two bounds, whatever returns are seen."""

    min: float
    """The lowest log-return, at least -20."""
    max: float
    """The highest log-return, at most 20."""
    rule: Literal["between"]


Support: TypeAlias = Support1 | Support2 | Support3
"""
The log-returns that the laws in a ball may give mass to. They depend on the law, as its radius does: under
`worst_seen` they follow the returns seen so far.
"""


SurfaceAxis: TypeAlias = Literal["wealth", "deviation"]
"""A direction in which the states of a step differ, beside the mean of the record's log-returns."""


class SurfacePoint(TypedDict):
    """The wealth of a state, and the mean and standard deviation of its record's log-returns."""

    wealth: float
    """Wealth, in the currency of the initial wealth."""
    mean: float
    """Mean log-return, with the weights of learning."""
    deviation: float
    """Standard deviation of the log-returns, with the weights of learning."""


class SurrogateDiagnostics(TypedDict):
    """The figures of a fitted surrogate."""

    features: list[str]
    """Names of the inputs, in the order of the lengthscales."""
    lengthscales: list[float]
    """Lengthscales in units of each input's standard deviation over the design."""
    signal_variance: float
    """In units of the target's variance over the design."""
    noise_variance: float
    """In units of the target's variance over the design."""
    log_likelihood_per_point: float
    """Log likelihood of the scaled targets at the hyperparameters found, divided by their number."""
    leave_one_out_error: float
    """Root mean square of the leave-one-out errors of up to 500 design points, in the target's own unit."""
    jitter: float
    """Diagonal added to the covariance matrix to factorise it, relative to its diagonal."""
    search: str
    """How the maximum-likelihood search ended."""


SurrogateTarget: TypeAlias = Literal["floor_gain", "value"]
"""The quantity that the value surrogate regresses."""


class SustainableSpending(TypedDict):
    """Largest amount for every period."""

    holding: PlanRule
    """The rule that is held by: `plan` or `sixty_forty`."""
    amount: InBothWorlds
    """The amount that lasts with the certainty asked for."""


SweepRange = TypedDict(
    "SweepRange",
    {
        "from": float,
        "to": float,
        "points": int,
    },
)


class Terms(TypedDict):
    """Rate, cost and flows of the periods in which a policy is followed, and how its law is learned."""

    horizon: int
    """T, the number of periods."""
    rate_per_step: float
    """r, the simple return of the bank per step, as a fraction."""
    trading_cost: float
    """c, the trading cost, as a share of the amount traded."""
    contributions: Contributions
    """C, the money added at the end of each period; negative if it is withdrawn."""
    learning: Learning
    """Weights of older returns in the learned law."""
    ends: NotRequired[bool]
    """True if the policy plans spending to its horizon, which no renewal moves."""
    periods_per_year: NotRequired[float | None]
    """Number of periods in a year. A period reported without a date gets the next due date, found from this number."""
    means: NotRequired[MeansRule]
    """The means that the law of several assets has."""


class TextPosition(TypedDict):
    """The place of an error in the text."""

    line: int
    """Line, from 1."""
    column: int
    """Field of the line, from 1."""
    value: str
    """The value at this place, shortened if it is long."""


TradeLimit: TypeAlias = Literal["lot", "smallest", "buys_only", "cash"]
"""Why less is traded than was advised."""


class TransportedMass(TypedDict):
    """Mass of one atom and the adversary's destination for it."""

    atom: float
    """Log-return of the centre; an observed one, unless `problem.centre` says otherwise."""
    moved_to: float
    """Log-return in the worst case; equal to `atom` if the mass stays."""
    mass: float
    """The mass, a probability."""


class Uncertainty(TypedDict):
    """The figures of a state's uncertainty set."""

    sample_size: int
    """Number of returns observed, including the history."""
    effective_size: float
    """Effective sample size; equal to `sample_size` if `learning` is `equal` and the centre is not `conditional`."""
    moments: list[float]
    """Raw moments of the learned law, from the first to the specification's count."""
    quantile: NotRequired[float | None]
    """
    (1 - alpha)-quantile of the bridge statistic; absent under radius rules other than `bridge`, `calibrated` and
    `joint`. Under `bridge` it is exact for the history of the policy. After more returns it is simulated in
    proportion to that value.
    """
    radius: float
    """The radius, as in an advice."""


Unit: TypeAlias = Literal["fraction", "percent"]
"""The unit of returns."""


class UnitOrder(TypedDict):
    """An order."""

    asset: str
    side: OrderSide
    units: float
    """Units to trade, a whole number of lots."""
    price: float
    """Price of a unit, as it was sent."""
    amount: float
    """Units times price."""


class UtilityReport(TypedDict):
    """Statistics of terminal utility."""

    mean: Estimate
    """Mean over paths."""
    variance: Estimate
    """Variance over paths."""
    quantile_20: Estimate
    """Value below which a fifth of the paths end."""
    quantile_90: Estimate
    """Value below which nine tenths of the paths end."""
    max: float
    """Largest value over the paths of one history, averaged over histories; an extreme has no interval."""
    min: float
    """Smallest value over the paths of one history, averaged over histories; an extreme has no interval."""


class UtilitySpecification1(TypedDict):
    """Exponential utility, `(1 - exp(-risk_aversion x)) / risk_aversion`. Exactly one of its fields is given."""

    risk_aversion: NotRequired[float]
    """Absolute risk aversion, per unit of wealth, 1e-18 to 1e9."""
    risk_aversion_relative: NotRequired[float | None]
    """Risk aversion times initial wealth, without unit, 0.001 to 100. Completion replaces it by the absolute one."""
    kind: Literal["exponential"]


class UtilitySpecification2(TypedDict):
    """Power utility, `(x^(1 - risk_aversion) - 1) / (1 - risk_aversion)`."""

    risk_aversion: float
    """Relative risk aversion, without unit, above 1 and at most 100."""
    kind: Literal["power"]


class UtilitySpecification3(TypedDict):
    """Log utility, `ln x`."""

    kind: Literal["log"]


UtilitySpecification: TypeAlias = UtilitySpecification1 | UtilitySpecification2 | UtilitySpecification3
"""Utility of terminal wealth, always maximised."""


class WalkedPeriod(TypedDict):
    """A period that a strategy lived."""

    states: dict[str, float]
    """States before the noise, by name."""
    actions: dict[str, float]
    """Actions by name."""
    noise: float
    """The noise of the record."""
    reward: float
    """Earnings of the period by `reward`."""
    radius: NotRequired[float | None]
    """Radius of the ball of the decision, in the unit of the noise. Null for rules."""


class WalkedStrategy(TypedDict):
    """A policy, trained again and again, or a rule, on the record."""

    strategy: str
    """Name of the framework, or of the rule in the request."""
    is_rule: bool
    """True for a rule."""
    earned: float
    """Sum of the rewards, discounted to the first period lived."""
    left: float
    """Worth of the last states by `end`, or their amount by the utility, not discounted."""
    gain: Estimate
    """
    Mean gain of a period: its reward, and how much more the states are worth after it, by `end` or as the amount of the
    utility. The interval is of resamples of the periods in blocks of `every`.
    """
    difference: NotRequired[Estimate | None]
    periods: list[WalkedPeriod]
    """The periods that the strategy went through, in order."""


class WantedSpending(TypedDict):
    """An amount that is wanted in every period."""

    amount: float
    """The amount, in money of now."""
    lasts: InBothWorlds
    """
    Probability that it can be spent in every period to the horizon, holding the shares of the plan: of all that is
    left, also where the plan itself keeps a reserve.
    """


WarningCode: TypeAlias = Literal["rate_high", "rate_above_record", "record_in_percent", "trading_cost_high", "inflation_high", "tail_heavy", "lone_return", "estimated_returns", "few_alike", "jumps"]
"""Kind of a warning."""


class WealthReport(TypedDict):
    """Statistics of terminal wealth and of its course."""

    mean: Estimate
    """Mean over paths."""
    quantile_20: Estimate
    """Value below which a fifth of the paths end."""
    quantile_90: Estimate
    """Value below which nine tenths of the paths end."""
    max: float
    """Largest value over the paths of one history, averaged over histories; an extreme has no interval."""
    min: float
    """Smallest value over the paths of one history, averaged over histories; an extreme has no interval."""
    worst_twentieth: Estimate
    """The mean of the worst twentieth of the paths."""
    histogram: list[int]
    """Counts of the bins between `wealth_edges`, without the paths that end with the wealth of all in the bank."""
    at_bank: int
    """Number of paths that end with the wealth of all in the bank, to a billionth of it."""
    chance_of_loss: Estimate
    """Share of the paths that end below the initial wealth plus all contributions."""
    max_drawdown: Estimate
    """
    Mean over paths of the largest fall below the highest value so far, as a share of it. Contributions and
    withdrawals are neither gain nor fall.
    """


class WeightLimits(TypedDict):
    """
    Limits on the composition: shares of the risky holdings, which sum to 1. A greatest share then holds for shares of
    wealth too. The share in all assets together is limited by `action_interval`.
    """

    each: NotRequired[ShareRange]
    """The least and the greatest share of every asset that `assets` does not name. Default: 0 and 1."""
    assets: NotRequired[dict[str, ShareRange]]
    """The least and the greatest share of an asset, by its name."""
    groups: NotRequired[list[GroupLimit]]
    """Groups of assets with limits on the sums of their shares, at most 30. Groups may overlap."""
    max_turnover: NotRequired[float | None]
    """
    Limit on the turnover of a period, 0 to 2: the sum over the assets of the changes of shares of the risky holdings,
    from those held before trading. If the other limits need a larger turnover, the smallest one that they allow is
    made. Nothing is limited if nothing is held.
    """


class WhyNothing(TypedDict):
    """Why an advice holds nothing. For several assets, the figures are those of the inverse-volatility fund."""

    premium_seen: float
    """Mean simple return of the record beyond the bank, per step."""
    standard_error: float
    """Standard error of this premium."""
    premium_left: NotRequired[float | None]
    """
    The least mean excess return under the laws in the ball: 0 or less, unless trading costs something. Null for
    several assets, for which `worst_means` gives it asset by asset.
    """
    at_half_the_caution: NotRequired[float | None]
    """Share of wealth held within half of the radius, in all assets together; null if the radius is not simulated."""


class WithoutOne(TypedDict):
    """
    The range of the advice over the records that lack one return.

    Each distinct return is left out in turn. Fewer are left out in a record of more than 360, or if a step takes long:
    those that move the advice the most. These are the returns furthest from the mean by their weight, and others spread
    evenly by rank. Checked by: tests/solver/sensitivity.rs against leaving out every one.
    """

    lowest: LeftOut
    """The lowest advice, and the return whose absence gives it."""
    highest: LeftOut
    """The highest advice, and the return whose absence gives it."""
    tried: int
    """Number of returns left out in turn."""


class WorstLawSummary(TypedDict):
    """The figures of the worst-case law of log-returns."""

    mean: float
    """Mean per step."""
    standard_deviation: float
    """Standard deviation per square root of a step."""
    share_moved: NotRequired[float | None]
    """
    Share of the probability that moves; absent if laws are normal, because none is a transport of the observed
    returns.
    """
    lowest_destination: NotRequired[float | None]
    """Lowest log-return that mass moves to; absent if none moves."""


class WorstMean(TypedDict):
    """The mean of an asset's log-return."""

    seen: float
    """The mean of the log-returns seen."""
    believed: NotRequired[float | None]
    """The mean under the law at the centre of the ball, if `problem.means` moves it."""
    worst: float
    """The mean under the worst law."""


class WorstNormalLaw(TypedDict):
    """The worst mean and variance of the log-return of one period, within the confidence region of the estimates."""

    mean: float
    """Worst mean of the log-return, per step."""
    variance: float
    """Worst variance of the log-return, per step."""
    estimated_mean: float
    """Mean estimated from the returns, per step."""
    estimated_variance: float
    """Variance estimated from the returns, per step."""


class Advice(TypedDict):
    """The robust allocation for the coming period and its worth."""

    allocation: float
    """Share of wealth to hold in the risky asset: the nearest point of the band to the holding."""
    holding: float
    """Share of wealth in the risky asset before trading."""
    band: list[float]
    """
    The no-trade region: holdings that are best kept as they are. If trading costs nothing, both ends are the
    allocation.
    """
    trade: float
    """
    The share of wealth to buy, or to sell if negative: the allocation less the holding, of the wealth left after
    spending.
    """
    spending: NotRequired[SpendingAdvice | None]
    contribution: float
    """Money added at the end of the period, or withdrawn if negative."""
    certainty_equivalent: float
    """
    Certainty equivalent of the robust value, in terminal wealth; with spending, the sure level of spending a period,
    in money of now, that is worth as much, with what is secured.
    """
    floor: float
    """
    Terminal wealth, or with spending its sure level, if everything is sold now and stays in the bank, with all later contributions and withdrawals.
    No law can take it away.
    """
    radius: float
    """
    Radius of the uncertainty set. For the Wasserstein ball it is in log-return. In the parametric frameworks it is
    half the width of the confidence region in the mean, in estimated standard deviations of a return.
    """
    sample_size: int
    """Number of returns observed, including the history."""
    effective_size: float
    """Effective sample size; equal to `sample_size` if `learning` is `equal` and the centre is not `conditional`."""
    surrogate_sd: float
    """Predicted standard deviation of the log certainty equivalent; if spending is secured, of what exceeds it."""
    in_design: bool
    """True if the state lies within the region where the surrogates were trained."""
    source: AdviceSource
    """How the advice was computed."""


class AssetsBacktestRequest(TypedDict):
    """
    A walk-forward through a record of several assets. It compares the trained policy of a session, or the one-step
    problem, with rules that people use.
    """

    assets: list[Asset]
    """Names of the assets, 2 to 30, all different, in the order of the columns."""
    log_returns: NotRequired[list[LogReturn] | None]
    """
    Log-returns of the assets, oldest first, without gaps; each period has one value for each asset, null before the
    asset's first return. Exactly one of this and `simple_returns` is given.
    """
    simple_returns: NotRequired[list[SimpleReturn] | None]
    """Simple returns of the assets, `price / previous price - 1`, in the same layout as `log_returns`."""
    rate: Rates
    """Return of the bank per period, as a fraction from -0.5 to 0.5: one number for all periods, or one for each."""
    dates: list[str]
    """Date of each period, evenly spaced: `2008-01-31`, `2008-01` or `2008`."""
    periods_per_year: NotRequired[int | None]
    """Number of periods in a year, 1 to 366. Default: derived from `dates`."""
    strategies: NotRequired[list[StrategyFamily]]
    """
    The strategies that are compared with the rules that people use: `policy`, `one_step` or both. Default:
    `["one_step"]`, because a policy takes several times as long.
    """
    windows: NotRequired[list[Window] | None]
    """
    Numbers of most recent periods that strategies know; null stands for all periods since the first. Default: 10
    years, 20 years and all.
    """
    every: NotRequired[int | None]
    """
    Number of periods between trainings of the policy, between estimates of the radius, and between choices of the
    static strategy. Default: one year, or `horizon` if that is shorter.
    """
    horizon: NotRequired[int | None]
    """
    Number of periods that a policy looks ahead, from `every` to 520. Default: `every`. Must be absent unless
    `strategies` has `policy`.
    """
    count: NotRequired[int | None]
    """
    Number of design points per step of a policy, 10 to 10,000. Default 100. Must be absent unless `strategies` has
    `policy`.
    """
    alpha: NotRequired[float | None]
    """Miscoverage of the radius, 0.001 to 0.999: the probability that the ball misses the true law. Default 0.1."""
    support: NotRequired[Support]
    """The log-returns of each asset that the adversary may use. Default: `worst_seen`."""
    means: NotRequired[MeansRule]
    """The means that policies and the one-step problem give the assets. Default: `sample`."""
    risk_aversion: NotRequired[float]
    """Relative risk aversion, 1 to 100: log utility at 1, power utility above. Default 3."""
    trading_cost: NotRequired[float]
    """
    Trading cost, as a share of the amount traded, 0 to 0.1. Policies are trained with it; no other strategy takes it
    into account. Default 0.
    """
    limits: NotRequired[WeightLimits | None]
    weights: NotRequired[dict[str, OwnSharesVecF64]]
    """
    Strategies of your own by name, at most 10: for every period of the record the shares of wealth in the assets, in
    their order, which add up to at most 1, or a formula for the share of each asset over its returns before, such as
    `1/deviation60`; formulas that add up to more than 1 are divided by their sum. Shares of the longest window are not
    used. Given shares may use only what was known before their period: nothing here can check that.
    """
    seed: NotRequired[int]
    """Seed of all random draws. The same request and seed give the same report, bit for bit. Default 1."""


class AssetsChoices(TypedDict):
    """The choices of a walk-forward of several assets."""

    strategies: list[StrategyFamily]
    """The strategies that are compared with the rules that people use."""
    windows: list[int | None]
    """Numbers of past periods that strategies know; null means all since the first."""
    every: int
    """
    Periods from one training of the policy, one measurement of the radius, and one choice of the static strategy, to
    the next.
    """
    horizon: NotRequired[int | None]
    """Periods that a policy looks ahead; null if none is trained."""
    count: NotRequired[int | None]
    """Design points per step of a policy; null if none is trained."""
    alpha: float
    """Miscoverage of the radius."""
    support: Support
    """The log-returns of each asset that the adversary may use."""
    means: MeansRule
    """The means that policies and the one-step problem give the assets."""
    risk_aversion: float
    """Relative risk aversion."""
    trading_cost: float
    """Share of each trade that is lost."""
    limits: NotRequired[WeightLimits | None]
    seed: int
    """Seed of the bridges and of the resamples."""


class AssetsFigures(Performance):
    """The figures of one strategy."""

    strategy: str
    """Name of the strategy."""
    kind: StrategyKind
    """Kind of the strategy."""
    place: int
    """Its rank by `yearly_certainty_equivalent`, 1 for the best; equal ones share it."""
    beyond_equal: NotRequired[BootstrapEstimate | None]
    effective_assets: NotRequired[float | None]
    """`(sum a)^2 / sum a^2`, averaged over the periods in which anything is held; null if nothing ever is."""
    mean_allocations: dict[str, float]
    """Share of wealth in each asset, by its name."""


class AssetsProblem(TypedDict):
    """The investor, several assets, and what is known of their returns."""

    assets: list[Asset]
    """Names of the assets, 2 to 30, all different, in the order of the columns of `history`."""
    ground_norm: NotRequired[GroundNorm]
    """Distance that sets the adversary's cost of moving a law. Default: `scaled_one`."""
    composition: NotRequired[CompositionRule]
    """How the shares of the assets within the risky holdings are chosen, period after period. Default: `one_step`."""
    limits: NotRequired[WeightLimits | None]
    means: NotRequired[MeansRule]
    """The means of the assets under the law at the centre. Default: `sample`."""
    horizon: NotRequired[int | None]
    """
    Number of allocation decisions that a policy is trained for, 1 to 520. Default: 10 for a policy; always 1 for
    advice.
    """
    rate_per_step: float
    """Return of the bank per step, as a fraction, -0.5 to 0.5."""
    periods_per_year: NotRequired[float | None]
    """
    Number of periods of the history in a year, 1 to 366. It is used for annual figures and does not change the
    advice.
    """
    initial_wealth: NotRequired[float]
    """Initial wealth, in any currency, 1e-6 to 1e15. Default 100."""
    action_interval: NotRequired[list[ActionIntervalItem]]
    """Share of wealth that may be held in all assets together: `[0, highest]`. Default: `[0, 1]`."""
    trading_cost: NotRequired[float]
    """
    Cost of moving money between the bank and any asset, as a share of the amount moved, 0 to 0.1. Default 0. Advice
    accepts a cost under power and log utility only.
    """
    contributions: NotRequired[Contributions]
    """Money added at the end of each period, or withdrawn if negative. Default 0. Advice accepts no other value."""
    spending: NotRequired[Spending | None]
    risk_aversion: NotRequired[float | None]
    """Relative risk aversion, 1 to 100, instead of `utility`: log utility at 1, power utility above."""
    utility: NotRequired[UtilitySpecification]
    """Utility of wealth at the horizon, or of spending. Default: power utility with risk aversion 3."""
    radius: NotRequired[RadiusRule | None]
    caution: NotRequired[CautionLevel | None]
    support: NotRequired[Support | None]
    history: list[HistoryItem]
    """
    Log-returns by date, oldest first, 2 to 10,000 dates; each date has one value for each asset, null before the asset's
    first return. What such an asset would have earned then follows from the assets with longer records, by regression.
    """


class BacktestFigures(Performance):
    """The figures of one strategy."""

    strategy: str
    """Name of the strategy."""
    kind: StrategyKind
    """Kind of the strategy."""
    hindsight: bool
    """True if it was chosen with knowledge of the whole record."""
    place: NotRequired[int | None]
    """Its rank by `yearly_certainty_equivalent`, 1 for the best; equal ones share it. Null in hindsight."""
    adaptive_ahead: BootstrapEstimate
    """The certainty equivalent of the main adaptive strategy less that of this one."""
    all_bank_share: float
    """Share of the periods with nothing in the risky asset."""


class Caution(TypedDict):
    """A reason to be careful with an advice."""

    code: CautionCode
    """Code for programs."""
    sentence: str
    """Sentence for people."""


class CautionLevels(TypedDict):
    """The share of the radius at each level and its cost, found from the record."""

    premiums: list[float]
    """
    Mean simple return in excess of the bank, per step, in each of the three worlds: none, half, and the whole of a
    premium. That premium is the premium seen, or 0 if that is negative, plus its standard error.
    """
    premium_seen: float
    """Premium seen: the mean simple return of the record in excess of the bank, per step."""
    standard_error: float
    """Standard error of the premium seen."""
    bold: CautionScale
    """The level `bold`: least worst regret, with double regret in the world with the whole premium."""
    balanced: CautionScale
    """The level `balanced`: least worst regret."""
    cautious: CautionScale
    """The level `cautious`: least worst regret, with double regret in the world without a premium."""
    paper: CautionScale
    """The level `paper`: the whole radius."""


class CentreSpecification4(TypedDict):
    """
    The law of the returns seen at times like the present: a return has the weight `exp(-(d / bandwidth)^2 / 2)`, times
    that of its age, with d how far what was known before it is from what is known now, in standard deviations. Its
    radius is that of the weighted bridge. This needs the framework `static` or one period, because what will be known
    later is not part of a state.
    """

    on: Covariate
    """A figure that tells times apart."""
    bandwidth: float
    """
    Standard deviations at which a return has the weight 0.6, 0.05 to 1e15. Widened if fewer than 30 returns would
    count. Without bound the centre is that of `empirical`.
    """
    kind: Literal["conditional"]


class CentreSpecification5(TypedDict):
    """
    The law of the returns seen, mixed with an assumed law that counts as additional returns. Exactly one of `law`
    and `history` is given. With n returns seen the radius is theirs times n / (n + weight): the ball allows for
    what they may miss. The assumed law is the user's assumption, and the ball does not allow for its error.
    """

    law: NotRequired[SamplingLaw | None]
    history: NotRequired[list[HistoryItem1] | None]
    """The assumed law as log-returns of equal weight, from another market or a longer record: 2 to 20,000 values."""
    weight: float
    """Number of returns that the assumed law counts as, 0 to 1,000,000. At 0 the centre is that of `empirical`."""
    kind: Literal["mixed"]


CentreSpecification: TypeAlias = CentreSpecification1 | CentreSpecification2 | CentreSpecification3 | CentreSpecification4 | CentreSpecification5
"""The centre of the ball of laws, built from the returns seen: those of the history and those seen later."""


class Choices(TypedDict):
    """Choices about a text. A choice that is left out is inferred from the text, or asked for."""

    columns: NotRequired[list[str]]
    """A column of returns or prices, by its name or its number from 1; several columns are several assets"""
    kind: NotRequired[Kind | None]
    unit: NotRequired[Unit | None]
    rate_unit: NotRequired[RateUnit | None]
    day_first: NotRequired[bool | None]
    """If true, 01/02/2020 is the first of February; if false, the second of January"""
    newest_first: NotRequired[bool | None]
    """If true, the first row is the newest; used only if no dates are understood"""
    decimal_comma: NotRequired[bool | None]
    """If true, a comma is the decimal mark"""
    comma_parts: NotRequired[bool | None]
    """If true, a comma separates numbers; if false, it is part of a number"""
    one_record: NotRequired[bool | None]
    """If true, numbers in several columns are one record, read line by line"""
    gaps: NotRequired[bool | None]
    """If true, a record with missing periods is accepted as it is, without the rows that have no number"""
    unequal: NotRequired[bool | None]
    """If true, columns that begin later than others keep their own beginning; if false, the older rows of all are left out"""
    unusual: NotRequired[bool | None]
    """
    If true, numbers that are unusual for an asset are right: a deviation above 30 % a period or 150 % a year, a
    mean above 100 % a year beyond chance, or a return far from all others
    """
    excess: NotRequired[bool | None]
    """If true, the returns are in excess of the bank's, and the rates in its column are added"""
    latest: NotRequired[int | None]
    """Number of the latest returns to use; all of them by default"""


class ColumnFound(TypedDict):
    """A column that was found."""

    name: str
    """The heading of the column, or its number; empty if the text is one run of numbers."""
    holds: Holds
    """The contents of the column."""


class ComparedStrategy(TypedDict):
    """A policy or a rule on all paths."""

    strategy: str
    """Name in the request."""
    is_rule: bool
    """True for a rule."""
    value: Estimate
    """Mean worth of a path; with a utility, the certainty equivalent of the amount at the end."""
    difference: NotRequired[Estimate | None]
    worst_twentieth: Estimate
    """Mean worth of the worst twentieth of the paths."""
    robust_value: NotRequired[float | None]
    """Worth against the worst law, as the first decision of a policy says it. Null for rules."""
    periods: list[ComparedPeriod]
    """Means over all paths, period by period."""


class Course(TypedDict):
    """The course of a figure in both worlds: before each period, and at the end."""

    name: str
    """Name of the figure."""
    worst: list[FanPoint]
    """In the world in which every period brings the worst law."""
    record: list[FanPoint]
    """In the world in which periods are drawn from the record."""


class CoverageAtSize(TypedDict):
    """How often the ball held the true law at one sample size."""

    sample_size: int
    """Number of returns known."""
    covered: Estimate
    """Share of paths whose ball held the true law."""
    inside_first: Estimate
    """
    Share of paths whose ball lay inside the first ball of the path, `W1(F_0, F_t) + e_t <= e_0`, with F the centres
    and e the radii. If every return is allowed, this is exact, because mass may move beyond the last return. With a
    `support` a ball may lie inside without it, and the share is a lower bound.
    """


class Decide(TypedDict):
    """A state of a declared problem, and what was seen on the way to it."""

    policy: str
    """The policy."""
    period: NotRequired[int]
    """The period to decide, from 1. Default: 1."""
    state: NotRequired[dict[str, float]]
    """The states before the period, each by its name. Default in the first period: the declared start."""
    noises: NotRequired[list[float]]
    """The noises of all periods before this one, oldest first. Default: none."""
    across: NotRequired[list[InputRange]]
    """
    Ranges of one or two inputs: decides at all of their values instead. An input is a state, or the noise, which then
    was the same in every period before this one. Default: none.
    """


class Decided(TypedDict):
    """The best actions of a period, their worth, and the law that is worst for them."""

    period: int
    """The period decided, from 1."""
    actions: dict[str, float]
    """The best actions, by name."""
    several_peaks: list[str]
    """
    Actions along which the worth has several peaks, the others as advised. Many even ones were tried
    before a search around the best.
    """
    value: float
    """Worth of this period and those after it against the worst law, as of this period. With a utility its certainty equivalent."""
    radius: float
    """Radius of the ball, in the unit of the noise."""
    worst_law: list[NoiseMove]
    """The worst law of the period: where the mass of the noises seen goes, ascending. Shares add up to 1."""
    duality_gap: float
    """Value less its lower bound by duality, both of this step."""
    value_error: NotRequired[float | None]
    """
    Root mean square error of the value, as of this period, over the states of the step after. Null if the policy was
    not trained to an accuracy.
    """
    untrained_share: float
    """
    Share of the worst law's outcomes after which the next state is unlike those that the next step was trained at.
    What they are worth is then a guess.
    """


class DeclaredAdvice(Decided):
    """The robust actions of a declared problem's coming period."""

    session: str
    state: dict[str, float]
    """The states before the period, by name."""
    caution: list[Caution]
    """Points to know before you follow the advice."""


class DeclaredProblem(TypedDict):
    """
    `V_t(x, F) = max_a min_{F' in C_t(F)} E_{F'}[ reward + discount V_{t+1}(next, F + Z) ]`, and `V_T = end`. With a
    utility the value is the certainty equivalent of the amount at the end.
    """

    states: dict[str, DeclaredState]
    """States by name, 1 to 6."""
    actions: dict[str, DeclaredAction]
    """Actions by name, 1 to 3."""
    noise: Noise
    """The noise."""
    parameters: NotRequired[dict[str, float]]
    """Numbers by name, for the formulas."""
    next: dict[str, str]
    """Formula of each state after a period."""
    reward: NotRequired[str | None]
    """Formula of what a period earns. Default: nothing."""
    end: NotRequired[str | None]
    """Formula of the worth of the state at the end; absent if there is a utility, which has its own."""
    discount: NotRequired[float]
    """Factor per period on what comes after it, above 0 and at most 1. Default 1."""
    utility: NotRequired[DeclaredUtility | None]
    horizon: int
    """Number of decisions, T, 1 to 520."""
    history: list[float]
    """Noises observed before the start, oldest first."""
    framework: NotRequired[Framework]
    """The framework: `adaptive`, `static` or `plug_in`. Default: `adaptive`."""
    learning: NotRequired[Learning]
    """Weights of older noises in the learned law. Default: `equal`."""
    radius: NotRequired[RadiusRule | None]


class DeclaredRenewed(Uncertainty):
    """The session of a declared problem after a renewal."""

    session: str
    renewal: int
    policy: str
    period: int
    """The coming period, the first that the policy advises."""
    horizon: int
    """The last period that the policy advises."""
    problem: dict[str, Any]
    """The problem from here on as it was declared, but without its history."""


class DesignSpecification(TypedDict):
    """The states that the surrogates are trained on."""

    accuracy: NotRequired[float | None]
    """
    Target accuracy of the value served, in basis points of the certainty equivalent, 0.01 to 100. It bounds the
    root mean square error over the states of a step, including the errors of later steps. Design points are added
    until fresh states show that the target is reached. Default 0.5 if there is no `count`. If the state is wealth
    alone, `count` decides.
    """
    count: NotRequired[int | None]
    """
    Number of design points per step, N, 10 to 10,000; with an `accuracy`, the largest number. Default 1000, or 200
    if the state is wealth alone.
    """
    initial_laws: NotRequired[InitialLaws]
    """Starting point of the design's empirical laws. Default: `given`."""
    sampling_law: NotRequired[SamplingLaw | None]
    wealth: NotRequired[Interval | None]


class Difference(TypedDict):
    """A paired difference from the reference."""

    utility: Estimate
    """Difference of mean terminal utility."""
    certainty_equivalent: Estimate
    """Difference of certainty equivalents, in terminal wealth."""


class Doubt(TypedDict):
    """Something in a report that is probably a mistake."""

    reason: DoubtReason
    field: str
    """Dotted path of the field."""
    value: Any
    """Value of the field."""
    sentence: str
    """The doubt, in one sentence."""
    missing: NotRequired[list[str]]
    """Last days of the periods missing before the reported one, unless they are more than 120."""


class Drift(TypedDict):
    """
    A bet that the order of the returns matters. It wins if new returns lie further from the median of all than those
    before them did: their volatility or their mean has changed.
    """

    p_value: NotRequired[float | None]
    """P-value of the last return: the share of the record that lies as far from its median. Null if none was observed."""
    capital: float
    """The value of the test martingale, which starts at 1; at most 1e12."""
    highest: float
    """Its highest value so far. If nothing changes, at most a share 1 / c of sessions ever reaches c."""
    level: DriftLevel
    """Level of the highest value: `warning` from 20 on, `alarm` from 100 on."""


class FundSpecification(TypedDict):
    """
    The data of a policy for several assets, beside the problem of their fund. The shares of that fund are proportional
    to inverse volatilities.
    """

    assets: list[Asset]
    """Names of the assets, 2 to 30, all different."""
    ground_norm: GroundNorm
    """Distance that sets the adversary's cost of moving a law."""
    composition: CompositionRule
    """How the shares of the assets within the risky holdings are chosen."""
    limits: NotRequired[WeightLimits | None]
    means: NotRequired[MeansRule]
    """The means of the assets under the law at the centre. Default: `sample`."""
    radius_factor: NotRequired[float | None]
    """
    Factor on the radius of one fund, so that the laws of all funds lie in their balls at once, 1 to 100; the
    training finds it if it is left out. The scale of the problem's radius includes it. It is 1 under rules that depend
    on the sample size alone.
    """
    history: list[HistoryItem2]
    """Log-returns by date, oldest first; each date has one value for each asset, null before its first return."""


class Futures(TypedDict):
    """The futures of a policy from a state."""

    period: int
    """First period that is played, from 1."""
    paths: int
    """Number of paths of each world."""
    promised: float
    """Worth for certain against the worst laws, as the policy says it at the start."""
    stated_error: NotRequired[float | None]
    """Standard deviation that the policy states for it, as an amount; null if it states none."""
    played: Estimate
    """Worth for certain in the worst world, as these paths find it, with a 90 % interval."""
    courses: list[Course]
    """Courses of wealth, or of each state of a declared problem and of what was earned."""
    sentence: str
    """The two worlds in words."""


class JobProgress(TypedDict):
    """The progress of a job."""

    steps_done: int
    steps_total: int
    step: NotRequired[int | None]
    """Step being solved; steps are solved from the last to the first. Null in a simulation."""
    phase: NotRequired[Phase | None]
    points_done: NotRequired[int | None]
    """Design points solved, or paths simulated, in this step."""
    points_total: NotRequired[int | None]
    seconds_left: NotRequired[float | None]


class LetterRequest(TypedDict):
    """A request for a client's letter."""

    firm: NotRequired[Firm | None]
    currency: NotRequired[str | None]
    """Currency of the amounts: a code of three capital letters (ISO 4217). Default: none is named."""
    smallest_trade: NotRequired[SmallestTrade | None]
    date: NotRequired[str | None]
    """The day of the letter. Default: today, in UTC."""


class MakeLink(TypedDict):
    """A request for a link to a session's letter."""

    days: NotRequired[int]
    """Days until the link expires."""
    letter: NotRequired[LetterRequest]
    """
    Firm, currency and smallest trade of the letter, which the link keeps. It has the day on which it is read, and no
    logo.
    """


class NextReturn(TypedDict):
    """
    The effect of one more return.

    Returns are tried over the range of the record, extended by half its width on both sides, within `support` if there
    is one. 49 are evenly spaced. If an end of the action interval is advised at only one of two adjacent returns, the
    crossing is located by bisection to 1e-6. The advice need not rise with the return, because an extreme return on
    either side widens the radius. Of several crossings the one nearest to the median is reported; two crossings between
    adjacent returns are missed. Checked by: tests/solver/sensitivity.rs on a finer grid.
    """

    range: list[float]
    """The lowest and the highest log-return tried."""
    to_bank: NotRequired[ReturnAndLog | None]
    to_highest: NotRequired[ReturnAndLog | None]
    low: NextAdvice
    """Advice after a return at the 5 % quantile of the record."""
    high: NextAdvice
    """Advice after a return at the 95 % quantile of the record."""


class Now(TypedDict):
    """A period after all corrections."""

    reported: NotRequired[Report | None]
    log_return: NotRequired[float | None]
    """Null if it is missing, or after a total loss, which `notes` says."""
    notes: NotRequired[list[PeriodNote]]
    """Notes on the period: losses that the law does not learn in full, and prices that did not come."""
    assets: NotRequired[AssetsNow | None]
    advised_allocation: float
    """The allocation that would have been advised for it."""
    executed_allocation: float
    wealth: float
    """Wealth at its end."""
    holding: float
    """Share of wealth in the risky asset."""
    date: NotRequired[str | None]
    """Its last day, if it is known."""
    radius: float
    """Radius of the uncertainty set after it, in the unit of an advice's radius."""


class OneStep(TypedDict):
    """The one-step problem of several assets, by name."""

    allocation: dict[str, float]
    """Shares of wealth that are best when looking one period ahead."""
    certainty_equivalent: float
    """Lower bound on the certain wealth after the period that is worth as much as they are against the worst law."""
    bound: float
    """No allocation is worth more than this."""
    worst_means: dict[str, WorstMean]
    """The mean of each asset under the worst law."""
    caution: NotRequired[list[Caution]]
    """Warnings to read before following the allocation; left out if there are none."""


class OpenSession(TypedDict):
    """A session to open."""

    policy: str
    """The policy to use."""
    history: NotRequired[InitialHistory | None]
    wealth: NotRequired[float | None]
    """Wealth at the start. Default: the policy's initial wealth."""
    holding: NotRequired[float | None]
    """Share of wealth in the risky asset at the start. Default: 0."""
    holdings: NotRequired[dict[str, float]]
    """Share of wealth in each of several assets at the start, by name. Default: 0."""
    state: NotRequired[dict[str, float]]
    """States of a declared problem at the start, by name. Default: the problem's own start."""
    renew: NotRequired[Renewing | None]
    rolling: NotRequired[bool]
    """
    If true, the first step of a policy with decaying learning advises every period, for up to 5200 periods.
    Default: false.
    """
    name: NotRequired[str | None]
    """Name of the session, at most 100 letters."""
    notes: NotRequired[str | None]
    """Notes, at most 2,000 letters."""
    tags: NotRequired[list[Tag] | None]
    """Tags: at most 20, all different, of 1 to 50 letters each."""


class PeriodReport(TypedDict):
    """One period over all paths."""

    period: int
    """Number of the period, from 1."""
    sample_size: int
    """Number of returns known at its start."""
    allocation: Spread
    """Share of wealth held in the risky asset."""
    all_bank_share: float
    """Share of paths that held nothing in the risky asset."""
    radius: NotRequired[RadiusSpread | None]


class Problem(TypedDict):
    """The investor, several assets, and what is known of their returns."""

    assets: list[str]
    """Names of the assets, 2 to 30, all different, in the order of the columns of `history`."""
    ground_norm: NotRequired[GroundNorm]
    """Distance that sets the adversary's cost of moving a law. Default: `scaled_one`."""
    composition: NotRequired[CompositionRule]
    """How the shares of the assets within the risky holdings are chosen, period after period. Default: `one_step`."""
    limits: NotRequired[WeightLimits | None]
    means: NotRequired[MeansRule]
    """The means of the assets under the law at the centre. Default: `sample`."""
    horizon: NotRequired[int | None]
    """
    Number of allocation decisions that a policy is trained for, 1 to 520. Default: 10 for a policy; always 1 for
    advice.
    """
    rate_per_step: float
    """Return of the bank per step, as a fraction, -0.5 to 0.5."""
    periods_per_year: NotRequired[float | None]
    """
    Number of periods of the history in a year, 1 to 366. It is used for annual figures and does not change the
    advice.
    """
    initial_wealth: NotRequired[float]
    """Initial wealth, in any currency, 1e-6 to 1e15. Default 100."""
    action_interval: NotRequired[list[float]]
    """Share of wealth that may be held in all assets together: `[0, highest]`. Default: `[0, 1]`."""
    trading_cost: NotRequired[float]
    """
    Cost of moving money between the bank and any asset, as a share of the amount moved, 0 to 0.1. Default 0. Advice
    accepts a cost under power and log utility only.
    """
    contributions: NotRequired[Contributions]
    """Money added at the end of each period, or withdrawn if negative. Default 0. Advice accepts no other value."""
    spending: NotRequired[Spending | None]
    risk_aversion: NotRequired[float | None]
    """Relative risk aversion, 1 to 100, instead of `utility`: log utility at 1, power utility above."""
    utility: NotRequired[UtilitySpecification]
    """Utility of wealth at the horizon, or of spending. Default: power utility with risk aversion 3."""
    radius: NotRequired[RadiusRule | None]
    caution: NotRequired[CautionLevel | None]
    support: NotRequired[Support | None]
    history: list[list[float | None]]
    """
    Log-returns by date, oldest first, 2 to 10,000 dates; each date has one value for each asset, null before the asset's
    first return. What such an asset would have earned then follows from the assets with longer records, by regression.
    """


class PlanQuestionAssetsProblem(TypedDict):
    """A question about the years to come: how much to spend and what to hold in each period, and how likely it lasts."""

    problem: Problem
    """The investor, several assets, and what is known of their returns."""
    wanted: NotRequired[float | None]
    """An amount wanted in every period, in money of now, 1e-6 to 1e15. Default: the first amount of the plan."""
    goal: NotRequired[float | None]
    """Wealth wanted at the horizon, in money of now, 1e-6 to 1e15. Default: none."""
    saved: NotRequired[float | None]
    """
    An amount put in at the start of every period, in money of now, 1e-6 to 1e15, if the plan aims at a goal. `wanted` is
    then left out. Default: none.
    """
    aim: NotRequired[PlanAim]
    """
    The aim of the plan. Default `spending`. With `goal`, `problem.spending` says nothing but `inflation`, and
    `problem.utility` does not count.
    """
    drawdown_limit: NotRequired[float | None]
    """
    Limit on the drawdown, 0.01 to 0.99: no return of the support takes money that stays invested further below its
    highest value so far than this share. Spending is no loss. Default: none.
    """
    drawdown: NotRequired[float]
    """The drawdown at the start, 0 to 0.99 and below the limit. Default 0."""
    certainty: NotRequired[float]
    """Probability with which a sustainable amount lasts, 0.5 to 0.999. Default 0.9."""
    paths: NotRequired[int]
    """Number of simulated paths, 200 to 20,000; times the horizon at most 4,000,000. Default 4000."""
    seed: NotRequired[int]
    """Seed of the simulated bridges and paths. Default 1."""


class ProblemDocument(TypedDict):
    """A problem document (RFC 9457)."""

    type: str
    """Stable reference of the kind of problem: `/problems/<slug>`."""
    title: str
    status: int
    detail: str
    """This occurrence of the problem, in one sentence."""
    field: NotRequired[str | None]
    """The invalid field (as a dotted path), header or parameter; every problem that the client can correct names it."""
    value: NotRequired[Any]
    """Value that the field had."""
    rule: NotRequired[str | None]
    """Rule that the field must satisfy."""
    doubts: NotRequired[list[Doubt] | None]
    """Everything in a report that is probably a mistake; sent again with `confirm`, the report is recorded."""


class ProblemSpecification(TypedDict):
    """The investor, the asset, and what is known of its returns."""

    framework: NotRequired[Framework]
    """The framework: what the advice is robust against. Default: `adaptive`."""
    horizon: NotRequired[int]
    """Number of allocation decisions, T, 1 to 520. Default 10."""
    rate_per_step: float
    """
    Return of the bank per step, r, as a fraction, -0.5 to 0.5: wealth in the bank grows by the factor 1 + r. For
    example, 3 % a year is 0.00247 a month.
    """
    periods_per_year: NotRequired[float | None]
    """
    Periods of the history in a year, 1 to 366; 12 for months. Used for annual figures; it does not change the
    advice.
    """
    initial_wealth: NotRequired[float]
    """Initial wealth, x_0, in any currency, 1e-6 to 1e15. Default 100."""
    action_interval: NotRequired[list[ActionIntervalItem]]
    """Share of wealth that may be held in the risky asset: `[0, highest]`. Default: `[0, 1]`."""
    trading_cost: NotRequired[float]
    """Cost of moving money either way between bank and asset, as a share of it: 0, or 1e-9 to 0.1. Default 0."""
    contributions: NotRequired[Contributions]
    """Money added at the end of each period, or withdrawn if negative: one number, or `horizon` numbers. Default 0."""
    spending: NotRequired[Spending | None]
    risk_aversion: NotRequired[float | None]
    """Relative risk aversion, 1 to 100, instead of `utility`: log utility at 1, power utility above."""
    utility: NotRequired[UtilitySpecification]
    """Utility of terminal wealth, or of spending. Default: power utility with risk aversion 3."""
    learning: NotRequired[Learning]
    """Weights of older returns in the learned law. Default: `equal`."""
    centre: NotRequired[CentreSpecification]
    """
    Centre of the ball. Default: `empirical`. `known_law` and the parametric frameworks have no ball, so they accept
    only the default.
    """
    radius: NotRequired[RadiusRule | None]
    caution: NotRequired[CautionLevel | None]
    levels: NotRequired[CautionLevels | None]
    support: NotRequired[Support | None]
    law: NotRequired[SamplingLaw | None]
    history: list[HistoryItem3]
    """
    The log-returns observed before the start, oldest first: 2 to 20,000 values from -5 to 5, at least two of them
    distinct.
    """


class ProblemWhatIfPoint(Decided):
    """The advice of a declared problem under one hypothesis."""

    state: dict[str, float]
    """The states before the period advised, by name."""
    noise: NotRequired[float | None]
    """The noise of the hypothesis, if it has one."""
    radius_scale: NotRequired[float | None]
    """The factor on the radius in the hypothesis, if it has one."""


class ReadReturns(TypedDict):
    """A text with returns, and the choices for reading it."""

    text: str
    """The text as pasted or read from a file: at most 8 MB."""
    choices: NotRequired[Choices]
    """Empty at first, then the answers to the questions about the text."""


class Reading3(TypedDict):
    """The text is no record."""

    sentence: str
    """A sentence that says what is wrong, and where."""
    place: NotRequired[TextPosition | None]
    outcome: Literal["refused"]


class RenewalDue(TypedDict):
    """A due renewal and its progress."""

    renewal: int
    """Number of the renewal."""
    state: RenewalState
    job: NotRequired[str | None]
    """The job that trains the policy, or last did; null before there is one."""
    error: NotRequired[str | None]
    """The reason why the last job failed; null if it did not fail."""
    attempts: int
    """Jobs so far."""


class RpcFailure(TypedDict):
    """The answer to a request that has no result."""

    jsonrpc: str
    id: NotRequired[RpcId | None]
    error: RpcError


class RpcMessage(TypedDict):
    """A request, or a notification if it has no `id`."""

    jsonrpc: RpcVersion
    id: NotRequired[RpcId]
    """Identifier that the answer repeats. A notification has none."""
    method: str
    """Name of the method, such as `tools/call`."""
    params: NotRequired[dict[str, Any]]
    """Parameters of the method."""


class Sensitivity(TypedDict):
    """How close an advice is to changing."""

    without_one: NotRequired[WithoutOne | None]
    next_return: NextReturn
    """Effect of one more return."""
    premium: Premium
    """Effect of another mean, and of more returns like those in the record."""
    sentences: list[str]
    """These figures in sentences. The first says how far an unusual next return would move the advice."""


class Series(TypedDict):
    """Returns of one asset."""

    column: str
    """The name of its column; empty if the text is one run of numbers."""
    kind: Kind
    """The kind of the numbers in the column."""
    unit: NotRequired[Unit | None]
    missing: NotRequired[int]
    """The number of periods of the record before its first return."""
    log_returns: list[float]
    """Log-returns, as the service accepts them."""
    mean: float
    """Mean of the simple returns of a period."""
    deviation: float
    """Standard deviation of the simple returns of a period."""
    mean_per_year: NotRequired[float | None]
    """Mean per year, compounded: `(1 + mean)^p - 1` with p periods a year."""
    deviation_per_year: NotRequired[float | None]
    """Deviation times the square root of the periods in a year."""


class SessionEntry(Labels):
    """A session in a list."""

    session: str
    policy: str
    """The policy that advises the coming period."""
    policy_name: str
    """Name of that policy; empty if it has none."""
    periods_per_year: NotRequired[float | None]
    """Periods a year of that policy; null if it gives none."""
    period: int
    """The coming period, from 1; `horizon + 1` once completed."""
    horizon: int
    """The last period that the policy advises."""
    state: SessionStatus
    initial_wealth: NotRequired[float | None]
    """Null, as all figures of wealth, if the session lives a declared problem."""
    wealth: NotRequired[float | None]
    holding: NotRequired[float | None]
    """Share of wealth in the risky asset, before trading."""
    wealth_change: NotRequired[float | None]
    """Change of wealth in the last period; null before the first."""
    log_return: NotRequired[float | None]
    """
    Log-return of the last period, by which sessions that see one return can be compared. That of several assets is
    the return of their fund. Null if it is missing, or if an earlier period was corrected since.
    """
    log_returns: NotRequired[dict[str, float | None]]
    """Log-returns of several assets in the last period, by name. Null as `log_return` is, and after any correction."""
    date: NotRequired[str | None]
    """Last day that was reported."""
    last_report_ms: NotRequired[int | None]
    """Time of the last report or correction, in milliseconds since 1970."""
    next: NotRequired[str | None]
    """
    Last day on which the next report is not overdue, by the policy's periods a year. It is one period after the
    last day reported. If no day was reported, it counts from the day, in UTC, of the last report or of the opening.
    Null if this is not known, or the session is completed.
    """
    care: list[CareReason]
    """Reasons why the session needs care; empty if it needs none."""
    deviation: NotRequired[float | None]
    """
    Standard deviation of the log-returns learned so far; for several assets, those of their fund. Null before the
    first report, or if the policy reports fewer than two moments.
    """
    drift: DriftLevel
    """Evidence that the returns have changed."""
    created_ms: int


class SessionPage(TypedDict):
    """A page of sessions."""

    sessions: list[SessionEntry]
    damaged: list[str]
    """
    Sessions of this page whose stored data is damaged. They are not shown, and a call for one gets 500 until an
    operator has restored it.
    """
    total: NotRequired[int | None]
    """Sessions that match, over all pages; null unless `count` requests it."""
    care: NotRequired[CareCount | None]
    next: NotRequired[str | None]
    """Cursor to pass as `after` for the next page; null on the last page."""


class SleeveQuestion(TypedDict):
    """A question about the share of the capital that the record of one strategy or several supports."""

    problem: ProblemSpecification
    """
    The problem as in `POST /advise`, with a strategy for each asset. Utility is logarithmic, so `utility` and
    `risk_aversion` are left out, and so is `trading_cost`: a record is net of costs. The default of `caution` is `paper`,
    the whole radius.
    """
    record_of: NotRequired[RecordUnit]
    """The values of `problem.history`: returns of `periods` or outcomes of `trades`. Default `periods`."""
    seed: NotRequired[int]
    """Seed of the simulated bridges. Default 1."""


class SleeveQuestionAssetsProblem(TypedDict):
    """A question about the share of the capital that the record of one strategy or several supports."""

    problem: Problem
    """The investor, several assets, and what is known of their returns."""
    record_of: NotRequired[RecordUnit]
    """The values of `problem.history`: returns of `periods` or outcomes of `trades`. Default `periods`."""
    seed: NotRequired[int]
    """Seed of the simulated bridges. Default 1."""


SleeveRequest: TypeAlias = SleeveQuestion | SleeveQuestionAssetsProblem
"""A question about one strategy, or about several, which `problem.assets` names."""


class StepDiagnostics(TypedDict):
    """Diagnostics of how well a step was solved."""

    step: int
    """Periods observed before this step."""
    design_count: int
    """Design points solved."""
    all_bank_share: float
    """Share of the design points at which the robust allocation without previous holdings is zero."""
    uncertified_share: float
    """Share of the design points whose window could not be certified: mass might want to leave it."""
    duality_gap: float
    """
    Largest difference between the primal and the dual value of a robust step, in log certainty equivalent; 0 in the
    parametric frameworks, whose step has no dual.
    """
    expected_error: NotRequired[ExpectedError | None]
    value: NotRequired[SurrogateDiagnostics | None]
    policy: NotRequired[SurrogateDiagnostics | None]


class StrategyShare(TypedDict):
    """The share of one of several strategies."""

    share: float
    """Share of the capital."""
    kelly: NotRequired[float | None]
    """Its part of the Kelly share; null if that is."""
    mean: WorstMean
    """Its mean log-return in the record and under the worst law."""


class SubscriptionList(TypedDict):
    """The subscriptions of the tenant, oldest first."""

    subscriptions: list[SubscriptionState]


class SurfaceGrid(TypedDict):
    """The states of a surface."""

    step: int
    """Number of periods observed."""
    axes: list[SurfaceAxis]
    """The directions in which the states of this step differ beside the mean."""
    across: NotRequired[SurfaceAxis | None]
    columns: list[float]
    """Wealth or standard deviation of each column."""
    means: list[float]
    """Mean log-return of the whole record in each row; one row if the states of this step do not differ in it."""
    observed_means: NotRequired[list[float] | None]
    """The mean log-return since the start in each row, if all sessions start from the policy's record."""
    design: list[list[float]]
    """At most 300 design points, as the value of `across` and the mean."""
    middle: SurfacePoint
    """
    The middle of the design. Wealth stays there if no axis shows it, and so does the deviation of a record that is
    shifted as a whole.
    """
    own: SurfacePoint
    """The policy's own record and initial wealth."""


class SurrogateSpecification(TypedDict):
    """Settings of the surrogates."""

    target: NotRequired[SurrogateTarget]
    """The quantity that the value surrogate regresses. Default: `floor_gain`."""
    features: NotRequired[FeatureMap]
    """The features of a state that the surrogates use. Default: `standardized`."""
    moment_count: NotRequired[int]
    """
    Number of moments of the law among the features, 1 to 6. The parametric frameworks use at most two, because a
    normal law has no more. Default 4.
    """
    bounds: NotRequired[HyperparameterBounds]
    """Bounds of the hyperparameter search."""


class Sweep(TypedDict):
    """The swept range, exactly one."""

    holding: NotRequired[SweepRange | None]
    log_return: NotRequired[SweepRange | None]
    noise: NotRequired[SweepRange | None]
    radius: NotRequired[SweepRange | None]
    radius_scale: NotRequired[SweepRange | None]
    simple_return: NotRequired[SweepRange | None]
    wealth: NotRequired[SweepRange | None]


class TradeLeftOut(TypedDict):
    """A trade that was advised and is not, or not wholly, ordered."""

    asset: str
    amount: float
    """Money that is not traded: to buy, or to sell if negative."""
    limit: TradeLimit
    """The limit that took most of it."""


class Train(TypedDict):
    """A training: its specification, and the labels of its policy, which are no part of the specification."""

    problem: ProblemSpecification
    """Decision problem of the investor."""
    fund: NotRequired[FundSpecification | None]
    design: NotRequired[DesignSpecification]
    """States at which the surrogates are trained."""
    surrogate: NotRequired[SurrogateSpecification]
    """Construction of the surrogates."""
    seed: NotRequired[int]
    """Seed of the training: equal specifications and seeds give equal policies, bit for bit."""
    name: NotRequired[str | None]
    """Name of the policy, at most 100 letters."""
    notes: NotRequired[str | None]
    """Notes, at most 2,000 letters."""
    tags: NotRequired[list[Tag] | None]
    """Tags: at most 20, all different, of 1 to 50 letters each."""


class TrainAssets(TypedDict):
    """A training of a policy for several assets."""

    problem: AssetsProblem
    """The assets and the investor."""
    design: NotRequired[DesignSpecification]
    """States at which the surrogates are trained; the initial laws are resampled."""
    surrogate: NotRequired[SurrogateSpecification]
    """Construction of the surrogates."""
    seed: NotRequired[int]
    """Seed of the training: equal requests and seeds give equal policies, bit for bit."""
    name: NotRequired[str | None]
    """Name of the policy, at most 100 letters."""
    notes: NotRequired[str | None]
    """Notes, at most 2,000 letters."""
    tags: NotRequired[list[Tag] | None]
    """Tags: at most 20, all different, of 1 to 50 letters each."""


class TrainDeclared(TypedDict):
    """A training of a policy for a problem declared in formulas."""

    problem: DeclaredProblem
    """The declaration."""
    design: NotRequired[DeclaredDesign]
    """States at which the surrogates are trained."""
    surrogate: NotRequired[SurrogateSpecification]
    """Construction of the surrogates."""
    seed: NotRequired[int]
    """Seed of the training: equal requests and seeds give equal policies, bit for bit."""
    name: NotRequired[str | None]
    """Name of the policy, at most 100 letters."""
    notes: NotRequired[str | None]
    """Notes, at most 2,000 letters."""
    tags: NotRequired[list[Tag] | None]
    """Tags: at most 20, all different, of 1 to 50 letters each."""


TrainQuestion: TypeAlias = Train | TrainAssets | TrainDeclared
"""
A training of a policy for one asset, for several, which `problem.assets` names, or for a problem that is declared in
formulas, with `problem.states`.
"""


class Warning(TypedDict):
    """Something in a valid request that may be a mistake."""

    code: WarningCode
    """Kind of the warning."""
    field: str
    """Dotted path of the field in the request."""
    message: str
    """The value, what it means, and what the field should hold if something else was meant, in sentences."""


class WhatIf(TypedDict):
    """A hypothesis about a session. Fields left out stay as they are."""

    session: str
    wealth: NotRequired[float | None]
    """Wealth now."""
    holding: NotRequired[float | None]
    """Share of wealth in the risky asset now, before trading."""
    radius_scale: NotRequired[float | None]
    """Factor on the radius of the uncertainty set of the period advised; later periods keep their own."""
    radius: NotRequired[float | None]
    """The radius itself, in the unit of an advice's radius."""
    log_return: NotRequired[float | None]
    """Return of the coming period, through which the advised allocation is held; the advice is for the period after."""
    simple_return: NotRequired[float | None]
    """The return as `price / previous price - 1` instead."""
    holdings: NotRequired[dict[str, float]]
    """Share of wealth in each of several assets now, before trading, by name; each has one."""
    log_returns: NotRequired[dict[str, float | None]]
    """Returns of several assets in the coming period, in one of three ways; the advice is for the period after."""
    simple_returns: NotRequired[dict[str, float | None]]
    """The returns as `price / previous price - 1` instead."""
    prices: NotRequired[dict[str, float | None]]
    """Prices of several assets at the end of the coming period."""
    previous_prices: NotRequired[dict[str, float | None]]
    """Prices of several assets at its start. Default: those reported for the period before."""
    state: NotRequired[dict[str, float]]
    """States of a declared problem now, each by its name."""
    noise: NotRequired[float | None]
    """
    Noise of a declared problem's coming period, in which the advised actions are executed; the advice is for the
    period after.
    """
    explain: NotRequired[Explain | None]
    sweep: NotRequired[Sweep | None]


class WhatIfAnswer5(ProblemWhatIfPoint):
    """One point for a declared problem."""

    session: str


class WhatIfAnswer6(TypedDict):
    """One point, or the points of a sweep in its order."""

    session: str
    points: list[ProblemWhatIfPoint]


class WorstCase(TypedDict):
    """
    The law that is worst for the advised allocation: a transport of the ball's centre or, in the parametric frameworks,
    a normal law.
    """

    multiplier: float
    """Lagrange multiplier of the uncertainty set: utility lost per unit of extra radius."""
    radius_cost: float
    """
    Loss of log certainty equivalent per unit of extra radius: the slope at this radius, for this period's ball
    alone. A wider ball costs at most this slope times the extra radius. It never costs more than the whole worth of
    the advice above the floor.
    """
    transport: list[TransportedMass]
    """The transport of mass; empty in the parametric frameworks."""
    normal: NotRequired[WorstNormalLaw | None]
    duality_gap: float
    """Difference between primal and dual value, in log certainty equivalent; 0 in the parametric frameworks."""
    sentence: str
    """The worst case in one plain sentence."""


class Advise(TypedDict):
    """A request for one-period advice."""

    problem: ProblemSpecification
    """The problem as in a training. Its horizon must be 1 and may be left out."""
    wealth: NotRequired[float | None]
    """Wealth now. Default: the problem's initial wealth."""
    holding: NotRequired[float | None]
    """Share of wealth in the risky asset now, before trading. Default: 0."""
    seed: NotRequired[int]
    """Seed of the simulated bridges."""
    sensitivity: NotRequired[bool]
    """If true, say how near the advice is to changing."""


class AdviseAssets(TypedDict):
    """A request for one-period advice on several assets."""

    problem: AssetsProblem
    """The assets and the investor."""
    wealth: NotRequired[float | None]
    """Wealth now. Default: the problem's initial wealth."""
    holdings: NotRequired[dict[str, float]]
    """Share of wealth in each asset now, before trading, by its name. Default: 0 for each."""
    seed: NotRequired[int]
    """Seed of the simulated bridges."""


AdviseQuestion: TypeAlias = Advise | AdviseAssets
"""A request about one asset, or about several, which `problem.assets` names."""


class Advised(Advice):
    """The advice, and the law that is worst for it."""

    worst_case: WorstCase
    caution: list[Caution]
    """Points to know before following the advice."""
    levels: NotRequired[LevelsAdvised | None]
    why_nothing: NotRequired[WhyNothing | None]
    sensitivity: NotRequired[Sensitivity | None]
    annualised: NotRequired[Annualised | None]
    warnings: list[Warning]
    """Parts of the request that may be a mistake."""


class Answer(TypedDict):
    """One answer to a question."""

    label: str
    """The answer in words."""
    choices: Choices
    """The choices to add to `choices`."""
    sentence: NotRequired[str | None]
    """The record that this answer would give, in a sentence, if it gives one."""


class AssetAction(Advice):
    """The robust allocation of one asset for the coming period."""

    session: str
    period: int
    worst_case: NotRequired[WorstCase | None]
    caution: list[Caution]
    """Points to know before you follow the advice."""
    sensitivity: NotRequired[Sensitivity | None]


class AssetsAdvice(TypedDict):
    """The allocation over several assets through the coming period."""

    allocation: dict[str, float]
    """Share of wealth in each asset; the rest is in the bank."""
    trade: dict[str, float]
    """The allocation less the holdings: shares of wealth to buy, or to sell if negative."""
    composition: dict[str, float]
    """Share of each asset in the holdings advised; if these are next to nothing, the shares by inverse volatility."""
    total: float
    """Share of wealth in all assets together."""
    without_crash: NotRequired[float | None]
    """
    `total` if no log-return could fall below the lowest seen of any asset. Its excess over `total` is the part of
    the caution against a crash that nobody has seen. Null if `problem.support` rules one out already.
    """
    certainty_equivalent: float
    """
    Lower bound on the certain wealth that is worth as much as the allocation against the worst law, less trading
    costs.
    """
    bound: float
    """No allocation is worth more than this."""
    floor: float
    """Wealth from selling everything now and staying in the bank."""
    radius: float
    """Radius of the ball, in log-return."""
    radius_factor: float
    """
    Factor by which the radius of the fund of inverse volatilities is widened to hold for all funds at once. The
    search for it may end too low: by little if assets move together, by more than a tenth for a dozen that are
    independent.
    """
    levels: NotRequired[LevelsAdvised | None]
    sample_size: int
    """Number of dates seen."""
    worst_means: dict[str, WorstMean]
    """The mean of each asset under the law behind `bound`, which is the worst law if the two bounds meet."""
    caution: list[Caution]
    """Warnings to read before following the advice."""


class AssetsAdvised(AssetsAdvice):
    """The advice on several assets."""

    why_nothing: NotRequired[WhyNothing | None]
    annualised: NotRequired[Annualised | None]
    warnings: list[Warning]
    """Parts of the request that may be a mistake."""


class AssetsBacktestReport(TypedDict):
    """Strategies compared over a record of several assets. The same record and choices give the same report, bit for bit."""

    format: str
    """`ballast-backtest-assets-1`."""
    assets: list[str]
    """Names of the assets, in the order of the columns."""
    frequency: str
    """`daily`, `weekly`, `monthly`, `quarterly` or `yearly`."""
    periods_per_year: int
    """Periods in a year."""
    dates: list[str]
    """Dates of the periods that were decided."""
    whole_years: int
    """Whole years that were decided, over which mean utility is taken; the last ends with the last period."""
    uncounted_periods: int
    """Number of periods before the first whole year, fewer than a year; they count in no year."""
    choices: AssetsChoices
    """The completed choices."""
    intervals: BacktestIntervals
    """How the intervals were made."""
    strategies: list[AssetsFigures]
    """The figures of each strategy."""
    periods: list[AssetsPeriods]
    """The decisions and results of each strategy, in the same order."""
    sentences: list[str]
    """The findings in sentences, the most important first."""


class BacktestChoices(TypedDict):
    """The choices of a walk-forward."""

    window: int
    """Periods of history that each policy was trained on."""
    every: int
    """Periods from one training to the next."""
    horizon: int
    """Periods that a policy looked ahead."""
    alpha: list[float]
    """Miscoverage levels of the adaptive strategies."""
    scale: float
    """Multiple of the radius of every ball."""
    caution: CautionLevel
    """Share of every radius that was used."""
    support: Support
    """The log-returns that the adversary could use."""
    centre: CentreSpecification
    """Centre of the balls."""
    risk_aversion: float
    """Relative risk aversion."""
    trading_cost: float
    """Share of each trade that is lost."""
    cost_blind: bool
    """True if every policy was trained as if trading were free."""
    count: int
    """Design points per step."""
    seed: int
    """Seed of every training, and of the resamples."""


class BacktestReport(TypedDict):
    """Strategies compared over a record of returns. The same request gives the same report, bit for bit."""

    format: str
    """`ballast-backtest-1`."""
    frequency: NotRequired[str | None]
    """`daily`, `weekly`, `monthly`, `quarterly` or `yearly`; null if the periods have no dates."""
    periods_per_year: int
    """Periods in a year."""
    dates: NotRequired[list[str] | None]
    """Dates of the periods that were decided, those after the first window; null if the periods have none."""
    whole_years: int
    """Whole years that were decided, over which mean utility is taken; the last ends with the last period."""
    uncounted_periods: int
    """Number of periods before the first whole year, fewer than a year; they count in no year."""
    choices: BacktestChoices
    """The completed choices."""
    intervals: BacktestIntervals
    """How the intervals were made."""
    strategies: list[BacktestFigures]
    """The figures of each strategy."""
    periods: list[BacktestPeriods]
    """The decisions and results of each strategy, in the same order."""
    sentences: list[str]
    """The findings in sentences, the most important first."""


class BacktestRequest(TypedDict):
    """
    A walk-forward through a record of returns. At regular intervals, policies are trained on the preceding window and
    followed until the next training.
    """

    log_returns: NotRequired[list[LogReturn1] | None]
    """
    Log-returns of the risky asset, oldest first, without gaps: 3 to 20,000 values from -5 to 5. Exactly one of this
    and `simple_returns` is given.
    """
    simple_returns: NotRequired[list[SimpleReturn1] | None]
    """Simple returns of the risky asset, `price / previous price - 1`, oldest first, without gaps."""
    rate: Rates
    """Return of the bank per period, as a fraction from -0.5 to 0.5: one number for all periods, or one for each."""
    dates: NotRequired[list[str] | None]
    """
    Date of each period, evenly spaced: `2008-01-31`, `2008-01` or `2008`. The dates determine the number of periods
    in a year.
    """
    periods_per_year: NotRequired[int | None]
    """Number of periods in a year, 1 to 366. Default: derived from `dates`; required without them."""
    window: NotRequired[int | None]
    """
    Number of periods of history that each policy is trained on, 2 to 20,000. Default: 20 years, or half of the
    record if 20 years would leave less than a year after them.
    """
    every: NotRequired[int | None]
    """
    Number of periods from one training to the next, at most `horizon`. Default: one year, or `horizon` if that is
    shorter.
    """
    horizon: NotRequired[int | None]
    """Number of periods that a policy looks ahead, 1 to 520. Default: `every`."""
    alpha: NotRequired[list[AlphaItem]]
    """
    Miscoverages of the adaptive strategies: 1 to 3 different numbers from 0.001 to 0.999. The static strategy uses
    the second, or the only one. Default: 0.05, 0.1 and 0.5.
    """
    scale: NotRequired[float]
    """Factor on the radius of every ball. Default 1."""
    caution: NotRequired[CautionLevel]
    """Share of every radius that is used. A named level is found again for every training. Default: `paper`."""
    support: NotRequired[Support]
    """The log-returns that the adversary may use. Default: `none`, which allows all."""
    centre: NotRequired[CentreSpecification]
    """Centre of the balls. The strategy “Trusts the record” takes it as the true law. Default: `empirical`."""
    risk_aversion: NotRequired[float]
    """Relative risk aversion, 1 to 100: log utility at 1, power utility above. Default 3."""
    trading_cost: NotRequired[float]
    """Trading cost, as a share of the amount traded, 0 to 0.1. Policies are trained with it. Default 0."""
    cost_blind: NotRequired[bool]
    """If true, every policy is trained as if trading were free. Default false."""
    weights: NotRequired[dict[str, OwnSharesF64]]
    """
    Strategies of your own by name, at most 10: the share of wealth that each holds in every period of the record,
    0 to 1, or a formula for it over the returns before, such as `if(mean12 > bank, 1, 0)`. Shares of the first window
    are not used. Given shares may use only what was known before their period: nothing here can check that.
    """
    count: NotRequired[int]
    """Number of design points per step, 10 to 10,000. Default 100."""
    seed: NotRequired[int]
    """Seed of all random draws. The same request and seed give the same report, bit for bit. Default 1."""


class Composition(TypedDict):
    """Several assets before the coming period, by name."""

    composition: dict[str, float]
    """Share of each asset in the advised holdings; they sum to 1."""
    holdings: dict[str, float]
    """Share of wealth in each asset, before trading."""
    leaving: NotRequired[dict[str, float]]
    """Share of wealth in assets that left the session, to be sold before the coming period."""
    one_step: NotRequired[OneStep | None]


class Corrected(Uncertainty):
    """The session of an investor after a correction."""

    session: str
    correction: int
    period: int
    """The period corrected, inserted or removed."""
    log_return: NotRequired[float | None]
    """Its log-return now; null if it is missing, removed or a total loss."""
    observed: int
    """Periods observed now."""
    wealth: float
    """Wealth now."""
    holding: float
    """Share of wealth in the risky asset."""
    assets: NotRequired[Composition | None]
    wealth_change: float
    """Change of wealth over the last observed period, after the correction."""
    date: NotRequired[str | None]
    """The last day of the last period, if it is known."""
    drift: Drift
    """The test of whether the corrected returns still come from the same law."""


class Correction(Correct):
    """One correction, as it was made."""

    answer: Corrected
    """The answer to it."""
    corrected_ms: int


class Coverage(TypedDict):
    """How often the ball held the true law."""

    target: NotRequired[float | None]
    """Target coverage `1 - alpha`, if the radius rule has an alpha. Under `joint` it is for all balls of a path together."""
    by_sample_size: list[CoverageAtSize]
    """Coverage by ascending sample size; one entry if the ball is frozen."""
    ever_left: Estimate
    """Share of paths on which some period's ball did not hold the true law."""


class DecideAnswer(Decided):
    """The actions of a period."""

    policy: str


DecideReply: TypeAlias = DecideAnswer | PolicyMap
"""The answer to a decision: at a state, or over ranges of inputs."""


class DeclaredBacktest(TypedDict):
    """
    A walk-forward of a declared problem through a record of noises. At regular intervals a policy is trained on the noises
    before, from the states that it led to, and followed until the next training, as a session that renews itself does.
    """

    problem: DeclaredProblem
    """The declaration. Its `history` is the whole record, oldest first; after the first window it is lived period by period."""
    design: NotRequired[DeclaredDesign]
    """States that the surrogates are trained on."""
    surrogate: NotRequired[SurrogateSpecification]
    """Settings of the surrogates."""
    seed: NotRequired[int]
    """Seed of all random draws. The same request and seed give the same report, bit for bit. Default 1."""
    window: NotRequired[int | None]
    """Number of noises that each policy is trained on, at least 2. Default: half of the record."""
    every: NotRequired[int | None]
    """Number of periods from one training to the next, at most the horizon. Default: the horizon."""
    frameworks: NotRequired[list[Framework]]
    """
    Frameworks whose policies are followed: `adaptive`, `static` and `plug_in`. The first is the one that others are
    compared with. Default: the framework of `problem`.
    """
    rules: NotRequired[dict[str, dict[str, str]]]
    """
    Rules by names of your own, at most 20: for each action a formula of the states, the parameters, `t`, which begins anew
    with each training, and `T`. An action is moved into its bounds, or to the nearest of its values.
    """
    level: NotRequired[float]
    """Confidence of the intervals, 0.5 to 0.999. Default 0.95."""


class DeclaredComparison(TypedDict):
    """
    A comparison of policies of one declared problem, and of rules, on common noises drawn from the record. Policies are
    trained here, or were trained before.
    """

    problem: NotRequired[DeclaredProblem | None]
    frameworks: NotRequired[list[Framework]]
    """
    Frameworks for which a policy of `problem` is trained: `adaptive`, `static`, `plug_in` and `known_law`, which takes the
    law of the record as true. Default: the framework of `problem`.
    """
    design: NotRequired[DeclaredDesign | None]
    surrogate: NotRequired[SurrogateSpecification | None]
    policies: NotRequired[dict[str, str]]
    """
    Trained policies by names of your own; with the frameworks 1 to 8. Their declarations may differ in `framework`, `radius`
    and `learning`. Others are compared with the first by name, or without policies with the first framework.
    """
    rules: NotRequired[dict[str, dict[str, str]]]
    """
    Rules by names of your own, at most 20: for each action a formula of the states, the parameters, `t` and `T`. An action
    is moved into its bounds, or to the nearest of its values.
    """
    paths: NotRequired[int]
    """Number of simulated paths, 100 to 100,000. Default 1000."""
    seed: NotRequired[int]
    """Seed of all random draws. Default 1."""
    level: NotRequired[float]
    """Confidence of the intervals, 0.5 to 0.999. Default 0.95."""


class DeclaredCorrected(Uncertainty):
    """The session of a declared problem after a correction."""

    session: str
    correction: int
    period: int
    """The period corrected, inserted or removed."""
    noise: NotRequired[float | None]
    """Its noise now; null if it is missing or removed."""
    observed: int
    """Periods observed now."""
    earned: float
    """Rewards since the start of the session, discounted to it."""
    state: dict[str, float]
    """The states now, by name."""
    date: NotRequired[str | None]
    """The last day of the last period, if it is known."""
    drift: Drift
    """The test of whether the corrected noises still come from the same law."""


class DeclaredCorrection(Correct):
    """One correction of a declared problem's session, as it was made."""

    answer: DeclaredCorrected
    """The answer to it."""
    corrected_ms: int


class DeclaredObserved(Uncertainty):
    """The session of a declared problem after an observation."""

    session: str
    period: int
    noise: NotRequired[float | None]
    """Null if it is missing."""
    advised: NotRequired[dict[str, float]]
    """
    The actions advised for the period, by name. Null if none were: from the states before it an action that the solver
    tries may lead out of a range.
    """
    executed: dict[str, float]
    """The actions executed in it, by name."""
    reward: NotRequired[float | None]
    """The reward of the period by the problem's formula; null if the noise is missing or the formula gives no number."""
    earned: float
    """Rewards since the start of the session, discounted to it."""
    state: dict[str, float]
    """The states after the period, by name."""
    date: NotRequired[str | None]
    """
    The last day of the period: the one reported, or else the next one due by the calendar. If that is unknown too,
    it is the last day known of an earlier period.
    """
    completed: bool
    """True if the horizon is reached."""
    drift: Drift
    """The test of whether noises still come from the same law."""


class DeclaredRenewal(DeclaredRenewed):
    """One renewal of a declared problem's session, as it was made."""

    renewed_ms: int


class DeclaredSpecification(TypedDict):
    """A declared problem, with the settings of its training."""

    problem: DeclaredProblem
    """The problem."""
    design: NotRequired[DeclaredDesign]
    """States that the surrogates are trained on."""
    surrogate: NotRequired[SurrogateSpecification]
    """Settings of the surrogates."""
    seed: NotRequired[int]
    """Seed of all random draws."""


class DeclaredWalkReport(TypedDict):
    """Policies and rules that lived the same record, policies first."""

    format: str
    """`ballast-declared-walk-1`."""
    request: DeclaredBacktest
    """The request, with every default filled in."""
    strategies: list[WalkedStrategy]
    """One for each framework and each rule."""


class EvaluationRequest(TypedDict):
    """A comparison of strategies on common simulated returns."""

    problem: ProblemSpecification
    """
    The problem, as in a training, but `framework` is left out. `law` is the true law that returns are drawn from;
    default: the design's sampling law. `caution` is `paper` and `support` is `none` by default.
    """
    design: NotRequired[DesignSpecification]
    """States that the surrogates are trained on, as in a training."""
    surrogate: NotRequired[SurrogateSpecification]
    """Settings of the surrogates, as in a training."""
    seed: NotRequired[int]
    """Seed of all random draws. The same request and seed give the same report, except for its `costs`. Default 1."""
    frameworks: NotRequired[list[Framework]]
    """Frameworks to compare. Default: all six."""
    constant_mixes: NotRequired[list[ConstantMix] | None]
    """
    Constant allocations to compare, as shares of wealth, at most 101; 0 is All in the bank. Default: 0 to 1 in
    steps of 0.1, up to the highest action.
    """
    weights: NotRequired[dict[str, str]]
    """
    Strategies of your own by name, at most 10: a formula for the share of wealth over the returns before each period,
    the history's and the path's, such as `if(mean12 > bank, 1, 0)`. Default: none.
    """
    policies: NotRequired[dict[str, str]]
    """Trained policies to use, by framework. Policies for the other frameworks are trained inside the job."""
    paths: NotRequired[int]
    """Number of simulated paths for each initial history, 100 to 100,000. Default 1000."""
    histories: NotRequired[InitialHistories]
    """Histories that paths start from. Default: `given`."""
    level: NotRequired[float]
    """Confidence of the intervals, 0.5 to 0.999. Default 0.95."""


FrontierProblem: TypeAlias = ProblemSpecification | AssetsProblem
"""The problem of one asset, or of several assets if it has the field `assets`."""


class FrontierRequest(TypedDict):
    """A request for a frontier of caution: a record, an investor, and the radii to try."""

    problem: FrontierProblem
    """The problem of one asset, as in `/advise`, or of several assets. Its history holds 12 to 5000 periods."""
    scales: NotRequired[list[Scale]]
    """
    Multiples of the rule's radius to try, ascending: 1 to 20 numbers from 0 to 10. At 0 the record is taken as the
    true law. Default: 0, 0.1, 0.25, 0.5 and 1.
    """
    resamples: NotRequired[int | None]
    """
    Number of resampled records of each kind, 20 to 2000. Default: 400 for one asset, and 60 for several, whose
    steps take longer.
    """
    block: NotRequired[int | None]
    """
    Number of consecutive periods that are drawn together, from 1 to half of the record. Default: the cube root of
    the record's length.
    """
    seed: NotRequired[int]
    """Seed of the resampled records and of the simulated bridges. Default 1."""


class FundAdvice(Composition):
    """The holdings of several assets to keep through a period, by a policy of their fund."""

    allocation: dict[str, float]
    """Share of wealth to hold in each asset; the rest is in the bank."""
    total: float
    """Share of wealth in all assets together."""
    trade: dict[str, float]
    """Shares of wealth to buy, or to sell if negative: the allocation, of the wealth left after spending, less the holdings."""
    band: list[float]
    """The totals that are best kept as they are. If trading costs nothing, both ends are the total."""
    spending: NotRequired[SpendingAdvice | None]
    contribution: float
    """Money added at the end of the period; negative if withdrawn."""
    certainty_equivalent: float
    """
    Certainty equivalent, in terminal wealth or with spending in its sure level, of keeping this composition. A later
    composition never promises less.
    """
    floor: float
    """Terminal wealth, or with spending its sure level, from selling everything now and staying in the bank."""
    radius: float
    """Radius of the ball around the law of the fund, in log-return."""
    sample_size: int
    """Dates observed, including those of the history."""
    surrogate_sd: float
    """Predicted standard deviation of the log certainty equivalent."""
    in_design: bool
    """True if the state of the fund lies in the region where the surrogates were trained."""
    source: AdviceSource
    """How the total was found."""


class Job(TypedDict):
    """A job."""

    job: str
    kind: JobKind
    state: JobState
    cancel_requested: bool
    """True if a cancel was requested; the worker stops within a second."""
    progress: JobProgress
    policy: NotRequired[str | None]
    """Policy of a succeeded training."""
    report: NotRequired[str | None]
    """Address of the report of a succeeded evaluation, walk-forward backtest or frontier."""
    error: NotRequired[str | None]
    """Reason for the failure."""
    created_ms: int
    started_ms: NotRequired[int | None]
    finished_ms: NotRequired[int | None]


class JobPage(TypedDict):
    """A page of jobs, newest first."""

    jobs: list[Job]
    next: NotRequired[int | None]
    """Cursor to pass as `after` for the next page; null on the last page."""


class ObservedAssets(Composition):
    """A period of several assets, by name."""

    log_returns: NotRequired[dict[str, float | None]]
    """
    Null if they are missing. Null for an asset whose price did not come, or that lost everything, which `notes`
    says.
    """
    advised_allocations: dict[str, float]
    """Advised share of wealth in each asset."""
    executed_allocations: dict[str, float]
    """Executed share of wealth in each asset."""


class OrdersAnswer(TypedDict):
    """The orders, and how things stand after them."""

    session: str
    period: int
    """The period that the advice is for."""
    wealth: float
    """Worth of units and cash together, before spending."""
    spending: float
    """Spending that is advised; it is taken from the cash."""
    orders: list[UnitOrder]
    """Sales first, each in the order of the assets."""
    left_out: list[TradeLeftOut]
    """Trades left out, in the order of the assets."""
    cash: float
    """Cash after spending, all orders and their cost; negative only if spending exceeds it and nothing could be sold."""
    cost: float
    """Cost of all orders."""
    shares: dict[str, float]
    """Share of each asset in what is left after them, by name."""
    advised: dict[str, float]
    """Share of each asset that is advised, by name."""


class PlanQuestion(TypedDict):
    """A question about the years to come: how much to spend and what to hold in each period, and how likely it lasts."""

    problem: ProblemSpecification
    """
    The problem as in a training, of one asset or several. Its horizon is that of the plan, and `spending` may be left
    out. The plan keeps to the ball of the record: `framework` is `static` or left out. Several assets are held in the
    composition that is best for one period, which is restored in each.
    """
    wanted: NotRequired[float | None]
    """An amount wanted in every period, in money of now, 1e-6 to 1e15. Default: the first amount of the plan."""
    goal: NotRequired[float | None]
    """Wealth wanted at the horizon, in money of now, 1e-6 to 1e15. Default: none."""
    saved: NotRequired[float | None]
    """
    An amount put in at the start of every period, in money of now, 1e-6 to 1e15, if the plan aims at a goal. `wanted` is
    then left out. Default: none.
    """
    aim: NotRequired[PlanAim]
    """
    The aim of the plan. Default `spending`. With `goal`, `problem.spending` says nothing but `inflation`, and
    `problem.utility` does not count.
    """
    drawdown_limit: NotRequired[float | None]
    """
    Limit on the drawdown, 0.01 to 0.99: no return of the support takes money that stays invested further below its
    highest value so far than this share. Spending is no loss. Default: none.
    """
    drawdown: NotRequired[float]
    """The drawdown at the start, 0 to 0.99 and below the limit. Default 0."""
    certainty: NotRequired[float]
    """Probability with which a sustainable amount lasts, 0.5 to 0.999. Default 0.9."""
    paths: NotRequired[int]
    """Number of simulated paths, 200 to 20,000; times the horizon at most 4,000,000. Default 4000."""
    seed: NotRequired[int]
    """Seed of the simulated bridges and paths. Default 1."""


class PlanReport(TypedDict):
    """A plan and how it fares. Amounts are in money of now. Figures of simulated paths have intervals at 95 %."""

    sentences: list[str]
    """The answer in sentences, the most important first."""
    advice: Advice
    """Spending now, and the holding until the next period."""
    composition: NotRequired[dict[str, float]]
    """Shares of several assets in what is held, by name, restored in each period; left out for one asset."""
    worst_case: NotRequired[WorstCase | None]
    periods: list[PlannedPeriod]
    """Spending and holding of each period; empty if they depend on more than the period."""
    states: NotRequired[PlannedStates | None]
    wanted: WantedSpending
    """The chance that the amount wanted lasts."""
    sustainable: list[SustainableSpending]
    """
    The largest amounts that can be spent in every period to the horizon, and leave nothing; none if the plan aims at a
    goal.
    """
    strategies: list[PlanStrategy]
    """The plan beside simple rules, on the same paths. Rules of a year need `problem.periods_per_year`."""
    fan: PlanFan
    """Wealth and spending of the plan on these paths."""
    breaking: NotRequired[BreakingReturn | None]
    annualised: NotRequired[Annualised | None]
    warnings: list[Warning]
    """Parts of the request that may be a mistake."""


class Question(TypedDict):
    """A question about something that the text leaves open."""

    asks: str
    """The choice that the question asks for, by its name in `choices`."""
    question: str
    """The question in words."""
    options: list[Answer]
    """The possible answers; each of them settles the question."""


class Reading2(TypedDict):
    """The text may be several records."""

    questions: list[Question]
    """The questions whose answers decide which record it is."""
    columns: list[ColumnFound]
    """The columns, if they are known."""
    outcome: Literal["asked"]


class Record(TypedDict):
    """Returns of one asset or several, oldest first."""

    sentence: str
    """A sentence about the record, for a person to check."""
    columns: list[ColumnFound]
    """All columns of the text."""
    series: list[Series]
    """The columns that were read. They end together, and one may begin later."""
    count: int
    """The number of returns in the text; the series hold fewer if `latest` limits them."""
    dates: NotRequired[list[str] | None]
    """The end of each period in ISO 8601, to the precision of the frequency; absent if no dates were understood."""
    frequency: NotRequired[str | None]
    """`daily`, `weekly`, `monthly`, `quarterly` or `yearly`, if the dates show it."""
    periods_per_year: NotRequired[int | None]
    """Periods in a year, if the dates show it."""
    newest_first: bool
    """
    True if the first row was the newest, so that the rows were reversed. The dates decide this, or the choice
    `newest_first` if there are no dates.
    """
    rate: NotRequired[BankRate | None]
    remarks: list[str]
    """Sentences about anything that was changed or left out; `sentence` ends with them."""


class Renewed(Uncertainty):
    """The session after a renewal."""

    session: str
    renewal: int
    policy: str
    period: int
    """The coming period, the first that the policy advises."""
    horizon: int
    """The last period that the policy advises."""
    terms: Terms
    """Rate, cost and flows of its periods, unless a report gives others."""
    names: NotRequired[list[str] | None]
    """Names of the assets from here on, in the order of the policy, if they changed."""
    assets: NotRequired[Composition | None]


class Session(Labels):
    """A live session: an investor's, or one of a declared problem."""

    session: str
    policy: str
    """The policy that advises the coming period."""
    period: int
    """The coming period, from 1; `horizon + 1` once completed."""
    horizon: int
    """The last period that the policy advises."""
    state: SessionStatus
    date: NotRequired[str | None]
    """
    Last day of the last period: as reported, and otherwise the next one due after the periods before it. Null if no
    day is known.
    """
    next: NotRequired[str | None]
    """
    Last day of the coming period, by the policy's periods a year, and otherwise by the days reported. A report
    without a day gets this day. Null if this is not known, or the session is completed.
    """
    wealth: NotRequired[float | None]
    """Null if the session lives a declared problem."""
    holding: NotRequired[float | None]
    """
    Share of wealth in the risky asset, before trading; for several assets, the share in all of them. Null if the
    session lives a declared problem.
    """
    states: NotRequired[dict[str, float]]
    """States of a declared problem before the coming period, by name."""
    earned: NotRequired[float | None]
    """Rewards of a declared problem since the start of the session, discounted to it."""
    assets: NotRequired[Composition | None]
    sample_size: int
    corrections: int
    """Number of corrections; the next one has this number plus one."""
    renewals: int
    """Number of policies that followed the first; the next renewal has this number plus one."""
    renew: NotRequired[Renewing | None]
    rolling: bool
    """True if the first step of the policy advises every period."""
    renewal: NotRequired[RenewalDue | None]
    drift: Drift
    """Evidence that the returns have changed."""
    created_ms: int


class SleeveReport(TypedDict):
    """The share of the capital that a record supports, beside the Kelly share, which takes the record as the truth."""

    sentences: list[str]
    """The answer in sentences, the most important first; the last ones say what would refute it."""
    share: float
    """Share of the capital, in all strategies together: the allocation of `POST /advise` under log utility."""
    kelly: NotRequired[float | None]
    """
    The Kelly share of the record, in all strategies together: the share of the fastest growth if the record is the truth
    and money is borrowed at the bank's rate. It may exceed 1. Null if growth has no maximum, or none is found.
    """
    fraction: NotRequired[float | None]
    """The share over the Kelly share; null if the latter is null or 0."""
    strategies: NotRequired[dict[str, StrategyShare]]
    """The shares of several strategies, by name; left out for one."""
    growth: SleeveGrowth
    """Growth of the capital a period or trade."""
    growth_a_year: NotRequired[SleeveGrowth | None]
    record: NotRequired[ReturnMoments | None]
    worst: NotRequired[ReturnMoments | None]
    refutation: NotRequired[Refutation | None]
    worst_case: NotRequired[WorstCase | None]
    radius: float
    """Radius of the ball, in log-return."""
    sample_size: int
    """Number of periods or trades in the record."""
    caution: list[Caution]
    """Warnings to read before following the answer."""
    warnings: list[Warning]
    """Parts of the request that may be a mistake."""


class Specification(TypedDict):
    """A complete training job."""

    problem: ProblemSpecification
    """The investor, the asset and the history. For several assets, the asset is their fund."""
    fund: NotRequired[FundSpecification | None]
    design: NotRequired[DesignSpecification]
    """States that the surrogates are trained on."""
    surrogate: NotRequired[SurrogateSpecification]
    """Settings of the surrogates."""
    seed: NotRequired[int]
    """Seed of all random draws. The same specification and seed give the same policy, bit for bit. Default 1."""


class StrategyReport(TypedDict):
    """The results of one strategy."""

    strategy: str
    """Its name: `Cautious, learns`, `50 % in stocks`, `All in the bank` and the like."""
    framework: NotRequired[Framework | None]
    constant_mix: NotRequired[float | None]
    """The allocation of a constant mix; null for others."""
    policy: NotRequired[str | None]
    """The policy followed; null for strategies without one, and if each history had its own."""
    utility: UtilityReport
    """
    Utility of terminal wealth, measured from `floor`: `(U(x) - U(floor)) / (floor U'(floor))`. This form loses no
    digits at high risk aversion or wealth.
    """
    certainty_equivalent: Estimate
    """Certainty equivalent of terminal wealth."""
    wealth: WealthReport
    """Terminal wealth in the currency of the initial wealth, and its course on the way."""
    difference: NotRequired[Difference | None]
    own_mix: NotRequired[OwnMix | None]
    histogram: list[int]
    """Counts of the bins between `histogram_edges`."""
    periods: NotRequired[list[PeriodReport] | None]
    """Results period by period; null for constant mixes."""
    coverage: NotRequired[Coverage | None]
    resolved_share: NotRequired[float | None]
    """Share of steps whose advice was solved anew."""


class Surface(SurfaceGrid):
    """The allocations of a policy over states that differ in two directions."""

    allocations: list[list[float]]
    """
    Share of wealth to hold from nothing held, by row and then column. Outside the design a session would solve the
    step instead.
    """
    in_design: list[list[bool]]
    """True where the surrogates were trained, by row and then column."""
    advice: Advice
    """The advice for the policy's own record and initial wealth."""


class WhatIfPoint(Advice):
    """The advice under one hypothesis."""

    period: int
    """The period advised."""
    wealth: float
    """Wealth at its start."""
    log_return: NotRequired[float | None]
    """The return of the hypothesis, if it has one."""
    radius_scale: NotRequired[float | None]
    """The factor on the radius in the hypothesis, if it has one."""
    gamma: NotRequired[float | None]
    """Lagrange multiplier of the ball: utility lost per unit of extra radius. Present if the step was solved."""
    worst_law: NotRequired[WorstLawSummary | None]
    worst_case: NotRequired[WorstCase | None]


class AcceptedJob(Job):
    """A job that was accepted."""

    warnings: list[Warning]
    """Valid entries of the request that may be mistakes."""


AdviseAnswer: TypeAlias = Advised | AssetsAdvised
"""The answer to a request about one asset or several."""


class AssetsAction(FundAdvice):
    """The robust allocation of several assets for the coming period."""

    session: str
    period: int
    worst_case: NotRequired[WorstCase | None]
    caution: list[Caution]
    """Points to know before you follow the advice."""


class AssetsWhatIfPoint(FundAdvice):
    """The advice on several assets under one hypothesis."""

    period: int
    """The period advised."""
    wealth: float
    """Wealth at its start."""
    log_returns: NotRequired[dict[str, float | None]]
    """The returns of the hypothesis by asset, if it has any."""
    radius_scale: NotRequired[float | None]
    """The factor on the radius in the hypothesis, if it has one."""
    gamma: NotRequired[float | None]
    """Lagrange multiplier of the ball: utility lost per unit of extra radius. Present if the step was solved."""
    worst_law: NotRequired[WorstLawSummary | None]
    worst_case: NotRequired[WorstCase | None]


BacktestQuestion: TypeAlias = BacktestRequest | AssetsBacktestRequest | DeclaredBacktest
"""
A walk-forward of one asset, of several assets if the request has the field `assets`, or of a declared problem if it has
the field `problem`.
"""


class ComparisonReport(TypedDict):
    """Policies trained before, policies trained here, and rules, in this order; each in that of its names or frameworks."""

    format: str
    """`ballast-comparison-1`."""
    request: DeclaredComparison
    """The request."""
    problem: DeclaredProblem
    """The declaration, of the first policy if the request has none."""
    strategies: list[ComparedStrategy]
    """One for each policy and each rule."""


CorrectionAnswer: TypeAlias = Corrected | DeclaredCorrected
"""The session after a correction: an investor's, or one of a declared problem."""


class DeclaredObservation(TypedDict):
    """One period of a declared problem, observed or inserted later."""

    period: int
    """Its present number."""
    answered: NotRequired[DeclaredObserved | None]
    reported: Report
    """The first report of it."""
    observed_ms: int
    corrections: list[int]
    """Numbers of the corrections that inserted it or reported it again."""
    now: DeclaredNow
    """The period after all corrections."""


EvaluationQuestion: TypeAlias = EvaluationRequest | DeclaredComparison
"""A comparison of an investor's strategies, or of policies and rules of a declared problem."""


class EvaluationReport(TypedDict):
    """Strategies compared on common returns. `docs/evaluation.md` explains the intervals."""

    format: str
    """`ballast-evaluation-1`."""
    request: EvaluationRequest
    """The completed request."""
    reference: str
    """The strategy from which differences are taken."""
    strategies: list[StrategyReport]
    """Strategies: frameworks first, then constant mixes, in the order of the request."""
    floor: float
    """
    Terminal wealth of All in the bank, the origin of utility: utility is 0 there, and grows as the logarithm of
    wealth does.
    """
    histogram_edges: list[float]
    """Common bin edges of terminal utility, ascending."""
    wealth_edges: list[float]
    """Common bin edges of terminal wealth, ascending and evenly spaced."""
    histories: list[HistoryReport]
    """Histories in the order they were drawn."""
    sentences: list[str]
    """Sentences about each framework that changes its allocation."""
    costs: Costs
    """Run times."""


class FrontierReport(TypedDict):
    """
    The loss from following the advice at multiples of the radius, on records like the given one. The same request gives
    the same report, bit for bit.
    """

    format: str
    """`ballast-frontier-1`."""
    request: FrontierRequest
    """The completed request."""
    level: float
    """
    Confidence level of the intervals. They show how exactly the resamples determine a figure, not how close the
    resampled laws are to the true law.
    """
    per_year: bool
    """True if losses are per year, because `problem.periods_per_year` is given; otherwise they are per period."""
    radius: float
    """Radius of the rule at the record itself, in log-return; scales are multiples of it."""
    evidence: float
    """By how many standard errors the record's mean return exceeds the bank's, in the inverse-volatility fund."""
    own: list[list[float]]
    """Advice at the record itself, scale by scale: the share of wealth in each asset, in the order of the request."""
    resampled: list[ResampledFrontier]
    """Results for each law that records were drawn from."""
    sentences: list[str]
    """Sentences on what the figures show, and what they cannot show."""


JobReport: TypeAlias = EvaluationReport | ComparisonReport | BacktestReport | AssetsBacktestReport | DeclaredWalkReport | FrontierReport
"""The report of a job: of an evaluation, of a walk-forward backtest or of a frontier."""


class Observed(Uncertainty):
    """The session of an investor after an observation."""

    session: str
    period: int
    log_return: NotRequired[float | None]
    """Null if it is missing, or after a total loss, which `notes` says."""
    notes: NotRequired[list[PeriodNote]]
    """Notes on the period: losses that the law does not learn in full, and prices that did not come."""
    band: list[float]
    """
    The holdings that are best kept at the start of the period. If trading costs nothing, both ends are the advised
    allocation.
    """
    advised_allocation: float
    executed_allocation: float
    advised_spending: NotRequired[SpendingAdvice | None]
    spent: NotRequired[float | None]
    """Money spent at the start of the period; left out if it is none."""
    wealth: float
    """Wealth at the end of the period, including what was added to it."""
    holding: float
    """Share of wealth in the risky asset after the return."""
    assets: NotRequired[ObservedAssets | None]
    wealth_change: float
    """Change of wealth over the period, including flows and wealth reported otherwise."""
    date: NotRequired[str | None]
    """
    The last day of the period: the one reported, or else the next one due by the calendar. If that is unknown too,
    it is the last day known of an earlier period.
    """
    completed: bool
    """True if the horizon is reached and no policy is to follow."""
    drift: Drift
    """The test of whether returns still come from the same law."""


PlanAsked: TypeAlias = PlanQuestion | PlanQuestionAssetsProblem
"""A question about one asset, or about several, which `problem.assets` names."""


Posed: TypeAlias = Specification | DeclaredSpecification
"""A problem that a policy is trained for, with all settings of the training."""


class Reading1(Record):
    """The text is this record."""

    outcome: Literal["read"]


Reading: TypeAlias = Reading1 | Reading2 | Reading3
"""The outcome of reading a text."""


class Renewal(Renewed):
    """One renewal, as it was made."""

    window: NotRequired[int | None]
    """Number of last returns that the law was made of; null if it used all."""
    records: NotRequired[dict[str, list[float | None]]]
    """The record that each asset entered with, by name."""
    leaving: NotRequired[list[str]]
    """Names of the assets that left."""
    renewed_ms: int


RenewalAnswer: TypeAlias = Renewed | DeclaredRenewed
"""The session after a renewal: an investor's, or one of a declared problem."""


class WhatIfAnswer1(WhatIfPoint):
    """One point, or the points of a sweep in its order."""

    session: str


class WhatIfAnswer2(TypedDict):
    """One point, or the points of a sweep in its order."""

    session: str
    points: list[WhatIfPoint]


class WhatIfAnswer3(AssetsWhatIfPoint):
    """One point for several assets."""

    session: str


class WhatIfAnswer4(TypedDict):
    """One point, or the points of a sweep in its order."""

    session: str
    points: list[AssetsWhatIfPoint]


WhatIfAnswer: TypeAlias = WhatIfAnswer1 | WhatIfAnswer2 | WhatIfAnswer3 | WhatIfAnswer4 | WhatIfAnswer5 | WhatIfAnswer6
"""One point, or the points of a sweep in its order."""


ActionAnswer: TypeAlias = AssetAction | AssetsAction | DeclaredAdvice
"""The robust allocation for the coming period."""


class DeclaredHistory(TypedDict):
    """The start of a declared problem's session, and everything recorded since."""

    session: str
    policy: str
    initial_state: dict[str, float]
    """States at the start, by name."""
    history: list[float]
    """Noises known at the start."""
    observations: list[DeclaredObservation]
    corrections: list[DeclaredCorrection]
    renewals: list[DeclaredRenewal]
    """The policies that followed the first."""


class Observation(Observed):
    """One period, observed or inserted later."""

    reported: Report
    """The first report of it."""
    observed_ms: int
    account: PeriodAccount
    """Money of the period after all corrections, beside what simple rules would have made."""
    corrections: NotRequired[list[int]]
    """Numbers of the corrections that inserted it or reported it again."""
    now: NotRequired[Now | None]


ObservationAnswer: TypeAlias = Observed | DeclaredObserved
"""The session after an observation: an investor's, or one of a declared problem."""


class PolicyDetail(Labels):
    """A policy, and how well each of its steps was solved."""

    policy: str
    created_ms: int
    framework: Framework
    horizon: int
    specification: Posed
    annualised: NotRequired[Annualised | None]
    warnings: list[Warning]
    """Valid entries of the specification that may be mistakes."""
    diagnostics: list[StepDiagnostics]


class ElementAnswered(TypedDict):
    """The answer to one element of a list."""

    session: str
    period: int
    status: int
    """HTTP status that a call with this report alone would get."""
    answer: NotRequired[ObservationAnswer | None]
    problem: NotRequired[ProblemDocument | None]


class History(TypedDict):
    """The start of an investor's session, and everything recorded since."""

    session: str
    policy: str
    """The first policy."""
    terms: Terms
    """Rate, cost and flows of its periods, unless a report gives others."""
    initial_wealth: float
    initial_holding: float
    """Share of wealth in the risky asset."""
    initial_radius: float
    """Radius of the uncertainty set before the first period, in the unit of an advice's radius."""
    assets: NotRequired[list[str] | None]
    """Names of the assets at the start, if there are several. A renewal that changes them has the new `names`."""
    composed: NotRequired[Composition | None]
    history: InitialHistory
    """Log-returns known at the start."""
    record: InitialHistory
    """
    Log-returns that the law is made of, oldest first and with all corrections: of the present assets, and without
    periods in which one has none. A renewal may use the last ones only.
    """
    observations: list[Observation]
    corrections: list[Correction]
    renewals: list[Renewal]
    """The policies that followed the first."""


HistoryAnswer: TypeAlias = History | DeclaredHistory
"""The history of a session: an investor's, or one of a declared problem."""


ReportsAnswered: TypeAlias = ObservationAnswer | list[ElementAnswered]
"""The answer to one report, or the answers to a list in its order."""
