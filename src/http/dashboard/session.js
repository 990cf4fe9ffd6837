// One session: what to hold now and why, the return to report, and how it went.

import { get, offers, remove } from "./api.js";
import { lineChart } from "./chart.js";
import { announce, disclosure, facts, h, section, table } from "./dom.js";
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
import { lawChart } from "./law_chart.js";
import { observeForm } from "./observe.js";
import { utility } from "./specification.js";
import { conservatism } from "./what_if.js";

const SOURCES = {
  policy_surrogate: "read off the policy",
  resolved: "solved anew on request",
  resolved_other_radius: "solved anew for another radius",
  resolved_outside_design: "solved anew, because this state lies outside the policy\u2019s design",
};

export async function view(id, leaving) {
  const session = await get(`/sessions/${id}`, leaving);
  const [history, policy, canAsk] = await Promise.all([
    get(`/sessions/${id}/history`, leaving),
    get(`/policies/${session.policy}`, leaving),
    offers("/what-if"),
  ]);
  const holder = h("div", {});
  const shown = { id, policy, canAsk, leaving };
  const refresh = async () => {
    const [now, past] = await Promise.all([get(`/sessions/${id}`, leaving), get(`/sessions/${id}/history`, leaving)]);
    await fill(holder, { ...shown, session: now, history: past, refresh });
    announce(
      now.state === "completed"
        ? `The session is completed with wealth ${wealth(now.wealth)}.`
        : `Period ${now.period - 1} is recorded. Wealth ${wealth(now.wealth)}.`,
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
  const active = session.state === "active";
  const action = active ? await get(`/action?session=${id}`, leaving) : null;
  holder.replaceChildren(
    figures(shown, action),
    h(
      "div",
      { class: "columns" },
      h("div", {}, active ? advice(action, shown) : completed(shown)),
      h("div", {}, course(shown, action)),
    ),
    active ? worstCase(shown, action) : "",
    active && shown.canAsk ? conservatism(shown, action) : "",
    observed(shown),
  );
}

function figures({ session, history }, action) {
  const change = session.wealth / history.initial_wealth - 1;
  return facts([
    ["Wealth", wealth(session.wealth), `${change >= 0 ? "+" : ""}${percent(change)} since the start`],
    action && ["Certainty equivalent", wealth(action.certainty_equivalent), "for certain at the horizon"],
    action && ["Floor", wealth(action.floor), "all in the bank until then"],
    action && ["Radius", significant(action.radius, 3), "of the set of laws guarded against"],
    [
      "Returns seen",
      count(session.sample_size),
      `${counted(session.period - 1, "period")} observed of ${session.horizon}`,
    ],
  ]);
}

function advice(action, shown) {
  const sentence = h("p", { class: "sentence" }, ...why(action));
  return section(
    `Period ${action.period} of ${shown.session.horizon}`,
    h(
      "div",
      { class: "advice", id: "advice", tabindex: -1 },
      h(
        "p",
        { class: "big" },
        h("span", {}, "Hold "),
        h("strong", {}, allocation(action.allocation)),
        h("span", {}, " in the risky asset"),
      ),
      sentence,
      h(
        "p",
        { class: "note" },
        `Allocation ${significant(action.allocation, 4)}, ${SOURCES[action.source]}${action.in_design && action.surrogate_sd > 0 ? `; predicted deviation of its worth ${significant(1e4 * action.surrogate_sd, 2)} bp` : ""}.`,
      ),
    ),
    observeForm(action, shown),
  );
}

function why(action) {
  const { certainty_equivalent, floor } = action;
  if (action.allocation === 0)
    return [
      "Against the worst law the returns seen cannot rule out, nothing beats the bank, which reaches ",
      h("b", {}, wealth(floor)),
      ".",
    ];
  return [
    "Against the worst law the returns seen cannot rule out, this is worth ",
    h("b", {}, wealth(certainty_equivalent)),
    " for certain at the horizon, where the bank alone reaches ",
    h("b", {}, wealth(floor)),
    ".",
  ];
}

function completed({ session, history, policy }) {
  const { rate_per_step, horizon } = policy.specification.problem;
  const bank = history.initial_wealth * (1 + rate_per_step) ** horizon;
  return section(
    "Completed",
    h(
      "div",
      { class: "advice", id: "advice", tabindex: -1 },
      h("p", { class: "big" }, h("span", {}, "It ended with "), h("strong", {}, wealth(session.wealth))),
      h("p", { class: "sentence" }, `The bank alone would have reached ${wealth(bank)}.`),
      h("p", {}, h("a", { class: "button", href: `#/sessions?policy=${session.policy}` }, "Open another session")),
    ),
  );
}

/** Wealth, allocation and radius through time. */
function course({ session, history, policy }, action) {
  const { rate_per_step } = policy.specification.problem;
  const { observations, initial_wealth } = history;
  const { horizon } = session;
  const periods = Array.from({ length: horizon + 1 }, (_, k) => k);
  const after = (period, read) => (observations[period - 1] ? read(observations[period - 1]) : null);
  const x = { values: periods, domain: [0, horizon], label: "After period", format: String, whole: true };
  const lived = periods.map((k) => (k === 0 ? initial_wealth : after(k, (row) => row.wealth)));
  const bank = periods.map((k) => initial_wealth * (1 + rate_per_step) ** k);
  const held = periods.map((k) => after(k, (row) => row.executed_allocation));
  const advised = periods.map((k) =>
    action && k === action.period ? action.allocation : after(k, (row) => row.advised_allocation),
  );
  const radii = periods.map((k) =>
    k === session.period - 1 && action ? action.radius : after(k, (row) => row.radius),
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
        { name: "Advised", kind: "levels", values: advised },
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

/** The law behind the current advice; it takes a robust step, so it is asked for after the rest stands. */
function worstCase({ id, leaving }, action) {
  const holder = h("div", { class: "later" }, h("p", { class: "note" }, "Solving the step for its worst law\u2026"));
  const told = async () => {
    const { worst_case, allocation: anew } = await get(`/action?session=${id}&explain=worst_case`, leaving);
    if (worst_case.transport.length === 0) return [h("p", {}, worst_case.sentence)];
    const apart = Math.abs(anew - action.allocation) < 5e-4 ? "" : ` The step solved anew holds ${percent(anew)}.`;
    return [
      h("p", { class: "sentence" }, worst_case.sentence),
      lawChart(worst_case),
      h(
        "p",
        { class: "note" },
        `Multiplier of the ball ${significant(worst_case.multiplier, 3)} (utility lost per unit of radius); duality gap ${significant(1e4 * Math.abs(worst_case.duality_gap), 2)} bp.${apart}`,
      ),
    ];
  };
  told().then(
    (nodes) => holder.replaceChildren(...nodes),
    (error) => leaving.aborted || holder.replaceChildren(h("p", { class: "error" }, error.message)),
  );
  return section("Against what this is robust", holder);
}

function observed({ history }) {
  if (history.observations.length === 0) return "";
  const rows = [...history.observations].reverse();
  return section(
    "Observed",
    table(
      "Observed periods, newest first",
      [
        { name: "Period", cell: ({ period }) => count(period) },
        { name: "Return", numeric: true, cell: ({ log_return }) => percent(Math.expm1(log_return), 2) },
        { name: "Log-return", numeric: true, cell: ({ log_return }) => significant(log_return, 4) },
        { name: "Advised", numeric: true, cell: ({ advised_allocation }) => allocation(advised_allocation) },
        { name: "Held", numeric: true, cell: ({ executed_allocation }) => allocation(executed_allocation) },
        { name: "Wealth", numeric: true, cell: (row) => wealth(row.wealth) },
        { name: "Radius", numeric: true, cell: ({ radius }) => significant(radius, 3) },
        { name: "Reported", numeric: true, cell: ({ observed_ms }) => moment(observed_ms) },
      ],
      rows,
    ),
  );
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
