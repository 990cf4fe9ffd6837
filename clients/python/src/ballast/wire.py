"""The types of requests and answers, generated from api/openapi.json by ./generate."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias, TypedDict

from typing_extensions import NotRequired

AdviceSource: TypeAlias = Literal["policy_surrogate", "resolved", "resolved_outside_design", "resolved_other_radius", "unsolved"]
"""Where an advice came from."""


class Annualised(TypedDict):
    """The problem's rate and record by the year, with p periods in one. Fractions, each at most the largest double."""

    rate: float
    """What the bank pays, compounded: `(1 + r)^p - 1`."""
    mean_return: float
    """What the asset paid, compounded: `m^p - 1`, m the mean of `e^z` over the log-returns z of the history."""
    deviation: float
    """Standard deviation of the history's simple returns, a sample's, of independent periods: `sqrt(p)` times that of one."""


Asset: TypeAlias = str


LogReturnItem: TypeAlias = float


LogReturn: TypeAlias = list[LogReturnItem]


SimpleReturnItem: TypeAlias = float


SimpleReturn: TypeAlias = list[SimpleReturnItem]


Window: TypeAlias = int | None


class AssetsNow(TypedDict):
    """What stands of a period of several assets with all corrections made."""

    log_returns: NotRequired[dict[str, float]]
    """By the names of the assets; null where they are missing."""


class AssetsPeriods(TypedDict):
    """What one strategy did, a number a period."""

    strategy: str
    """Its name."""
    allocations: dict[str, list[float]]
    """Share of wealth held in each asset, by its name."""
    radius: list[float]
    """Of the ball, in log-return; 0 where there was none."""
    traded: list[float]
    """Share of wealth that was bought and sold at the start."""
    wealth: list[float]
    """At the end, from 100."""


ActionIntervalItem: TypeAlias = float


HistoryItemItem: TypeAlias = float


HistoryItem: TypeAlias = list[HistoryItemItem]


class AuditEntry(TypedDict):
    """One thing that was done."""

    at_ms: int
    """When, in milliseconds since 1970."""
    tenant: str
    key: NotRequired[str | None]
    """The key's name; null where none was asked for, and of what was done by a command on the store."""
    roles: str
    """
    The key's roles, `anybody` where no key was asked for, `operator` of a command on the store, or `service`. Empty for
    `session.observe`: an observation keeps the name of the key alone.
    """
    action: str
    object: str
    """What it was done to."""
    outcome: str
    """What came of it."""
    number: int
    """From 1 among the entries of its key in this tenant; of `session.observe`, among the entries of its session."""
    seal: str
    """
    SHA-256 over the entry and the seal of the one before, in hexadecimal digits: a copy of it shows later that the entry and
    all before it are what they were.
    """


class AuditPage(TypedDict):
    """A page of the audit, newest first."""

    entries: list[AuditEntry]
    next: NotRequired[int | None]
    """Give it as `after` for the next page; null on the last."""


class BacktestIntervals(TypedDict):
    """
    How the intervals were made: of certainty equivalents from what each year adds to them, of chances from whole years, of other figures
    by circular blocks of what was lived, the same for all strategies.
    """

    confidence: float
    """Probability that an interval is meant to hold; those of differences all hold at once with it."""
    comparisons: int
    """Differences from one strategy, whose intervals hold at once; those from own mixes are as many as have one."""
    resamples: int
    """How many, where figures are resampled."""
    period_block: int
    """Periods of a block of them."""
    year_block: int
    """Neighbouring years that may depend on each other."""


class BacktestPeriods(TypedDict):
    """What one strategy did, a number a period."""

    strategy: str
    """Its name."""
    allocation: list[float]
    """Share of wealth held through the period."""
    low: list[float]
    """Lower end of the holdings that were kept as they were."""
    high: list[float]
    """Upper end of them."""
    radius: list[float]
    """Of the ball, in log-return; 0 where there was none."""
    traded: list[float]
    """Share of wealth that changed between bank and asset at the start."""
    wealth: list[float]
    """At the end, from 100."""


LogReturn1: TypeAlias = float


SimpleReturn1: TypeAlias = float


AlphaItem: TypeAlias = float


class BankRate(TypedDict):
    """What the bank paid in each period, as fractions."""

    column: str
    """The name of the column."""
    rates: list[float]
    """In the order of the returns."""


class Bootstrap1(TypedDict):
    """Independent draws of the returns seen, spread by a kernel."""

    bandwidth: float
    """Deviation of the kernel over that of the record, before the variance is brought back."""
    kind: Literal["smoothed"]


class Bootstrap2(TypedDict):
    """The same, every return moved by as much, to where its asset's mean is the bank's: were there no premium."""

    bandwidth: float
    """Deviation of the kernel over that of the record, before the variance is brought back."""
    kind: Literal["without_premium"]


class Bootstrap3(TypedDict):
    """Blocks of the returns seen, in a row; the last is followed by the first."""

    length: int
    """Periods of a block."""
    kind: Literal["block"]


Bootstrap: TypeAlias = Bootstrap1 | Bootstrap2 | Bootstrap3
"""How records are drawn from the one at hand."""


class BootstrapEstimate(TypedDict):
    """A figure with its interval."""

    value: float
    """Of what was lived."""
    interval: list[float]
    """Its ends."""


class CareCount(TypedDict):
    """How many sessions need care, and why; one may have several reasons."""

    sessions: int
    """Those that are found."""
    any: int
    """In need of care for any of the reasons."""
    overdue: int
    """Their next report is late."""
    renewal: int
    """They wait for their next policies."""
    alarm: int
    """Their returns have changed."""
    ending: int
    """Completed, or in their last period and not renewed by themselves."""


CareReason: TypeAlias = Literal["overdue", "renewal", "alarm", "ending"]
"""Why a session needs care."""


CautionCode: TypeAlias = Literal["short_record", "one_return", "not_certified", "waiting"]
"""The reasons."""


class CautionLevel1(TypedDict):
    """This share, whatever is seen: 0 takes the record for the truth."""

    scale: float
    """This share, whatever is seen: 0 takes the record for the truth."""


CautionLevel: TypeAlias = Literal["paper"] | Literal["bold"] | Literal["balanced"] | Literal["cautious"] | CautionLevel1
"""The share of the radius that is acted on: a level by its name, or a number."""


class CautionScale(TypedDict):
    """A share of the radius and its price in the three worlds. Losses are in log certainty equivalent per step."""

    scale: float
    """Share of the radius."""
    standard_error: float
    """Its standard error, of the simulation of records."""
    regrets: list[float]
    """Loss beside the best share in each of the three worlds: without a premium, with half, and with the whole."""
    spared: float
    """Spared beside taking the record for the truth, in the world without a premium."""


class CentreSpecification1(TypedDict):
    """The law of the returns seen."""

    kind: Literal["empirical"]


class CentreSpecification2(TypedDict):
    """
    The perturbed empirical law: that of a return seen plus a normal error. Its radius is that of the returns seen, of which
    smoothing makes no more.
    """

    bandwidth: float
    """Standard deviation of the error, in log-return. 0 is `empirical`."""
    kind: Literal["smoothed"]


class CentreSpecification3(TypedDict):
    """
    The law of the returns seen, each brought to the volatility that is expected for the coming period: of an exponentially
    weighted mean of squares. Of a static ball, or for one period: what a return yet to come does to the volatility is no part of
    a state.
    """

    half_life: float
    """Periods in which the weight of a square halves."""
    kind: Literal["volatility_scaled"]


HistoryItem1: TypeAlias = float


Change: TypeAlias = Literal["replace", "insert", "remove"]
"""Changes of the periods that passed."""


class CompositionRule1(TypedDict):
    """These shares, in the order of the assets, which sum to 1."""

    given: list[float]
    """These shares, in the order of the assets, which sum to 1."""


CompositionRule: TypeAlias = Literal["one_step"] | Literal["equal"] | Literal["inverse_volatility"] | CompositionRule1
"""How the composition of the fund is chosen."""


Contributions: TypeAlias = float | list[float]
"""C, money added at the end of each period."""


class Correct(TypedDict):
    """A change of the periods that passed: a period is reported anew, all of it, is put in between others, or is taken out."""

    correction: int
    """Number of the correction, from 1."""
    period: int
    """The period that is put right or taken out, or that the new one is put in before."""
    change: NotRequired[Change]
    reason: str
    """Why, in at most 200 letters."""
    confirm: NotRequired[bool]
    """The correction is meant, whatever is doubted in it."""
    log_return: NotRequired[float | None]
    simple_return: NotRequired[float | None]
    """`price / previous price - 1`."""
    price: NotRequired[float | None]
    """Price at the end of the period."""
    previous_price: NotRequired[float | None]
    """Price at the start of the period. Default: the price reported for the period before."""
    log_returns: NotRequired[dict[str, float]]
    """Of several assets, by their names; each has one."""
    simple_returns: NotRequired[dict[str, float]]
    """Of several assets, `price / previous price - 1` each."""
    prices: NotRequired[dict[str, float]]
    """Prices of several assets at the end of the period."""
    previous_prices: NotRequired[dict[str, float]]
    """Their prices at the start of the period. Default: those reported for the period before."""
    missing: NotRequired[bool]
    """In the place of a return where none is known: the law stays as it is, and what is held counts as unmoved."""
    date: NotRequired[str | None]
    """The last day of the period, later than that of the period before."""
    rate: NotRequired[float | None]
    """What the bank paid in the period. Default: the policy's rate."""
    flow: NotRequired[float | None]
    """Money added at the end of the period, negative where it was taken. Default: the policy's contribution."""
    executed_allocation: NotRequired[float | None]
    """Share of wealth held in the risky asset through the period. Default: the allocation advised for it."""
    executed_allocations: NotRequired[dict[str, float]]
    """Share of wealth held in each of several assets through the period. Default: what was advised for it."""
    wealth: NotRequired[float | None]
    """Wealth reached, with what was added, where it differs from what all of the above gives."""


class Costs(TypedDict):
    """What the evaluation cost; the only part that differs between two runs."""

    training_seconds: float
    """Seconds of all trainings."""
    simulation_seconds: float
    """Seconds of the simulation."""
    resolve_seconds: NotRequired[float | None]
    """Mean of one re-solved step; null where there was none."""


DoubtReason: TypeAlias = Literal["missing_periods", "early_day", "future_day", "unusual_return", "differs_from_peers"]
"""Why a report is doubted."""


DriftLevel: TypeAlias = Literal["none", "warning", "alarm"]
"""What the highest capital says."""


class Estimate(TypedDict):
    """A figure and the interval around it."""

    value: float
    """The estimate itself."""
    low: float
    """Lower end of its interval."""
    high: float
    """Upper end of its interval."""


ConstantMix: TypeAlias = float


class ExpectedError(TypedDict):
    """
    Root mean square errors of the value that a step serves, in basis points of the certainty equivalent: over the design's own law
    of its states, at the holdings it was solved at. They say nothing of states that this law seldom visits, such as those after a
    return beyond the record, where the value may be off by a hundred times as much, nor of the first step of a design that starts
    at one law.
    """

    own: float
    """Of the surrogate of the step alone."""
    total: float
    """With those of the steps after it, as errors that are independent of each other add up."""


Explain: TypeAlias = Literal["worst_case"]
"""What is shown beside an allocation."""


FeatureMap: TypeAlias = Literal["standardized", "raw_moments"]
"""How a state becomes the inputs of a surrogate."""


Framework: TypeAlias = Literal["adaptive", "static", "known_law", "plug_in", "parametric_static", "parametric_adaptive"]
"""What the investor is robust against, and whether observing returns changes it."""


class FrontierPoint(TypedDict):
    """What one multiple of the radius loses."""

    scale: float
    """Of the radius."""
    lost: Estimate
    """Basis points of certainty equivalent behind the best allocation, on average over records."""
    deviation: Estimate
    """Of that loss from record to record."""
    beyond_least: NotRequired[Estimate | None]
    beyond_own_mix: Estimate
    """
    What the advice gains over a constant mix of its own average allocation over all records, in the unit of `lost`: at most 0, up
    to rounding, since what an allocation is worth under one law is concave in it.
    """
    total: float
    """Share of wealth held in all assets together, on average over records."""


Scale: TypeAlias = float


HistoryItem2Item: TypeAlias = float


HistoryItem2: TypeAlias = list[HistoryItem2Item]


GroundNorm: TypeAlias = Literal["scaled_one", "sup"]
"""The distance between two dates' log-returns."""


class Health(TypedDict):
    """The service in a few words."""

    status: str
    version: str
    jobs_queued: int
    jobs_running: int
    sessions: int


class HistoryReport(TypedDict):
    """One initial history."""

    quantile: NotRequired[float | None]
    """The bridge quantile there; null under other radius rules than `bridge` and `calibrated`."""
    radius: float
    """Of the first framework with a ball, in log-return; 0 where there is none."""
    promised: list[float]
    """What each framework promises there: the certainty equivalent of its first advice, by its own account."""
    mean_utility: list[float]
    """Mean terminal utility of each strategy, in their order."""


Holds: TypeAlias = Literal["dates", "values", "rate", "other"]
"""What a column holds."""


LengthscaleItem: TypeAlias = float


SignalVarianceItem: TypeAlias = float


NoiseVarianceItem: TypeAlias = float


class HyperparameterBounds(TypedDict):
    """Box of the maximum-likelihood search, for inputs and targets scaled to unit variance."""

    lengthscale: NotRequired[list[LengthscaleItem]]
    """In standard deviations of an input over the design."""
    signal_variance: NotRequired[list[SignalVarianceItem]]
    """In mean squares of the target over the design."""
    noise_variance: NotRequired[list[NoiseVarianceItem]]
    """In mean squares of the target over the design."""


class Imported(TypedDict):
    """An imported policy."""

    policy: str


class InitialHistories1(TypedDict):
    """The problem's own."""

    kind: Literal["given"]


class InitialHistories2(TypedDict):
    """So many draws from the true law, each as long as the problem's own."""

    count: int
    """How many."""
    kind: Literal["drawn"]


InitialHistories: TypeAlias = InitialHistories1 | InitialHistories2
"""Which histories paths start from."""


InitialLaws: TypeAlias = Literal["given", "resampled"]
"""Where the design's empirical laws start."""


class Interval(TypedDict):
    """A closed interval."""

    min: float
    """The lower end."""
    max: float
    """The upper end."""


JobKind: TypeAlias = Literal["train", "evaluate", "backtest", "frontier"]
"""What a job computes."""


JobState: TypeAlias = Literal["queued", "running", "succeeded", "failed", "cancelled"]


class KeyHolder(TypedDict):
    """Who a call is answered to."""

    key: NotRequired[str | None]
    """The key's name, which is no secret; null where the store asks for none."""
    tenant: str
    """Whose jobs, policies and sessions are answered."""
    roles: list[str]
    """What the holder may do: `read`, `operate`, `train`, `admin`. Who is an admin may do all of them."""
    expires_ms: NotRequired[int | None]
    """When the key ends, in milliseconds since 1970; null where that is not set."""


Kind: TypeAlias = Literal["simple", "log", "price", "gross", "cumulated"]
"""What the numbers are."""


KnownReturns: TypeAlias = list[float] | list[list[float]]
"""Log-returns known at the start of a session, oldest first."""


class Labels(TypedDict):
    """What a policy or a session is called; each part is empty where nothing was said."""

    name: str
    """Not necessarily of this one alone."""
    notes: str
    tags: list[str]


class Learning1(TypedDict):
    """As much as any other."""

    kind: Literal["equal"]


class Learning2(TypedDict):
    """Half as much as one that is `half_life` periods newer: the law forgets what is long past."""

    half_life: float
    """In periods."""
    kind: Literal["decay"]


Learning: TypeAlias = Learning1 | Learning2
"""What a return weighs in the law that is learned: of the history and of what is seen after it alike."""


class LeftOut(TypedDict):
    """The advice without one return."""

    index: int
    """Of the return in the record, from 0; the first of equal ones."""
    log_return: float
    """The return."""
    simple_return: float
    """The same as `price / previous price - 1`."""
    allocation: float
    """The share of wealth that would be advised."""


class LevelAdvised(TypedDict):
    """A level, its share of the radius, its price, and what it would hold."""

    level: CautionLevel
    """Its name."""
    scale: float
    """Share of the radius."""
    regrets: list[float]
    """Loss of log certainty equivalent per step beside the best share of the radius, in the three worlds."""
    spared: float
    """Spared per step in the world without a premium, beside taking the record for the truth."""
    allocation: NotRequired[float | None]
    """Share of wealth that it would hold; null where that would take long to find, of several assets in long records."""
    allocation_error: NotRequired[float | None]
    """Its standard error, of the simulation behind the level; of the level followed alone."""


class LevelsAdvised(TypedDict):
    """The levels of caution on a record."""

    followed: CautionLevel
    """The one followed."""
    premium_seen: float
    """Mean simple return of the record beyond the bank, per step."""
    standard_error: float
    """Its standard error."""
    premiums: list[float]
    """
    The same beyond the bank in the three worlds that losses are told for: none, half, and the whole of the premium seen, or of 0
    where it is negative, plus its standard error.
    """
    levels: list[LevelAdvised]
    """From the boldest to the paper's."""


class MixtureComponent(TypedDict):
    """One normal law of a mixture, of log-returns per step."""

    weight: float
    """Its probability."""
    mean: float
    """In log-return."""
    variance: float
    """In squared log-return."""


class NextAdvice(TypedDict):
    """The advice after one more return."""

    quantile: float
    """Share of the record below it; interpolated between its returns (Hyndman and Fan, type 7)."""
    log_return: float
    """The return supposed."""
    simple_return: float
    """The same as `price / previous price - 1`."""
    allocation: float
    """The share of wealth that would be advised."""


class Observe(TypedDict):
    """The return of one period, given in exactly one of three ways or as missing, and what was done in it."""

    session: str
    period: int
    """Number of the period, from 1."""
    confirm: NotRequired[bool]
    """The report is meant, whatever is doubted in it."""
    log_return: NotRequired[float | None]
    simple_return: NotRequired[float | None]
    """`price / previous price - 1`."""
    price: NotRequired[float | None]
    """Price at the end of the period."""
    previous_price: NotRequired[float | None]
    """Price at the start of the period. Default: the price reported for the period before."""
    log_returns: NotRequired[dict[str, float]]
    """Of several assets, by their names; each has one."""
    simple_returns: NotRequired[dict[str, float]]
    """Of several assets, `price / previous price - 1` each."""
    prices: NotRequired[dict[str, float]]
    """Prices of several assets at the end of the period."""
    previous_prices: NotRequired[dict[str, float]]
    """Their prices at the start of the period. Default: those reported for the period before."""
    missing: NotRequired[bool]
    """In the place of a return where none is known: the law stays as it is, and what is held counts as unmoved."""
    date: NotRequired[str | None]
    """The last day of the period, later than that of the period before."""
    rate: NotRequired[float | None]
    """What the bank paid in the period. Default: the policy's rate."""
    flow: NotRequired[float | None]
    """Money added at the end of the period, negative where it was taken. Default: the policy's contribution."""
    executed_allocation: NotRequired[float | None]
    """Share of wealth held in the risky asset through the period. Default: the allocation advised for it."""
    executed_allocations: NotRequired[dict[str, float]]
    """Share of wealth held in each of several assets through the period. Default: what was advised for it."""
    wealth: NotRequired[float | None]
    """Wealth reached, with what was added, where it differs from what all of the above gives."""


Tag: TypeAlias = str


class OwnMix(TypedDict):
    """The constant mix of a strategy's own average allocation, which nobody could have chosen beforehand, on the same returns."""

    allocation: float
    """The average, over all periods of all paths."""
    beyond: Estimate
    """Certainty equivalent of the strategy less that of the mix, in terminal wealth: what changing the allocation earned."""


class Performance(TypedDict):
    """What a strategy was worth and how it varied; returns as fractions."""

    yearly_certainty_equivalent: BootstrapEstimate
    """Of mean utility over the whole years, each from wealth 100."""
    beyond_own_mix: NotRequired[BootstrapEstimate | None]
    annual_mean: BootstrapEstimate
    """Mean simple return of a year, compounded: `(1 + m)^p - 1`, m the mean of a period and p the periods of a year."""
    annual_volatility: BootstrapEstimate
    """Standard deviation of simple returns."""
    sharpe_ratio: BootstrapEstimate
    """Mean excess over the bank by its deviation."""
    annual_turnover: BootstrapEstimate
    """Share of wealth that is bought and sold in a year."""
    chance_of_loss: BootstrapEstimate
    """Share of the years, one beginning with every period, that end with less than they began with."""
    worst_twentieth: BootstrapEstimate
    """Mean return of the worst twentieth of these years."""
    max_drawdown: float
    """Largest fall below the highest wealth so far, as a share of it."""
    final_wealth: float
    """From 100."""
    mean_allocation: float
    """Share of wealth at risk."""


Phase: TypeAlias = Literal["solving", "fitting", "simulating"]
"""What a job is doing."""


class Place(TypedDict):
    """Where in the text something is wrong."""

    line: int
    """From 1."""
    column: int
    """From 1: of the fields of the line."""
    value: str
    """What stands there, shortened where it is long."""


class PolicyEntry(Labels):
    """A policy in a list."""

    policy: str
    created_ms: int
    bytes: int
    """Length of the exported document."""


class PolicyPage(TypedDict):
    """A page of policies, newest first."""

    policies: list[PolicyEntry]
    next: NotRequired[int | None]
    """Give it as `after` for the next page; null on the last."""


class Premium(TypedDict):
    """What the record pays beyond the bank, and what it would have to."""

    present: float
    """Mean simple return of the record, by its weights, less `rate_per_step`: what it paid a period beyond what the bank pays now."""
    needed: NotRequired[float | None]
    """
    The same of the record with every log-return shifted by the amount at which the advice leaves the bank, to 1e-6: above
    `present` where all is in the bank now, else below it. Null where no shift within the distance between the lowest and the
    highest return, that leaves all of them in `support`, parts the two. In one period without trading cost the shift is
    `ln(1 + rate_per_step)` less the log of the least mean of e^Z in the ball. Checked by: tests/solver/sensitivity.rs against that.
    """
    periods_more: NotRequired[int | None]
    """
    More returns, of the law of those seen, after which the advice leaves the bank: the least number m at which the step with
    the radius times sqrt(n / (n + m)) advises anything. 0 where it has left already; null where it does not within 10000
    periods, or the radius rule is `fixed`.
    """


HistoryItem3: TypeAlias = float


class RadiusRule1(TypedDict):
    """`scale Q / sqrt(n)`, Q the (1 - alpha)-quantile of the bridge statistic over simulated paths."""

    alpha: NotRequired[float]
    """Miscoverage, the probability that the ball misses the true law."""
    paths: NotRequired[int]
    """Simulated paths."""
    scale: NotRequired[float]
    """A factor on the radius."""
    correction: NotRequired[float | None]
    """
    By what every simulated quantile is multiplied, so that that of the history is exact: found, never asked for. What a
    request says here is found anew.
    """
    rule: Literal["bridge"]


class RadiusRule2(TypedDict):
    """
    That of `bridge` times a factor found once, from the history: with it, the balls of a share 1 - alpha of records drawn from the
    smoothed law of the history hold that law.
    """

    alpha: NotRequired[float]
    """Miscoverage."""
    paths: NotRequired[int]
    """Simulated paths."""
    scale: NotRequired[float]
    """One more factor on the radius."""
    rule: Literal["calibrated"]


class RadiusRule3(TypedDict):
    """`sqrt(ln(C / alpha) / (c n))`, the concentration inequality of Fournier and Guillin."""

    alpha: NotRequired[float]
    """Miscoverage."""
    C: float
    """C of the inequality."""
    c: float
    """c of the inequality, per squared log-return."""
    rule: Literal["concentration"]


class RadiusRule4(TypedDict):
    """`kappa / sqrt(n)`."""

    kappa: float
    """In log-return."""
    rule: Literal["root_n"]


class RadiusRule5(TypedDict):
    """The same radius at every sample size."""

    radius: float
    """In log-return."""
    rule: Literal["fixed"]


class RadiusRule6(TypedDict):
    """
    `sqrt(kappa / n)` estimated standard deviations, kappa the (1 - alpha)-quantile of chi-square with two degrees
    of freedom: `n (mu - m)^2 / v + n (s2 - v)^2 / (2 v^2) <= kappa`, m and v the sample's mean and variance.
    """

    alpha: NotRequired[float]
    """Miscoverage."""
    rule: Literal["chi_square"]


RadiusRule: TypeAlias = RadiusRule1 | RadiusRule2 | RadiusRule3 | RadiusRule4 | RadiusRule5 | RadiusRule6
"""
How the radius of the uncertainty set follows from the sample of size n: `chi_square` of the parametric frameworks'
confidence region, every other of the Wasserstein ball.
"""


class RadiusSpread(TypedDict):
    """The radius over paths."""

    mean: float
    """Over paths, in log-return, as all below."""
    quantile_10: float
    """A tenth of the paths have less."""
    quantile_50: float
    """The median."""
    quantile_90: float
    """Nine tenths of the paths have less."""
    first_path: float
    """On the first path."""


RateUnit: TypeAlias = Literal["fraction", "percent", "unused"]
"""What the rates of the bank are counted in, where a column tells them."""


Rates: TypeAlias = float | list[float]
"""What the bank pays in each period."""


class Reading3(TypedDict):
    """It is none."""

    sentence: str
    """What is wrong, and where."""
    place: NotRequired[Place | None]
    outcome: Literal["refused"]


class Relabel(TypedDict):
    """A change of labels: what is absent stays, what is null or empty is cleared."""

    name: NotRequired[str | None]
    """At most 100 letters, without control characters."""
    notes: NotRequired[str | None]
    """At most 2,000 letters, without control characters but line breaks."""
    tags: NotRequired[list[Tag] | None]
    """At most 20, each another, of 1 to 50 letters without control characters."""


class Renew(TypedDict):
    """The policy that a session goes on by."""

    renewal: int
    """Number of the renewal, from 1."""
    policy: str
    """The next policy."""
    window: NotRequired[int | None]
    """Returns that the law is made of, the last ones. Default: all that were seen."""


RenewalState: TypeAlias = Literal["due", "training", "failed", "trained"]


class Renewing(TypedDict):
    """How a session is renewed by itself."""

    every: int
    """Periods by one policy, until the next is trained; fewer than its horizon."""
    window: NotRequired[int | None]
    """Returns that the next policy is trained on, the last ones. Default: all that were seen."""


class Report(TypedDict):
    """What is recorded of a period: its return, given in exactly one of three ways or as missing, and what was done in it."""

    log_return: NotRequired[float | None]
    simple_return: NotRequired[float | None]
    """`price / previous price - 1`."""
    price: NotRequired[float | None]
    """Price at the end of the period."""
    previous_price: NotRequired[float | None]
    """Price at the start of the period. Default: the price reported for the period before."""
    log_returns: NotRequired[dict[str, float]]
    """Of several assets, by their names; each has one."""
    simple_returns: NotRequired[dict[str, float]]
    """Of several assets, `price / previous price - 1` each."""
    prices: NotRequired[dict[str, float]]
    """Prices of several assets at the end of the period."""
    previous_prices: NotRequired[dict[str, float]]
    """Their prices at the start of the period. Default: those reported for the period before."""
    missing: NotRequired[bool]
    """In the place of a return where none is known: the law stays as it is, and what is held counts as unmoved."""
    date: NotRequired[str | None]
    """The last day of the period, later than that of the period before."""
    rate: NotRequired[float | None]
    """What the bank paid in the period. Default: the policy's rate."""
    flow: NotRequired[float | None]
    """Money added at the end of the period, negative where it was taken. Default: the policy's contribution."""
    executed_allocation: NotRequired[float | None]
    """Share of wealth held in the risky asset through the period. Default: the allocation advised for it."""
    executed_allocations: NotRequired[dict[str, float]]
    """Share of wealth held in each of several assets through the period. Default: what was advised for it."""
    wealth: NotRequired[float | None]
    """Wealth reached, with what was added, where it differs from what all of the above gives."""


Reports: TypeAlias = Observe | list[Observe]
"""One report, or a list of reports of as many sessions."""


class Resampled(TypedDict):
    """The frontier on records drawn from one law."""

    bootstrap: Bootstrap
    """How they were drawn."""
    best: list[float]
    """The best allocation for who knows the law: the share of wealth in each asset."""
    points: list[FrontierPoint]
    """Scale by scale."""


class Return(TypedDict):
    """A return in both units."""

    log_return: float
    """`ln(price / previous price)`."""
    simple_return: float
    """`price / previous price - 1`."""


class SamplingLaw1(TypedDict):
    """A mixture of normal laws."""

    components: list[MixtureComponent]
    """At least one; their weights sum to 1."""
    kind: Literal["gaussian_mixture"]


class SamplingLaw2(TypedDict):
    """Smoothed bootstrap of the history, each return with its weight, with the mean and variance that gives."""

    kind: Literal["bootstrap"]


class SamplingLaw3(TypedDict):
    """A Student t law, moved and stretched."""

    location: float
    """Its mean, in log-return per step."""
    scale: float
    """What a standard t variable is multiplied by, in log-return."""
    degrees_of_freedom: float
    """Above 2: its variance is finite."""
    kind: Literal["student_t"]


SamplingLaw: TypeAlias = SamplingLaw1 | SamplingLaw2 | SamplingLaw3
"""A law of log-returns that can be drawn from."""


SessionState: TypeAlias = Literal["active", "waiting", "completed"]


class Spread(TypedDict):
    """Mean and quantiles over paths."""

    mean: float
    """Over paths."""
    quantile_10: float
    """A tenth of the paths have less."""
    quantile_90: float
    """Nine tenths of the paths have less."""


StrategyKind: TypeAlias = Literal["adaptive", "cost_blind", "static", "plug_in", "sixty_forty", "all_stock", "all_bank", "own_mix", "robust", "robust_sup", "robust_static", "minimum_variance", "inverse_volatility", "equal_shares", "sixty_equal"]
"""A kind of strategy that walks through a record, which decides its colour and its sentences."""


class Support1(TypedDict):
    """
    From `min(factor z_min, m - 5 s)` to `max(factor z_max, m + 5 s)`, z_min and z_max the worst and the best log-return of the
    law in the middle, m and s its mean and standard deviation; never narrower than from z_min to z_max.
    """

    factor: NotRequired[float]
    """Multiple of the worst and the best log-return, 1 to 10."""
    rule: Literal["worst_seen"]


class Support2(TypedDict):
    """All log-returns: the paper's."""

    rule: Literal["none"]


class Support3(TypedDict):
    """Those between two bounds, whatever is seen."""

    min: float
    """The lowest."""
    max: float
    """The highest."""
    rule: Literal["between"]


Support: TypeAlias = Support1 | Support2 | Support3
"""
The log-returns that the laws in a ball may give mass to. Part of the law, as its radius is: under `worst_seen` it follows the
returns seen so far.
"""


class SurrogateDiagnostics(TypedDict):
    """A fitted surrogate in figures."""

    features: list[str]
    """Names of the inputs, in the order of the lengthscales."""
    lengthscales: list[float]
    """Lengthscales in units of each input's standard deviation over the design."""
    signal_variance: float
    """In units of the target's variance over the design."""
    noise_variance: float
    """In units of the target's variance over the design."""
    log_likelihood_per_point: float
    """Of the scaled targets, at the hyperparameters found."""
    leave_one_out_error: float
    """Root mean square of the leave-one-out errors, in the target's own unit."""
    jitter: float
    """Diagonal added to the covariance matrix to factorise it, relative to its diagonal."""
    search: str
    """How the maximum-likelihood search ended."""


SurrogateTarget: TypeAlias = Literal["floor_gain", "value"]
"""What the value surrogate regresses."""


SweepRange = TypedDict(
    "SweepRange",
    {
        "from": float,
        "to": float,
        "points": int,
    },
)


class Terms(TypedDict):
    """Rate, cost and flows of the periods that a policy is lived by, and how its law is learned."""

    horizon: int
    """T, periods."""
    rate_per_step: float
    """r, simple return of the bank per step."""
    trading_cost: float
    """c, of what is traded."""
    contributions: Contributions
    """C, money added at the end of each period."""
    learning: Learning
    """What older returns weigh."""
    periods_per_year: NotRequired[float | None]
    """By which a period without a day takes the next one due."""


class TransportedMass(TypedDict):
    """Mass of one atom and where the adversary puts it."""

    atom: float
    """Log-return of the centre; an observed one, unless `problem.centre` says otherwise."""
    moved_to: float
    """Log-return in the worst case; equal to `atom` where the mass stays."""
    mass: float
    """A probability."""


class Uncertainty(TypedDict):
    """The uncertainty set of a state, in figures."""

    sample_size: int
    """Returns seen, those of the history among them."""
    effective_size: float
    """How many returns of equal weight tell as much: as many as were seen where `learning` is `equal`."""
    moments: list[float]
    """Raw moments of the law learned, first to the specification's count."""
    quantile: NotRequired[float | None]
    """
    (1 - alpha)-quantile of the bridge statistic; absent under other radius rules than `bridge` and `calibrated`. Under `bridge`
    it is exact for the history of the policy, and simulated in proportion to that after returns were learned.
    """
    radius: float
    """As in an advice."""


Unit: TypeAlias = Literal["fraction", "percent"]
"""What returns are counted in."""


class UtilityReport(TypedDict):
    """Terminal utility."""

    mean: Estimate
    """Over paths."""
    variance: Estimate
    """Over paths."""
    quantile_20: Estimate
    """A fifth of the paths end with less."""
    quantile_90: Estimate
    """Nine tenths of the paths end with less."""
    max: float
    """Of the paths of one history, averaged over histories; an extreme has no interval."""
    min: float
    """Of the paths of one history, averaged over histories; an extreme has no interval."""


class UtilitySpecification1(TypedDict):
    """`(1 - exp(-risk_aversion x)) / risk_aversion`, risk aversion per unit of wealth. Exactly one of its fields is given."""

    risk_aversion: NotRequired[float]
    """Absolute, per unit of wealth."""
    risk_aversion_relative: NotRequired[float | None]
    """The same times the initial wealth, without unit; a completed specification has the absolute one."""
    kind: Literal["exponential"]


class UtilitySpecification2(TypedDict):
    """`(x^(1 - risk_aversion) - 1) / (1 - risk_aversion)`, risk aversion above 1."""

    risk_aversion: float
    """Relative, without unit."""
    kind: Literal["power"]


class UtilitySpecification3(TypedDict):
    """`ln x`."""

    kind: Literal["log"]


UtilitySpecification: TypeAlias = UtilitySpecification1 | UtilitySpecification2 | UtilitySpecification3
"""Utility of terminal wealth, always maximised."""


WarningCode: TypeAlias = Literal["rate_high", "rate_above_record", "record_in_percent", "trading_cost_high"]
"""What is warned of."""


class WealthReport(TypedDict):
    """Terminal wealth, and how it came to be."""

    mean: Estimate
    """Over paths."""
    quantile_20: Estimate
    """A fifth of the paths end with less."""
    quantile_90: Estimate
    """Nine tenths of the paths end with less."""
    max: float
    """Of the paths of one history, averaged over histories; an extreme has no interval."""
    min: float
    """Of the paths of one history, averaged over histories; an extreme has no interval."""
    worst_twentieth: Estimate
    """The mean of the worst twentieth of the paths."""
    histogram: list[int]
    """Counts of the bins between `wealth_edges`, without the paths that end as all in the bank does."""
    at_bank: int
    """Paths that end as all in the bank does, to a billionth of it."""
    chance_of_loss: Estimate
    """Share of the paths that end with less than was put in: the initial wealth and all contributions."""
    max_drawdown: Estimate
    """
    Mean over paths of the largest fall on the way below the highest so far, as a share of it; what is added or withdrawn is
    neither gain nor fall.
    """


class WhyNothing(TypedDict):
    """Why an advice holds nothing: of several assets by the fund of inverse volatilities."""

    premium_seen: float
    """Mean simple return of the record beyond the bank, per step."""
    standard_error: float
    """Its standard error."""
    premium_left: NotRequired[float | None]
    """
    The least that it is under the laws in the ball: 0 or less, unless what is bought or sold costs something. Null of several
    assets, of each of which `worst_means` tells it.
    """
    at_half_the_caution: NotRequired[float | None]
    """Share of wealth that would be held within half of the radius, in all assets together; null where the radius is not simulated."""


class WithoutOne(TypedDict):
    """
    The range of the advice over the records that lack one return.

    Each distinct return is left out in turn. Of a record of more than 360, or of fewer where a step takes long, the returns that move
    the advice the most are: those furthest from the mean by their weight, and others evenly between by their rank. Checked by:
    tests/solver/sensitivity.rs against leaving out every one.
    """

    lowest: LeftOut
    """The lowest advice, and the return whose absence gives it."""
    highest: LeftOut
    """The highest advice, and the return whose absence gives it."""
    tried: int
    """Returns left out in turn."""


class WorstLawSummary(TypedDict):
    """The worst-case law in figures, of log-returns."""

    mean: float
    """Per step."""
    standard_deviation: float
    """Per root of a step."""
    share_moved: NotRequired[float | None]
    """Share of the probability that moves; absent where laws are normal, and none is a transport of what was seen."""
    lowest_destination: NotRequired[float | None]
    """Lowest log-return that mass moves to; absent where none moves."""


class WorstMean(TypedDict):
    """The mean of an asset's log-return."""

    seen: float
    """Of those seen."""
    worst: float
    """Under the worst law."""


class WorstNormalLaw(TypedDict):
    """The worst mean and variance of the log-return of one period, within the confidence region of the estimates."""

    mean: float
    """Of the log-return, per step."""
    variance: float
    """Of the log-return, per step."""
    estimated_mean: float
    """As the returns seen say, per step."""
    estimated_variance: float
    """As the returns seen say, per step."""


class Advice(TypedDict):
    """The robust allocation for the coming period and what it is worth."""

    allocation: float
    """Share of wealth to hold in the risky asset: the holding, brought to the nearer end of the band."""
    holding: float
    """Share of wealth in the risky asset before trading."""
    band: list[float]
    """The holdings that are best kept as they are; where trading costs nothing both ends are the allocation."""
    trade: float
    """The allocation less the holding: the share of wealth to buy, or where it is negative to sell."""
    contribution: float
    """Money added at the end of the period, withdrawn where it is negative."""
    certainty_equivalent: float
    """Certainty equivalent of the robust value, in terminal wealth."""
    floor: float
    """
    Terminal wealth of selling everything now and staying in the bank, with all that is added and withdrawn until then: no
    law can take it away.
    """
    radius: float
    """
    Radius of the uncertainty set: of the Wasserstein ball, in log-return; in the parametric frameworks half the width
    of the confidence region in the mean, in estimated standard deviations of a return.
    """
    sample_size: int
    """Returns seen, those of the history among them."""
    effective_size: float
    """How many returns of equal weight tell as much: as many as were seen where `learning` is `equal`."""
    surrogate_sd: float
    """Predicted standard deviation of the log certainty equivalent."""
    in_design: bool
    """Whether the state lies where the surrogates were trained."""
    source: AdviceSource
    """How it was found."""


class AssetsBacktestRequest(TypedDict):
    """A walk-forward through a record of several assets, by the one-step problem and by rules that people use."""

    assets: list[Asset]
    """Names of the assets, each another, in the order of the columns."""
    log_returns: NotRequired[list[LogReturn] | None]
    """Of the assets, date by date, oldest first, none left out. Exactly one of this and `simple_returns` is given."""
    simple_returns: NotRequired[list[SimpleReturn] | None]
    """`price / previous price - 1`, likewise."""
    rate: Rates
    """What the bank pays a period, as a fraction: one number for all, or one for each."""
    dates: list[str]
    """One for each period, evenly apart: `2008-01-31`, `2008-01` or `2008`."""
    periods_per_year: NotRequired[int | None]
    """Default: what `dates` tell."""
    windows: NotRequired[list[Window] | None]
    """How many of the last periods strategies know; null is all since the first. Default: 10 years, 20 years and all."""
    every: NotRequired[int | None]
    """Periods from one measuring of the radius, and one choice of the static strategy, to the next. Default: a year of them."""
    alpha: NotRequired[float | None]
    """Miscoverage of the radius. Default: 0.1."""
    support: NotRequired[Support]
    """The log-returns of each asset that the adversary may use."""
    risk_aversion: NotRequired[float]
    """Relative: 1 is log utility."""
    trading_cost: NotRequired[float]
    """Lost of what is traded, as a share of it; no strategy knows of it."""
    seed: NotRequired[int]
    """The same request and seed give the same report, bit for bit."""


class AssetsChoices(TypedDict):
    """How a record of several assets is walked through."""

    windows: list[int | None]
    """Periods that strategies know; null is all since the first."""
    every: int
    """Periods from one measuring of the radius, and one choice of the static strategy, to the next."""
    alpha: float
    """Miscoverage of the radius."""
    support: Support
    """The log-returns of each asset that the adversary may use."""
    risk_aversion: float
    """Relative."""
    trading_cost: float
    """Lost of what is traded, as a share of it."""
    seed: int
    """Of the bridges and of the resamples."""


class AssetsFigures(Performance):
    """One strategy in figures."""

    strategy: str
    """Its name."""
    kind: StrategyKind
    """Its kind."""
    place: int
    """Its place by `yearly_certainty_equivalent`, 1 the best; equal ones share it."""
    beyond_equal: NotRequired[BootstrapEstimate | None]
    effective_assets: NotRequired[float | None]
    """`(sum a)^2 / sum a^2`, the mean over the periods in which anything is held; null where nothing ever is."""
    mean_allocations: dict[str, float]
    """Share of wealth in each asset, by its name."""


class AssetsProblem(TypedDict):
    """What is known of several assets, and the investor who may hold them."""

    assets: list[Asset]
    """Names of the assets, each another, in the order of the columns of `history`."""
    ground_norm: NotRequired[GroundNorm]
    """What moving a law costs the adversary."""
    composition: NotRequired[CompositionRule]
    """How the shares of the assets in what is held are chosen, period after period."""
    horizon: NotRequired[int | None]
    """Number of decisions that a policy is trained for. Default: 10 of a policy, 1 of an advice."""
    rate_per_step: float
    """Bank return per step, as a fraction."""
    periods_per_year: NotRequired[float | None]
    """Periods of the history in a year: what is said a year is said with it. It changes no advice."""
    initial_wealth: NotRequired[float]
    """Wealth, in any currency."""
    action_interval: NotRequired[list[ActionIntervalItem]]
    """Share of wealth that may be held in all assets together: `[0, highest]`."""
    trading_cost: NotRequired[float]
    """Lost of what is moved between the bank and any asset, as a share of it. An advice takes it under power and log utility."""
    contributions: NotRequired[Contributions]
    """Money added at the end of each period, withdrawn where it is negative; none of an advice."""
    risk_aversion: NotRequired[float | None]
    """Relative risk aversion, in the place of `utility`: log utility at 1, power utility above."""
    utility: NotRequired[UtilitySpecification]
    """Of wealth at the horizon. Default: power utility, risk aversion 3."""
    radius: NotRequired[RadiusRule | None]
    caution: NotRequired[CautionLevel | None]
    support: NotRequired[Support | None]
    history: list[HistoryItem]
    """Log-returns, date by date, oldest first; each date has one for each asset."""


class BacktestFigures(Performance):
    """One strategy in figures."""

    strategy: str
    """Its name."""
    kind: StrategyKind
    """Its kind."""
    hindsight: bool
    """Whether it was chosen with what only the end could tell."""
    place: NotRequired[int | None]
    """Its place by `yearly_certainty_equivalent`, 1 the best; equal ones share it. Null in hindsight."""
    adaptive_ahead: BootstrapEstimate
    """The certainty equivalent of the main adaptive strategy less that of this one."""
    all_bank_share: float
    """Share of the periods with nothing in the risky asset."""


class Caution(TypedDict):
    """A reason to be careful with an advice."""

    code: CautionCode
    """For programs."""
    sentence: str
    """For people."""


class CautionLevels(TypedDict):
    """The shares of the radius that the levels act on, and what each costs, found from the record."""

    premiums: list[float]
    """
    Mean simple returns beyond the bank, per step, that the three worlds are supposed to have: none, half, and one of the
    premium seen, or 0 where it is negative, plus its standard error.
    """
    premium_seen: float
    """Premium seen: the mean simple return of the record beyond the bank, per step."""
    standard_error: float
    """Its standard error."""
    bold: CautionScale
    """Least worst regret, double regret in the world of the whole premium."""
    balanced: CautionScale
    """Least worst regret."""
    cautious: CautionScale
    """Least worst regret, double regret in the world without a premium."""
    paper: CautionScale
    """The whole radius."""


class CentreSpecification4(TypedDict):
    """
    The law of the returns seen, mixed with one that counts as so many more. Exactly one of `law` and `history` is given. With n
    returns seen the radius is theirs times n / (n + weight): the ball allows for what they may miss. That returns are drawn from
    the law given is the user's assumption, and the ball does not allow for its error.
    """

    law: NotRequired[SamplingLaw | None]
    history: NotRequired[list[HistoryItem1] | None]
    """As log-returns, all of the same weight: of another market, or of a longer record."""
    weight: float
    """Returns that the law given counts as. 0 is `empirical`."""
    kind: Literal["mixed"]


CentreSpecification: TypeAlias = CentreSpecification1 | CentreSpecification2 | CentreSpecification3 | CentreSpecification4
"""The law in the middle of the ball, made of the law of the returns seen: those of the history and those seen after it alike."""


class Choices(TypedDict):
    """What is said of a text; what is left out follows from it, or is asked."""

    columns: NotRequired[list[str]]
    """A column of returns or prices, by its name or its number from 1; several of them are several assets"""
    kind: NotRequired[Kind | None]
    unit: NotRequired[Unit | None]
    rate_unit: NotRequired[RateUnit | None]
    day_first: NotRequired[bool | None]
    """Whether 01/02/2020 is the first of February, and not the second of January"""
    newest_first: NotRequired[bool | None]
    """Whether the first row is the newest, where no dates tell"""
    decimal_comma: NotRequired[bool | None]
    """Whether a comma is the decimal mark"""
    comma_parts: NotRequired[bool | None]
    """Whether a comma parts numbers, and is not within them"""
    one_record: NotRequired[bool | None]
    """Whether numbers in several columns are one record, line by line"""
    gaps: NotRequired[bool | None]
    """Whether a record from which periods are missing is taken as it is, without the rows that have no number"""
    unusual: NotRequired[bool | None]
    """
    Whether what is unusual of an asset is right: a deviation above 30 % a period or 150 % a year, a mean above 100 % a year
    beyond chance, or a return far from all others
    """
    excess: NotRequired[bool | None]
    """Whether the returns are those beyond the bank, to which what its column says is added"""
    latest: NotRequired[int | None]
    """How many of the last returns count; all of them unless given"""


class ColumnFound(TypedDict):
    """A column that was found."""

    name: str
    """Its heading, or its number; empty where the text is one run of numbers."""
    holds: Holds
    """What it holds."""


class CoverageAtSize(TypedDict):
    """How often the ball held the true law at one sample size."""

    sample_size: int
    """Returns known then."""
    covered: Estimate
    """Share of the paths."""


class DesignSpecification(TypedDict):
    """Which states the surrogates are trained on."""

    accuracy: NotRequired[float | None]
    """
    Basis points of the certainty equivalent by which the value served may be off, as a root mean square over the states of a
    step, the errors of the steps after it included. Design points are added until fresh states say that it is reached.
    Default 0.5 where there is no `count`; where the state is wealth alone, `count` decides.
    """
    count: NotRequired[int | None]
    """Design points per step, N; with an `accuracy`, at most. Default 1000; 200 where the state is wealth alone."""
    initial_laws: NotRequired[InitialLaws]
    """Where the empirical laws of the design start."""
    sampling_law: NotRequired[SamplingLaw | None]
    wealth: NotRequired[Interval | None]


class Difference(TypedDict):
    """A paired difference to the reference."""

    utility: Estimate
    """Of mean terminal utility."""
    certainty_equivalent: Estimate
    """Of the certainty equivalent, in terminal wealth."""


class Doubt(TypedDict):
    """Something in a report that is most likely a slip."""

    reason: DoubtReason
    field: str
    """Dotted path of the field."""
    value: Any
    """Content of the field."""
    sentence: str
    """The doubt, in one sentence."""
    missing: NotRequired[list[str]]
    """Last days of the periods missing before the one reported, unless they are more than 120."""


class Drift(TypedDict):
    """
    A bet that the order of the returns means something. It wins where new returns lie further from the median of all than those
    before them did: their volatility or their mean has changed.
    """

    p_value: NotRequired[float | None]
    """Of the last return: how much of the record lies as far from its median. Null where none was observed."""
    capital: float
    """What a capital of 1 has become, at most 1e12."""
    highest: float
    """The most that it ever was: of sessions where nothing changes, a share of at most 1 / c ever sees c."""
    level: DriftLevel
    """By the highest: `warning` from 20 on, `alarm` from 100 on."""


class FundSpecification(TypedDict):
    """What a policy for several assets knows beside the problem of their fund, whose shares are those of inverse volatilities."""

    assets: list[Asset]
    """Names of the assets."""
    ground_norm: GroundNorm
    """What moving a law costs the adversary."""
    composition: CompositionRule
    """How the shares of the assets in what is held are chosen."""
    radius_factor: float
    """
    What the radius of one fund was multiplied by, for laws of all funds to lie in their balls at once: the scale of the
    problem's radius holds it. 1 under rules that look at the sample size alone.
    """
    history: list[HistoryItem2]
    """Log-returns, date by date, oldest first; each date has one for each asset."""


class JobProgress(TypedDict):
    """How far a job is."""

    steps_done: int
    steps_total: int
    step: NotRequired[int | None]
    """The step being solved; steps are solved from the last to the first. Null in a simulation."""
    phase: NotRequired[Phase | None]
    points_done: NotRequired[int | None]
    """Design points solved, or paths simulated, in this step."""
    points_total: NotRequired[int | None]
    seconds_left: NotRequired[float | None]


class NextReturn(TypedDict):
    """
    What one more return would change.

    Returns are tried from the lowest of the record less half the distance between its extremes to the highest and half of it
    more, within `support` where there is one: at 49 of them, evenly, and between neighbours of which one is advised an end of
    the action interval and the other is not, by halving, to 1e-6. The advice need not rise with the return, for one far out
    widens the radius whichever side it lies on: of several crossings the one nearest to the median is told, and a pair of them
    between two neighbours is missed. Checked by: tests/solver/sensitivity.rs on a finer grid.
    """

    range: list[float]
    """The lowest and the highest log-return tried."""
    to_bank: NotRequired[Return | None]
    to_highest: NotRequired[Return | None]
    low: NextAdvice
    """After a return at the 5 % quantile of the record."""
    high: NextAdvice
    """After a return at the 95 % quantile of the record."""


class Now(TypedDict):
    """A period with all corrections made."""

    reported: NotRequired[Report | None]
    log_return: NotRequired[float | None]
    """Null where it is missing."""
    assets: NotRequired[AssetsNow | None]
    advised_allocation: float
    """What would have been advised for it."""
    executed_allocation: float
    wealth: float
    """Wealth at its end."""
    holding: float
    """Share of it in the risky asset."""
    date: NotRequired[str | None]
    """Its last day, where it is known."""
    radius: float
    """Radius of the uncertainty set after it, in the unit of an advice's."""


class OneStep(TypedDict):
    """The one-step problem of several assets, by their names."""

    allocation: dict[str, float]
    """Shares of wealth that are best for who looks one period ahead."""
    certainty_equivalent: float
    """Wealth for certain after the period that they are worth against the worst law: at least this."""
    bound: float
    """No allocation is worth more than this."""
    worst_means: dict[str, WorstMean]
    """What the worst law makes of each asset."""
    caution: NotRequired[list[Caution]]
    """What to know before the allocation is followed; left out where there is nothing."""


class OpenSession(TypedDict):
    """A session to open."""

    policy: str
    """The policy to live by."""
    history: NotRequired[KnownReturns | None]
    wealth: NotRequired[float | None]
    """Default: the policy's initial wealth."""
    holding: NotRequired[float | None]
    """Share of wealth in the risky asset at the start. Default: 0."""
    holdings: NotRequired[dict[str, float]]
    """Share of wealth in each of several assets at the start, by their names. Default: 0."""
    renew: NotRequired[Renewing | None]
    rolling: NotRequired[bool]
    """Live every period by the first step of a policy whose learning is decay, for up to 5200 periods. Default: false."""
    name: NotRequired[str | None]
    """What the session is called, in at most 100 letters."""
    notes: NotRequired[str | None]
    """At most 2,000 letters."""
    tags: NotRequired[list[Tag] | None]
    """At most 20, each another, of 1 to 50 letters."""


class PeriodReport(TypedDict):
    """One period over all paths."""

    period: int
    """From 1."""
    sample_size: int
    """Returns known at its start."""
    allocation: Spread
    """Share of wealth held in the risky asset."""
    all_bank_share: float
    """Share of paths that held nothing in the risky asset."""
    radius: NotRequired[RadiusSpread | None]


class Problem(TypedDict):
    """A problem document (RFC 9457)."""

    type: str
    """Stable reference of the kind of problem: `/problems/<slug>`."""
    title: str
    status: int
    detail: str
    """This occurrence, in one sentence."""
    field: NotRequired[str | None]
    """Dotted path of the offending field, header or parameter; every problem that the client can mend names it."""
    value: NotRequired[Any]
    """What the field held."""
    rule: NotRequired[str | None]
    """What the field must be."""
    doubts: NotRequired[list[Doubt] | None]
    """All that is doubted in a report; with `confirm` it is recorded."""


class ProblemSpecification(TypedDict):
    """The investor, the asset, and what is known of its returns."""

    framework: NotRequired[Framework]
    """What the investor is robust against."""
    horizon: NotRequired[int]
    """Number of allocation decisions, T."""
    rate_per_step: float
    """Bank return per step, r, as a fraction: wealth in the bank grows by the factor 1 + r. 3 % a year are 0.00247 a month."""
    periods_per_year: NotRequired[float | None]
    """Periods of the history in a year, 12 where they are months: what is said a year is said with it. It changes no advice."""
    initial_wealth: NotRequired[float]
    """x_0, in any currency."""
    action_interval: NotRequired[list[ActionIntervalItem]]
    """Share of wealth that may be held in the risky asset: `[0, highest]`."""
    trading_cost: NotRequired[float]
    """Lost of what is moved between bank and asset, as a share of it, both ways alike."""
    contributions: NotRequired[Contributions]
    """Money added at the end of each period, withdrawn where it is negative: one number for all, or `horizon` numbers."""
    risk_aversion: NotRequired[float | None]
    """Relative risk aversion, in the place of `utility`: log utility at 1, power utility above."""
    utility: NotRequired[UtilitySpecification]
    """Of terminal wealth. Default: power utility, risk aversion 3."""
    learning: NotRequired[Learning]
    """What older returns weigh in the law that is learned."""
    centre: NotRequired[CentreSpecification]
    """What the ball is centred on. `known_law` and the parametric frameworks, which have no ball, take no other than the default."""
    radius: NotRequired[RadiusRule | None]
    caution: NotRequired[CautionLevel | None]
    levels: NotRequired[CautionLevels | None]
    support: NotRequired[Support | None]
    law: NotRequired[SamplingLaw | None]
    history: list[HistoryItem3]
    """The log-returns observed before the start, at least two of them distinct."""


class ReadReturns(TypedDict):
    """A text, and what is said of it."""

    text: str
    """As it was pasted, or stands in a file: at most 8 MB."""
    choices: NotRequired[Choices]
    """Nothing at first, then the answers to what is asked."""


class RenewalDue(TypedDict):
    """Where a renewal is that is due."""

    renewal: int
    """Its number."""
    state: RenewalState
    job: NotRequired[str | None]
    """The job that trains the policy, or last did; null before there is one."""
    error: NotRequired[str | None]
    """Why the last attempt failed."""
    attempts: int
    """Jobs so far."""


class Sensitivity(TypedDict):
    """How near an advice is to changing."""

    without_one: NotRequired[WithoutOne | None]
    next_return: NextReturn
    """With one more return."""
    premium: Premium
    """With another mean, and with more returns like those seen."""


class Series(TypedDict):
    """Returns of one asset."""

    column: str
    """The name of its column; empty where the text is one run of numbers."""
    kind: Kind
    """What the column holds."""
    unit: NotRequired[Unit | None]
    log_returns: list[float]
    """Returns as the service takes them."""
    mean: float
    """Mean of the simple returns of a period."""
    deviation: float
    """Their standard deviation."""
    mean_per_year: NotRequired[float | None]
    """Mean of a year, compounded: `(1 + mean)^p - 1` of p periods."""
    deviation_per_year: NotRequired[float | None]
    """Deviation times the square root of the periods of a year."""


class SessionEntry(Labels):
    """A session in a list."""

    session: str
    policy: str
    """The one that advises the coming period."""
    policy_name: str
    """What that is called; empty where it is called nothing."""
    periods_per_year: NotRequired[float | None]
    """Of that policy, where it says."""
    period: int
    """The coming period, from 1; `horizon + 1` once completed."""
    horizon: int
    """The last period that the policy advises."""
    state: SessionState
    initial_wealth: float
    wealth: float
    holding: float
    """Share of wealth in the risky asset, before trading."""
    wealth_change: NotRequired[float | None]
    """Change of wealth by the last period; null before the first."""
    date: NotRequired[str | None]
    """The last day that was reported."""
    last_report_ms: NotRequired[int | None]
    """When it last reported a period, or put one right."""
    next: NotRequired[str | None]
    """
    The last day on which its next report is not overdue, by how many periods a year its policy has: a period after the last day
    reported, else after the day, in UTC, of the last report or of its opening. Null where that is not known, or it is completed.
    """
    care: list[CareReason]
    """Why it needs care, where it does."""
    deviation: NotRequired[float | None]
    """
    Standard deviation of the log-returns learned; of several assets, of their fund. Null before the first report, or where the
    policy tells fewer than two moments.
    """
    drift: DriftLevel
    """Whether the returns still come as they came."""
    created_ms: int


class SessionPage(TypedDict):
    """A page of sessions."""

    sessions: list[SessionEntry]
    damaged: list[str]
    """
    Sessions of this page that are not what was written: nothing of them is shown, and a call for one gets 500 until an
    operator has restored it.
    """
    total: NotRequired[int | None]
    """Sessions that match, on all pages together; null unless `count` asks for it."""
    care: NotRequired[CareCount | None]
    next: NotRequired[str | None]
    """Give it as `after` for the next page; null on the last."""


class StepDiagnostics(TypedDict):
    """How well a step was solved."""

    step: int
    """Periods observed before it."""
    design_count: int
    """Design points solved."""
    all_bank_share: float
    """Share of the design points at which the robust allocation of who holds nothing yet is zero."""
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


class SurrogateSpecification(TypedDict):
    """How the surrogates are made."""

    target: NotRequired[SurrogateTarget]
    """What the value surrogate regresses."""
    features: NotRequired[FeatureMap]
    """What the surrogates see of a state."""
    moment_count: NotRequired[int]
    """Number of moments of the law that enter the features; at most two in the parametric frameworks, whose law has no more."""
    bounds: NotRequired[HyperparameterBounds]
    """Where the hyperparameters are searched."""


class Sweep(TypedDict):
    """Exactly one range."""

    holding: NotRequired[SweepRange | None]
    log_return: NotRequired[SweepRange | None]
    radius: NotRequired[SweepRange | None]
    radius_scale: NotRequired[SweepRange | None]
    simple_return: NotRequired[SweepRange | None]
    wealth: NotRequired[SweepRange | None]


class Train(TypedDict):
    """A training: its specification, and what its policy is to be called, which is no part of that."""

    problem: ProblemSpecification
    """What the investor is and may do."""
    fund: NotRequired[FundSpecification | None]
    design: NotRequired[DesignSpecification]
    """Where the surrogates are trained."""
    surrogate: NotRequired[SurrogateSpecification]
    """How the surrogates are made."""
    seed: NotRequired[int]
    """The same specification and seed give the same policy, bit for bit."""
    name: NotRequired[str | None]
    """What the policy is to be called, in at most 100 letters."""
    notes: NotRequired[str | None]
    """At most 2,000 letters."""
    tags: NotRequired[list[Tag] | None]
    """At most 20, each another, of 1 to 50 letters."""


class TrainAssets(TypedDict):
    """A training of a policy for several assets."""

    problem: AssetsProblem
    """The assets and the investor."""
    design: NotRequired[DesignSpecification]
    """Where the surrogates are trained; laws start resampled."""
    surrogate: NotRequired[SurrogateSpecification]
    """How the surrogates are made."""
    seed: NotRequired[int]
    """The same request and seed give the same policy, bit for bit."""
    name: NotRequired[str | None]
    """What the policy is to be called, in at most 100 letters."""
    notes: NotRequired[str | None]
    """At most 2,000 letters."""
    tags: NotRequired[list[str] | None]
    """At most 20, each another, of 1 to 50 letters."""


TrainQuestion: TypeAlias = Train | TrainAssets
"""A training of a policy for one asset, or for several, which `problem.assets` names."""


class Warning(TypedDict):
    """Something in a sound request that may be a mistake."""

    code: WarningCode
    """What is warned of."""
    field: str
    """Dotted path in the request."""
    message: str
    """What it holds, what that means, and what it should hold if something else was meant, in sentences."""


class WhatIf(TypedDict):
    """What is supposed of a session. What is not given stays as it is."""

    session: str
    wealth: NotRequired[float | None]
    """Wealth now."""
    holding: NotRequired[float | None]
    """Share of wealth in the risky asset now, before trading."""
    radius_scale: NotRequired[float | None]
    """Factor on the radius of the uncertainty set of the period advised; later periods keep their own."""
    radius: NotRequired[float | None]
    """That radius itself, in the unit of an advice's."""
    log_return: NotRequired[float | None]
    """Return of the coming period, the advised allocation held through it; the advice is for the period after."""
    simple_return: NotRequired[float | None]
    """The same as `price / previous price - 1`."""
    holdings: NotRequired[dict[str, float]]
    """Of several assets, by their names, each of which has one: share of wealth in it now, before trading."""
    log_returns: NotRequired[dict[str, float]]
    """Of several assets, returns of the coming period, in one of three ways; the advice is for the period after."""
    simple_returns: NotRequired[dict[str, float]]
    """The same as `price / previous price - 1`."""
    prices: NotRequired[dict[str, float]]
    """Prices of several assets at the end of the coming period."""
    previous_prices: NotRequired[dict[str, float]]
    """Their prices at its start. Default: those reported for the period before."""
    explain: NotRequired[Explain | None]
    sweep: NotRequired[Sweep | None]


class WorstCase(TypedDict):
    """
    The law that is worst for the advised allocation: a transport of the ball's centre, or, in the parametric frameworks, a
    normal law.
    """

    multiplier: float
    """Lagrange multiplier of the uncertainty set: utility lost per unit of extra radius."""
    radius_cost: float
    """
    The same in log certainty equivalent: the slope at this radius, of this period's ball alone. A wider ball costs at most that
    times what it is wider by, and at most all that the advice is worth above the floor.
    """
    transport: list[TransportedMass]
    """Empty in the parametric frameworks."""
    normal: NotRequired[WorstNormalLaw | None]
    duality_gap: float
    """Difference between primal and dual value, in log certainty equivalent; 0 in the parametric frameworks."""
    sentence: str
    """The worst case in one plain sentence."""


class Action(Advice):
    """The robust allocation of one asset for the coming period."""

    session: str
    period: int
    worst_case: NotRequired[WorstCase | None]
    caution: list[Caution]
    """What to know before the advice is followed."""
    sensitivity: NotRequired[Sensitivity | None]


class Advise(TypedDict):
    """A question for one period."""

    problem: ProblemSpecification
    """As in a training, for a horizon of 1, which may be left out."""
    wealth: NotRequired[float | None]
    """Wealth now. Default: the problem's initial wealth."""
    holding: NotRequired[float | None]
    """Share of wealth in the risky asset now, before trading. Default: 0."""
    seed: NotRequired[int]
    """Of the simulated bridges."""
    sensitivity: NotRequired[bool]
    """Whether to say how near the advice is to changing."""


class AdviseAssets(TypedDict):
    """A question for one period of several assets."""

    problem: AssetsProblem
    """The assets and the investor."""
    wealth: NotRequired[float | None]
    """Wealth now. Default: the problem's initial wealth."""
    holdings: NotRequired[dict[str, float]]
    """Share of wealth in each asset now, before trading, by its name. Default: nothing of any."""
    seed: NotRequired[int]
    """Of the simulated bridges."""


AdviseQuestion: TypeAlias = Advise | AdviseAssets
"""A question about one asset, or about several, which `problem.assets` names."""


class Advised(Advice):
    """The advice, and the law that is worst for it."""

    worst_case: WorstCase
    caution: list[Caution]
    """What to know before the advice is followed."""
    levels: NotRequired[LevelsAdvised | None]
    why_nothing: NotRequired[WhyNothing | None]
    sensitivity: NotRequired[Sensitivity | None]
    annualised: NotRequired[Annualised | None]
    warnings: list[Warning]
    """What in the question may be a mistake."""


class Answer(TypedDict):
    """One answer to a question."""

    label: str
    """In words."""
    choices: Choices
    """What to add to `choices`."""
    sentence: NotRequired[str | None]
    """What would be read, where that is one thing."""


class AssetsAdvice(TypedDict):
    """What to hold of several assets through the coming period."""

    allocation: dict[str, float]
    """Share of wealth in each asset; the rest is in the bank."""
    trade: dict[str, float]
    """The allocation less the holdings: shares of wealth to buy, or where they are negative to sell."""
    composition: dict[str, float]
    """Share of each asset in what is held; where next to nothing is, that of inverse volatilities."""
    total: float
    """Share of wealth in all assets together."""
    without_crash: NotRequired[float | None]
    """
    The same were no log-return below the lowest seen of any asset: what it is above `total` is the part of the caution that
    is for a crash which nobody has seen. Null where `problem.support` rules one out already.
    """
    certainty_equivalent: float
    """Wealth for certain that is worth as much as the allocation is against the worst law, less what trading costs: at least this."""
    bound: float
    """No allocation is worth more than this."""
    floor: float
    """Wealth of selling everything now and staying in the bank."""
    radius: float
    """Radius of the ball, in log-return."""
    radius_factor: float
    """
    Factor by which the radius of the fund of inverse volatilities is widened to hold for all funds at once. It errs low: by little
    where assets move together, by more than a tenth for a dozen that are independent.
    """
    levels: NotRequired[LevelsAdvised | None]
    sample_size: int
    """Number of dates seen."""
    worst_means: dict[str, WorstMean]
    """What the law behind `bound` makes of each asset, which is the worst law where the two sides meet."""
    caution: list[Caution]
    """What to know before the advice is followed."""


class AssetsAdvised(AssetsAdvice):
    """The advice on several assets."""

    why_nothing: NotRequired[WhyNothing | None]
    annualised: NotRequired[Annualised | None]
    warnings: list[Warning]
    """What in the question may be a mistake."""


class AssetsBacktestReport(TypedDict):
    """Strategies that lived through a record of several assets. The same record and choices give the same report, bit for bit."""

    format: str
    """`ballast-backtest-assets-1`."""
    assets: list[str]
    """Names, in the order of the columns."""
    frequency: str
    """`daily`, `weekly`, `monthly`, `quarterly` or `yearly`."""
    periods_per_year: int
    """Periods in a year."""
    dates: list[str]
    """Of the periods decided about."""
    whole_years: int
    """Whole years decided about, whose utility is taken; the last ends with the last period."""
    uncounted_periods: int
    """The first periods decided about, fewer than a year, which count in none of them."""
    choices: AssetsChoices
    """As completed."""
    intervals: BacktestIntervals
    """How the intervals were made."""
    strategies: list[AssetsFigures]
    """One strategy in figures each."""
    periods: list[AssetsPeriods]
    """What each strategy did, in their order."""
    sentences: list[str]
    """What the figures say, the most important first."""


class BacktestChoices(TypedDict):
    """The choices of a walk-forward."""

    window: int
    """Periods of history that each policy was trained on."""
    every: int
    """Periods from one training to the next."""
    horizon: int
    """Periods that a policy looked ahead."""
    alpha: list[float]
    """Levels of the adaptive strategies."""
    scale: float
    """Multiple of the radius of every ball."""
    caution: CautionLevel
    """Share of every radius that was acted on."""
    support: Support
    """What the adversary could use."""
    centre: CentreSpecification
    """What the balls are centred on."""
    risk_aversion: float
    """Relative."""
    trading_cost: float
    """Lost of what is traded, as a share of it."""
    cost_blind: bool
    """Whether every policy was trained as if trading were free."""
    count: int
    """Design points per step."""
    seed: int
    """Of every training, and of the resamples."""


class BacktestReport(TypedDict):
    """Strategies that lived through a record of returns. The same request gives the same report, bit for bit."""

    format: str
    """`ballast-backtest-1`."""
    frequency: NotRequired[str | None]
    """`daily`, `weekly`, `monthly`, `quarterly` or `yearly`; null where the periods have no dates."""
    periods_per_year: int
    """Periods in a year."""
    dates: NotRequired[list[str] | None]
    """Of the periods decided about, those after the first window; null where the periods have none."""
    whole_years: int
    """Whole years decided about, whose utility is taken; the last ends with the last period."""
    uncounted_periods: int
    """The first periods decided about, fewer than a year, which count in none of them."""
    choices: BacktestChoices
    """As completed."""
    intervals: BacktestIntervals
    """How the intervals were made."""
    strategies: list[BacktestFigures]
    """One strategy in figures each."""
    periods: list[BacktestPeriods]
    """What each strategy did, in their order."""
    sentences: list[str]
    """What the figures say, the most important first."""


class BacktestRequest(TypedDict):
    """
    A walk-forward through a record of returns: every so many periods policies are trained on the window before, and lived by
    until the next.
    """

    log_returns: NotRequired[list[LogReturn1] | None]
    """Of the risky asset, oldest first, none left out. Exactly one of this and `simple_returns` is given."""
    simple_returns: NotRequired[list[SimpleReturn1] | None]
    """`price / previous price - 1`, likewise."""
    rate: Rates
    """What the bank pays a period, as a fraction: one number for all, or one for each."""
    dates: NotRequired[list[str] | None]
    """One for each period, evenly apart: `2008-01-31`, `2008-01` or `2008`. They tell the periods of a year."""
    periods_per_year: NotRequired[int | None]
    """Default: what `dates` tell; required without them."""
    window: NotRequired[int | None]
    """Periods of history that each policy is trained on. Default: 20 years of them, or half of a record that has no year beside."""
    every: NotRequired[int | None]
    """Periods from one training to the next. Default: a year of them, at most `horizon`."""
    horizon: NotRequired[int | None]
    """Periods that a policy looks ahead. Default: `every`."""
    alpha: NotRequired[list[AlphaItem]]
    """Levels of the adaptive strategies; the static one takes the second, or the only one."""
    scale: NotRequired[float]
    """Multiple of the radius of every ball."""
    caution: NotRequired[CautionLevel]
    """The share of every radius that is acted on: a level is found anew for every training."""
    support: NotRequired[Support]
    """The log-returns that the adversary may use."""
    centre: NotRequired[CentreSpecification]
    """What the balls are centred on, and what “Trusts the record” takes for the law."""
    risk_aversion: NotRequired[float]
    """Relative: 1 is log utility."""
    trading_cost: NotRequired[float]
    """Lost of what is traded, as a share of it; policies are trained with it."""
    cost_blind: NotRequired[bool]
    """Train every policy as if trading were free."""
    count: NotRequired[int]
    """Design points per step."""
    seed: NotRequired[int]
    """The same request and seed give the same report, bit for bit."""


class Composed(TypedDict):
    """Several assets before the coming period, by their names."""

    composition: dict[str, float]
    """Share of each asset in what is advised to be held; they sum to 1."""
    holdings: dict[str, float]
    """Share of wealth in each asset, before trading."""
    one_step: NotRequired[OneStep | None]


class Corrected(Uncertainty):
    """The session after a correction."""

    session: str
    correction: int
    period: int
    """The period put right, put in or taken out."""
    log_return: NotRequired[float | None]
    """What it is now; null where it is missing or taken out."""
    observed: int
    """Periods observed now."""
    wealth: float
    """Wealth now."""
    holding: float
    """Share of it in the risky asset."""
    assets: NotRequired[Composed | None]
    wealth_change: float
    """Change of wealth by the last period observed, as it stands now."""
    date: NotRequired[str | None]
    """The last day of the last period, where it is known."""
    drift: Drift
    """Whether the returns, as they stand, come as they came."""


class Correction(Correct):
    """One correction, as it was made."""

    told: Corrected
    """What was answered to it."""
    corrected_ms: int


class Coverage(TypedDict):
    """How often the ball held the true law."""

    target: NotRequired[float | None]
    """1 - alpha, under a radius rule that has one."""
    by_sample_size: list[CoverageAtSize]
    """Ascending; one entry where the ball is frozen."""
    ever_left: Estimate
    """Share of paths on which some period's ball did not hold it."""


class EvaluationRequest(TypedDict):
    """A comparison of strategies on common simulated returns."""

    problem: ProblemSpecification
    """
    As in a training; `framework` is left out, and `law` is the true law that returns are drawn from (default: the
    design's sampling law).
    """
    design: NotRequired[DesignSpecification]
    """As in a training."""
    surrogate: NotRequired[SurrogateSpecification]
    """As in a training."""
    seed: NotRequired[int]
    """The same request and seed give the same report, but for its costs."""
    frameworks: NotRequired[list[Framework]]
    """Frameworks to compare."""
    constant_mixes: NotRequired[list[ConstantMix] | None]
    """Constant allocations to compare; 0 is All in the bank. Default: 0 to 1 by 0.1, as far as the actions go."""
    policies: NotRequired[dict[str, str]]
    """A trained policy for a framework; the others are trained inside the job."""
    paths: NotRequired[int]
    """Simulated paths per initial history."""
    histories: NotRequired[InitialHistories]
    """Which histories paths start from."""
    level: NotRequired[float]
    """Confidence of the intervals."""


FrontierProblem: TypeAlias = ProblemSpecification | AssetsProblem
"""The problem of one asset, or of several, which `assets` names."""


class FrontierRequest(TypedDict):
    """A record, an investor, and the radii to try."""

    problem: FrontierProblem
    """One asset as in `/advise`, or several."""
    scales: NotRequired[list[Scale]]
    """Multiples of the radius of the rule, ascending. 0 takes the record for the law."""
    resamples: NotRequired[int | None]
    """Resampled records of each kind. Default: 400 of one asset, 60 of several, whose steps take longer."""
    block: NotRequired[int | None]
    """Periods in a row that are drawn together, 1 to half of the record. Default: the cube root of its length."""
    seed: NotRequired[int]
    """Of the resamples and of the simulated bridges."""


class FundAdvice(Composed):
    """What to hold of several assets through a period, by a policy of their fund."""

    allocation: dict[str, float]
    """Share of wealth to hold in each asset; the rest is in the bank."""
    total: float
    """Share of wealth in all assets together."""
    trade: dict[str, float]
    """The allocation less the holdings: shares of wealth to buy, or where they are negative to sell."""
    band: list[float]
    """The totals that are best kept as they are; where trading costs nothing both ends are the total."""
    contribution: float
    """Money added at the end of the period, withdrawn where it is negative."""
    certainty_equivalent: float
    """Certainty equivalent, in terminal wealth, of going on with this composition: the promise that a later one never breaks."""
    floor: float
    """Terminal wealth of selling everything now and staying in the bank."""
    radius: float
    """Radius of the ball around the law of the fund, in log-return."""
    sample_size: int
    """Dates seen, those of the history among them."""
    surrogate_sd: float
    """Predicted standard deviation of the log certainty equivalent."""
    in_design: bool
    """Whether the state of the fund lies where the surrogates were trained."""
    source: AdviceSource
    """How the total was found."""


class Job(TypedDict):
    """A job."""

    job: str
    kind: JobKind
    state: JobState
    cancel_requested: bool
    """A cancel was asked for; the worker stops within a second."""
    progress: JobProgress
    policy: NotRequired[str | None]
    """The policy of a succeeded training."""
    report: NotRequired[str | None]
    """Where the report of a succeeded evaluation or walk-forward is."""
    error: NotRequired[str | None]
    """Why it failed."""
    created_ms: int
    started_ms: NotRequired[int | None]
    finished_ms: NotRequired[int | None]


class JobPage(TypedDict):
    """A page of jobs, newest first."""

    jobs: list[Job]
    next: NotRequired[int | None]
    """Give it as `after` for the next page; null on the last."""


class ObservedAssets(Composed):
    """A period of several assets, by their names."""

    log_returns: NotRequired[dict[str, float]]
    """Null where they are missing."""
    advised_allocations: dict[str, float]
    """Share of wealth in each asset that was advised."""
    executed_allocations: dict[str, float]
    """Share of wealth in each asset that was held."""


class Question(TypedDict):
    """What cannot be told from the text."""

    asks: str
    """The choice that is asked for, as `choices` names it."""
    question: str
    """In words."""
    options: list[Answer]
    """Each of them settles it."""


class Reading2(TypedDict):
    """It may be several."""

    questions: list[Question]
    """What would settle it."""
    columns: list[ColumnFound]
    """The columns, where they are known."""
    outcome: Literal["asked"]


class Record(TypedDict):
    """Returns of one asset or several, oldest first."""

    sentence: str
    """What was read, for a person to check."""
    columns: list[ColumnFound]
    """All that the text has."""
    series: list[Series]
    """Those that were read, all of one length."""
    count: int
    """Returns there are, of which `latest` may have taken fewer."""
    dates: NotRequired[list[str] | None]
    """When each period ended, in ISO 8601, as fine as the frequency; absent where no dates were understood."""
    frequency: NotRequired[str | None]
    """`daily`, `weekly`, `monthly`, `quarterly` or `yearly`, where the dates say so."""
    periods_per_year: NotRequired[int | None]
    """How many periods make a year, where the dates say so."""
    newest_first: bool
    """
    Whether the first row was the newest, so that the rows are turned round: as their dates tell, or as it was said where
    there are none.
    """
    rate: NotRequired[BankRate | None]
    remarks: list[str]
    """What was changed or passed over, in sentences; the last of `sentence`."""


class Renewed(Uncertainty):
    """The session after a renewal."""

    session: str
    renewal: int
    policy: str
    period: int
    """The coming period, the first that the policy advises."""
    horizon: int
    """The last period that it advises."""
    terms: Terms
    """Rate, cost and flows of its periods, where none other are reported."""
    assets: NotRequired[Composed | None]


class Session(Labels):
    """A live investor."""

    session: str
    policy: str
    """The one that advises the coming period."""
    period: int
    """The coming period, from 1; `horizon + 1` once completed."""
    horizon: int
    """The last period that the policy advises."""
    state: SessionState
    date: NotRequired[str | None]
    """The last day of the last period: as reported, else the next one due after those before it. Null where no day is known."""
    next: NotRequired[str | None]
    """
    The last day of the coming period, by the policy's periods a year, else by the days reported; a report without a day
    takes it. Null where that is not known, or it is completed.
    """
    wealth: float
    holding: float
    """Share of wealth in the risky asset, before trading; of several assets in all of them."""
    assets: NotRequired[Composed | None]
    sample_size: int
    corrections: int
    """Corrections of what periods reported; the next one is this and one more."""
    renewals: int
    """Policies that followed the first; the next renewal is this and one more."""
    renew: NotRequired[Renewing | None]
    rolling: bool
    """Whether the first step of the policy advises every period."""
    renewal: NotRequired[RenewalDue | None]
    drift: Drift
    """Whether the returns still come as they came."""
    created_ms: int


class Specification(TypedDict):
    """A whole training job."""

    problem: ProblemSpecification
    """What the investor is and may do; of several assets, with their fund in the place of one."""
    fund: NotRequired[FundSpecification | None]
    design: NotRequired[DesignSpecification]
    """Where the surrogates are trained."""
    surrogate: NotRequired[SurrogateSpecification]
    """How the surrogates are made."""
    seed: NotRequired[int]
    """The same specification and seed give the same policy, bit for bit."""


class StrategyReport(TypedDict):
    """One strategy."""

    strategy: str
    """Its name: `Cautious, learns`, `50 % in stocks`, `All in the bank` and the like."""
    framework: NotRequired[Framework | None]
    constant_mix: NotRequired[float | None]
    """The allocation of a constant mix."""
    policy: NotRequired[str | None]
    """The policy followed; null for constant mixes and where each history had its own."""
    utility: UtilityReport
    """
    Utility of terminal wealth, counted from `floor`: `(U(x) - U(floor)) / (floor U'(floor))`, so that no digits are lost at high risk
    aversion or wealth.
    """
    certainty_equivalent: Estimate
    """Terminal wealth that is worth as much for certain."""
    wealth: WealthReport
    """Terminal, in units of the initial wealth's currency, and what it went through."""
    difference: NotRequired[Difference | None]
    own_mix: NotRequired[OwnMix | None]
    histogram: list[int]
    """Counts of the bins between `histogram_edges`."""
    periods: NotRequired[list[PeriodReport] | None]
    """Period by period; null for constant mixes."""
    coverage: NotRequired[Coverage | None]
    resolved_share: NotRequired[float | None]
    """Share of steps advised by solving the step anew."""


class WhatIfPoint(Advice):
    """The advice under one hypothesis."""

    period: int
    """The period advised."""
    wealth: float
    """Wealth at its start."""
    log_return: NotRequired[float | None]
    """The return supposed, if one was."""
    radius_scale: NotRequired[float | None]
    """The factor on the radius supposed, if one was."""
    gamma: NotRequired[float | None]
    """Lagrange multiplier of the ball: utility lost per unit of extra radius. Where the step was solved."""
    worst_law: NotRequired[WorstLawSummary | None]
    worst_case: NotRequired[WorstCase | None]


class AcceptedJob(Job):
    """A job that was accepted."""

    warnings: list[Warning]
    """What in the request may be a mistake."""


AdviseAnswer: TypeAlias = Advised | AssetsAdvised
"""The answer to a question about one asset or several."""


class AssetsAction(FundAdvice):
    """The robust allocation of several assets for the coming period."""

    session: str
    period: int
    worst_case: NotRequired[WorstCase | None]
    caution: list[Caution]
    """What to know before the advice is followed."""


class AssetsWhatIfPoint(FundAdvice):
    """The advice on several assets under one hypothesis."""

    period: int
    """The period advised."""
    wealth: float
    """Wealth at its start."""
    log_returns: NotRequired[dict[str, float]]
    """The returns supposed, by asset, if any were."""
    radius_scale: NotRequired[float | None]
    """The factor on the radius supposed, if one was."""
    gamma: NotRequired[float | None]
    """Lagrange multiplier of the ball: utility lost per unit of extra radius. Where the step was solved."""
    worst_law: NotRequired[WorstLawSummary | None]
    worst_case: NotRequired[WorstCase | None]


BacktestQuestion: TypeAlias = BacktestRequest | AssetsBacktestRequest
"""A walk-forward of one asset, or of several, which `assets` names."""


class EvaluationReport(TypedDict):
    """Strategies compared on common returns. `docs/evaluation.md` says where the intervals come from."""

    format: str
    """`ballast-evaluation-1`."""
    request: EvaluationRequest
    """The completed request."""
    reference: str
    """The strategy that differences are taken against."""
    strategies: list[StrategyReport]
    """Frameworks first, then constant mixes, in the order of the request."""
    floor: float
    """Terminal wealth of All in the bank, from which utility is counted: it is 0 there, and grows as the logarithm of wealth does."""
    histogram_edges: list[float]
    """Common bin edges of terminal utility, ascending."""
    wealth_edges: list[float]
    """Common bin edges of terminal wealth, ascending and evenly apart."""
    histories: list[HistoryReport]
    """In the order they were drawn."""
    sentences: list[str]
    """What the figures say of each framework that changes its allocation."""
    costs: Costs
    """What it took."""


class FrontierReport(TypedDict):
    """
    What following the advice at multiples of the radius loses on records like the one at hand. The same request gives the same
    report, bit for bit.
    """

    format: str
    """`ballast-frontier-1`."""
    request: FrontierRequest
    """As completed."""
    level: float
    """Of the intervals, which tell how exactly the resamples tell a figure, not how like the true law they are."""
    per_year: bool
    """Whether losses are a year's: where `problem.periods_per_year` is given. Else they are a period's."""
    radius: float
    """Of the rule at the record itself, in log-return; scales are multiples of it."""
    evidence: float
    """Standard errors that the record's mean return lies above the bank's, in the fund of inverse volatilities."""
    own: list[list[float]]
    """What is advised at the record itself, scale by scale: the share of wealth in each asset, in the order of the request."""
    resampled: list[Resampled]
    """By the law that records were drawn from."""
    sentences: list[str]
    """What the figures say, and what they cannot."""


JobReport: TypeAlias = EvaluationReport | BacktestReport | AssetsBacktestReport | FrontierReport
"""The report of a job: of an evaluation, of a walk-forward or of a frontier."""


class Observed(Uncertainty):
    """The session after an observation."""

    session: str
    period: int
    log_return: NotRequired[float | None]
    """Null where it is missing."""
    band: list[float]
    """
    The holdings that were best kept at the start of the period; where trading costs nothing both ends are the advised
    allocation.
    """
    advised_allocation: float
    executed_allocation: float
    wealth: float
    """Wealth at the end of the period, with what was added to it."""
    holding: float
    """Share of it in the risky asset, as the return left it."""
    assets: NotRequired[ObservedAssets | None]
    wealth_change: float
    """Change of wealth by the period, what was added or reached otherwise included."""
    date: NotRequired[str | None]
    """The last day of the period: as reported, else the next one due, or where that is not known of a period before."""
    completed: bool
    """Whether the horizon is reached, and no policy is to follow."""
    drift: Drift
    """Whether the returns still come as they came."""


class PolicyDetail(Labels):
    """A policy, and how well each of its steps was solved."""

    policy: str
    created_ms: int
    framework: Framework
    horizon: int
    specification: Specification
    annualised: NotRequired[Annualised | None]
    warnings: list[Warning]
    """What in the specification may be a mistake."""
    diagnostics: list[StepDiagnostics]


class Reading1(Record):
    """It is this record."""

    outcome: Literal["read"]


Reading: TypeAlias = Reading1 | Reading2 | Reading3
"""What is made of a text."""


class Renewal(Renewed):
    """One renewal, as it was made."""

    window: NotRequired[int | None]
    """Returns that the law was made of, the last ones; null where those were all."""
    renewed_ms: int


class WhatIfAnswer1(WhatIfPoint):
    """One point, or the points of a sweep in its order."""

    session: str


class WhatIfAnswer2(TypedDict):
    """One point, or the points of a sweep in its order."""

    session: str
    points: list[WhatIfPoint]


class WhatIfAnswer3(AssetsWhatIfPoint):
    """Of several assets."""

    session: str


class WhatIfAnswer4(TypedDict):
    """One point, or the points of a sweep in its order."""

    session: str
    points: list[AssetsWhatIfPoint]


WhatIfAnswer: TypeAlias = WhatIfAnswer1 | WhatIfAnswer2 | WhatIfAnswer3 | WhatIfAnswer4
"""One point, or the points of a sweep in its order."""


ActionAnswer: TypeAlias = Action | AssetsAction
"""The robust allocation for the coming period."""


class ElementAnswered(TypedDict):
    """The answer to one element of a list."""

    session: str
    period: int
    status: int
    """What a call with this report alone would be answered with."""
    answer: NotRequired[Observed | None]
    problem: NotRequired[Problem | None]


class Observation(Observed):
    """One period, observed or put in later."""

    reported: Report
    """What was reported first."""
    observed_ms: int
    corrections: NotRequired[list[int]]
    """Numbers of the corrections that put it in or reported it anew."""
    now: NotRequired[Now | None]


ReportsAnswered: TypeAlias = Observed | list[ElementAnswered]
"""The answer to one report, or to each of a list in its order."""


class History(TypedDict):
    """Where a session started, and everything recorded of it."""

    session: str
    policy: str
    """The first policy."""
    terms: Terms
    """Rate, cost and flows of its periods, where none other are reported."""
    initial_wealth: float
    initial_holding: float
    """Share of it in the risky asset."""
    initial_radius: float
    """Radius of the uncertainty set before the first period, in the unit of an advice's."""
    assets: NotRequired[list[str] | None]
    """Names of the assets, where there are several."""
    composed: NotRequired[Composed | None]
    history: KnownReturns
    """Log-returns known at the start."""
    observations: list[Observation]
    corrections: list[Correction]
    renewals: list[Renewal]
    """The policies that followed the first."""
