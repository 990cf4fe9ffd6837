// One session: what to hold now and why, the return to report, and how it went.

import { adviceView } from "./advice.js";
import { get, offers, remove } from "./api.js";
import { lineChart } from "./chart.js";
import { correctionForm } from "./correction.js";
import { announce, disclosure, facts, h, section, table } from "./dom.js";
import { banked, netAdded, standing } from "./flows.js";
import {
  allocation,
  count,
  counted,
  moment,
  percent,
  percentTick,
  short,
  significant,
  tick,
  wealth,
} from "./format.js";
import { asking } from "./frontier.js";
import { lawChart } from "./law_chart.js";
import { observeForm } from "./observe.js";
import { sensitivity } from "./sensitivity.js";
import { utility } from "./specification.js";
import { conservatism } from "./what_if.js";

export async function view(id, leaving) {
  const session = await get(`/sessions/${id}`, leaving);
  const [history, policy, canAsk, canTry] = await Promise.all([
    get(`/sessions/${id}/history`, leaving),
    get(`/policies/${session.policy}`, leaving),
    offers("/what-if"),
    offers("/frontier"),
  ]);
  const holder = h("div", {});
  const shown = { id, policy, canAsk, canTry, leaving };
  const refresh = async (news) => {
    const [now, past] = await Promise.all([get(`/sessions/${id}`, leaving), get(`/sessions/${id}/history`, leaving)]);
    await fill(holder, { ...shown, session: now, history: past, refresh });
    announce(
      now.state === "completed"
        ? `The session is completed with wealth ${wealth(now.wealth)}.`
        : `${news ?? `Period ${now.period - 1} is recorded.`} Wealth ${wealth(now.wealth)}.`,
    );
    holder.querySelector("#advice")?.focus();
  };
  await fill(holder, { ...shown, session, history, refresh });
  const trail = h(
    "p",
    { class: "trail" },
    h("a", { href: "#/sessions" }, "Sessions"),
    " \u203a ",
    h("a", { href: `#/policies/${session.policy}` }, `Policy ${short(session.policy)}`),
    `, ${utility(policy.specification.problem.utility)}`,
  );
  return { title: `Session ${short(id)}`, trail, actions: deletion(id), body: holder };
}

async function fill(holder, shown) {
  const { id, session, leaving } = shown;
  if (session.state !== "active") {
    const ended = [h("div", {}, completed(shown)), h("div", {}, course(shown, null))];
    return holder.replaceChildren(figures(shown, null), h("div", { class: "columns" }, ended), observed(shown));
  }
  const action = await get(`/action?session=${id}`, leaving);
  const report = observeForm(action, shown);
  const advice = adviceView(action, session.rolling ? null : session.horizon, report.element);
  const numbers = h("div", {}, figures(shown, action));
  const sofar = h("div", {}, course(shown, action));
  const settled = (stands) => {
    if (!stands.replaced) return;
    report.advise(stands.allocation);
    numbers.replaceChildren(figures(shown, stands));
    sofar.replaceChildren(course(shown, stands));
  };
  holder.replaceChildren(
    numbers,
    changed(shown),
    due(shown),
    h("div", { class: "columns" }, h("div", {}, advice.element), sofar),
    sensitivity(shown),
    worstCase(shown, advice, settled),
    shown.canAsk ? conservatism(shown, action) : "",
    caution(shown),
    observed(shown),
  );
}

function figures({ session, history }, action) {
  const put = netAdded(history);
  const change = (session.wealth - put) / history.initial_wealth - 1;
  const apart = put === 0 ? "" : `, ${put > 0 ? "beside" : "after"} ${wealth(Math.abs(put))} ${put > 0 ? "added" : "withdrawn"}`;
  return facts([
    ["Wealth", wealth(session.wealth), `${change >= 0 ? "+" : ""}${percent(change)} since the start${apart}`],
    ["Held", allocation(session.holding), "of wealth, before trading"],
    action && ["Certainty equivalent", wealth(action.certainty_equivalent), session.rolling ? "for certain a horizon of the policy from now" : "for certain at the horizon"],
    action && ["Floor", wealth(action.floor), "all sold now, and in the bank until then"],
    action && ["Radius", significant(action.radius, 3), "of the set of laws guarded against"],
    [
      "Returns seen",
      count(session.sample_size),
      `${counted(session.period - 1, "period")} observed${session.rolling ? "" : ` of ${session.horizon}`}`,
    ],
  ]);
}

/** That the returns no longer come as they came, where they do not. */
function changed({ session: { drift } }) {
  if (drift.level === "none") return "";
  const how = drift.level === "alarm" ? "no longer come as they came" : "may no longer come as they came";
  const words = `The returns ${how}: a bet against it has made ${count(Math.floor(drift.highest))} out of 1, which it does for one session in ${count(Math.floor(drift.highest))} at most where nothing changes. The advice rests on all returns seen; a policy trained on newer ones may serve better.`;
  return h("p", { class: "note wrong" }, words);
}

function completed({ session, history }) {
  const bank = banked(history, session.horizon).at(-1);
  return section(
    "Completed",
    h(
      "div",
      { class: "advice", id: "advice", tabindex: -1 },
      h("p", { class: "big" }, h("span", {}, "It ended with "), h("strong", {}, wealth(session.wealth))),
      h("p", { class: "sentence" }, `The bank alone would have reached ${wealth(bank)}.`),
      h("p", {}, h("a", { class: "button", href: `#/sessions/new?policy=${session.policy}` }, "Open another session")),
    ),
  );
}

/** That the next policy is to come, and what keeps it. */
function due({ session: { renewal } }) {
  if (!renewal) return "";
  const job = renewal.job ? h("a", { href: `#/jobs/${renewal.job}` }, "its training") : "its training";
  const states = {
    due: ["The next policy is about to be trained: ", job, "."],
    training: ["The next policy is being trained: ", job, ". Until then this one goes on."],
    trained: ["The next policy is trained, and about to be gone on by: ", job, "."],
    failed: ["The next policy is not there: ", job, ` failed${renewal.error ? ` (${renewal.error})` : ""}. It is tried again by itself; until then this one goes on.`],
  };
  return h("p", { class: renewal.state === "failed" ? "note wrong" : "note" }, ...states[renewal.state]);
}

/** Wealth, allocation and radius through time. */
function course({ session, history, policy }, action) {
  const { trading_cost } = policy.specification.problem;
  const { observations, initial_wealth } = history;
  const horizon = session.rolling ? Math.max(12, observations.length + 1) : session.horizon;
  const periods = Array.from({ length: horizon + 1 }, (_, k) => k);
  const after = (period, read) => (observations[period - 1] ? read(observations[period - 1]) : null);
  const stands = (period, name) => after(period, (row) => (row.now ?? row)[name]);
  const x = { values: periods, domain: [0, horizon], label: "After period", format: String, whole: true };
  const lived = periods.map((k) => (k === 0 ? initial_wealth : stands(k, "wealth")));
  const bank = banked(history, horizon);
  const held = periods.map((k) => stands(k, "executed_allocation"));
  const told = (now, then) =>
    periods.map((k) => (action && k === action.period ? now(action) : after(k, then)));
  const advised = told(
    ({ allocation }) => allocation,
    (row) => row.advised_allocation,
  );
  const ends = ["low", "high"].map((name, end) => ({
    name: `Band, ${name} end`,
    kind: "levels",
    values: told(
      ({ band }) => band[end],
      ({ band }) => band[end],
    ),
  }));
  const radii = periods.map((k) =>
    k === session.period - 1 && action ? action.radius : stands(k, "radius"),
  );
  const gutter = 64;
  return section(
    "So far",
    lineChart({
      title: "Wealth",
      gutter,
      height: 200,
      x,
      y: { format: wealth, tick },
      series: [
        { name: "Session", kind: "line", values: lived },
        { name: "All in the bank", kind: "line", bare: true, values: bank },
      ],
    }),
    lineChart({
      title: "Allocation",
      gutter,
      height: 150,
      x: { ...x, label: "Period", between: true },
      y: { format: allocation, tick: percentTick, also: [0] },
      series: [
        { name: "Held", kind: "bars", values: held },
        ...(trading_cost > 0 ? ends : [{ name: "Advised", kind: "levels", values: advised }]),
      ],
    }),
    lineChart({
      title: "Radius of the set of laws",
      gutter,
      height: 130,
      x,
      y: { format: (value) => significant(value, 3), tick },
      series: [{ name: "", kind: "line", values: radii }],
    }),
  );
}

/** The law behind the current advice, and the check of it; both take a robust step, so they come after the rest stands. */
function worstCase({ id, leaving }, advice, settled) {
  const holder = h("div", { class: "later" }, h("p", { class: "note" }, "Solving the step for its worst law\u2026"));
  const told = async () => {
    const anew = await get(`/action?session=${id}&explain=worst_case`, leaving);
    settled(advice.checked(anew));
    const { worst_case } = anew;
    const sentence = h("p", { class: "sentence" }, worstWords(anew));
    if (worst_case.transport.length === 0) return [sentence];
    const told = `A radius wider by 0.001 would cost ${significant(10 * worst_case.radius_cost, 2)} basis points of the certainty equivalent. Multiplier of the ball ${significant(worst_case.multiplier, 3)} (utility lost per unit of radius); duality gap ${significant(1e4 * Math.abs(worst_case.duality_gap), 2)} bp.`;
    return [sentence, lawChart(worst_case), h("p", { class: "note" }, told)];
  };
  told().then(
    (nodes) => holder.replaceChildren(...nodes),
    (error) => {
      if (leaving.aborted) return;
      advice.unchecked(error.message);
      holder.replaceChildren(h("p", { class: "error" }, error.message));
    },
  );
  return section("Against what this is robust", holder);
}

/** What the worst law does to the advice that stands above it; its worth stands there too, and only there. */
function worstWords({ worst_case: { transport, sentence }, radius, sample_size }) {
  if (transport.length === 0) return sentence.replace(/^A(gains)?t an allocation of \S+ %,/, "Against this advice,");
  const moves = transport.filter(({ atom, moved_to }) => atom !== moved_to);
  const among = `within distance ${significant(radius, 3)} of the ${counted(sample_size, "return")} seen`;
  if (moves.length === 0) return `No law ${among} does worse to this advice than the returns themselves.`;
  const share = moves.reduce((sum, { mass }) => sum + mass, 0);
  const lowest = Math.min(...moves.map(({ moved_to }) => moved_to));
  return `Against this advice, the worst law ${among} moves ${percent(share)} of the probability, down to a return of ${percent(Math.expm1(lowest))} in one period.`;
}

/** What more or less of it would lose, where the policy has a ball. */
function caution({ session, policy, history, canTry }) {
  const { problem } = policy.specification;
  if (!canTry || problem.radius?.rule === "chi_square") return "";
  const seen = history.observations.map((row) => (row.now ?? row).log_return).filter((value) => value !== null);
  return section(
    "How much caution",
    h(
      "p",
      { class: "note" },
      "What other multiples of the radius would lose on some hundreds of records drawn like this one, a period at a time: without a trading cost, without forgetting, and without money that comes and goes.",
    ),
    h("p", {}, asking(problem, [...history.history, ...seen], session.wealth)),
  );
}

function observed(shown) {
  const { history } = shown;
  if (history.observations.length === 0) return "";
  const rows = [...history.observations].reverse();
  const dated = rows.some((row) => standing(row).date);
  /** What stands, and beside it what was told where that was something else. */
  const now = (name, words) => (row) => {
    const [stands, told] = [(row.now ?? row)[name], row[name]].map((value) => (value === null ? "missing" : words(value)));
    return stands === told ? stands : h("span", {}, stands, " ", h("s", { class: "note", title: "As it was told then" }, told));
  };
  return section(
    "Observed",
    table(
      "Observed periods, newest first",
      [
        { name: "Period", cell: ({ period }) => count(period) },
        ...(dated ? [{ name: "Last day", cell: (row) => standing(row).date ?? "" }] : []),
        { name: "Return", numeric: true, cell: now("log_return", (value) => percent(Math.expm1(value), 2)) },
        { name: "Log-return", numeric: true, cell: now("log_return", (value) => significant(value, 4)) },
        { name: "Advised", numeric: true, cell: now("advised_allocation", allocation) },
        { name: "Held", numeric: true, cell: now("executed_allocation", allocation) },
        { name: "Wealth", numeric: true, cell: now("wealth", wealth) },
        { name: "Radius", numeric: true, cell: now("radius", (value) => significant(value, 3)) },
        { name: "Reported", numeric: true, cell: ({ observed_ms }) => moment(observed_ms) },
      ],
      rows,
    ),
    corrections(history),
    renewals(history),
    disclosure("Put a period right", () => correctionForm(shown)),
  );
}

/** What was put right, newest first. */
function corrections({ corrections }) {
  if (corrections.length === 0) return "";
  const words = ({ period, reason, corrected_ms }) => `Period ${period} was put right on ${moment(corrected_ms)}: ${reason}`;
  return h("ul", { class: "corrections" }, [...corrections].reverse().map((made) => h("li", {}, words(made))));
}

/** The policies that followed the first, newest first. */
function renewals({ renewals }) {
  if (renewals.length === 0) return "";
  const words = ({ period, policy, renewed_ms }) => [
    `From period ${period} on by `,
    h("a", { href: `#/policies/${policy}` }, `policy ${short(policy)}`),
    `, since ${moment(renewed_ms)}`,
  ];
  return h("ul", { class: "renewals" }, [...renewals].reverse().map((made) => h("li", {}, ...words(made))));
}

function deletion(id) {
  const button = h("button", { class: "quiet danger" }, "Delete");
  button.addEventListener("click", async () => {
    if (!confirm("Delete this session and all it observed?")) return;
    await remove(`/sessions/${id}`).then(
      () => (location.hash = "#/sessions"),
      (error) => announce(error.message),
    );
  });
  return button;
}
