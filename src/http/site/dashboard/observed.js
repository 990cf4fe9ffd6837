// The past periods of a session: as a table, as a file, to correct them, and with their earlier corrections.

import { post } from "./api.js";
import { falls, mixed, wealths } from "./comparators.js";
import { correctionForm } from "./correction.js";
import { benchmarks, besides } from "./course.js";
import { csvText, hundred } from "./csv.js";
import { disclosure, h, reveal, section, table } from "./dom.js";
import { addedIn, rateIn, spentIn, standing } from "./flows.js";
import { pressed } from "./form.js";
import { allocation, count, figures, moment, percent, short } from "./format.js";
import { inCurrency } from "./money.js";
import { policyLink } from "./naming.js";
import { firstOf } from "./pages.js";
import { day } from "./periods.js";
import { save } from "./picture.js";
import { assetReturns, assetsHeld, everyAsset, simpleReturn } from "./several_fields.js";
import { isCautious } from "./specification.js";

/** Periods shown at first; a button shows all. */
const NEWEST = 24;

/** Tells whether trading costs something. */
const isCostly = ({ policy }) => policy.specification.problem.trading_cost > 0;

/** Tells whether the policy plans spending, or something was spent. */
const isSpending = ({ policy, history }) => Boolean(policy.specification.problem.spending) || history.observations.some((_, index) => spentIn(history, index + 1) > 0);

/** Formats the return of an asset; blank if there is none. */
const returned = (log_return) => ((log_return ?? null) === null ? "" : percent(simpleReturn(log_return), 2));

export function observed(shown) {
  const { history, calendar } = shown;
  const rows = [...history.observations].reverse();
  if (rows.length === 0) return "";
  /** Shows the current value, and beside it the first reported one if it differs. */
  const now = (name, words) => (row) => {
    const [stands, told] = [(row.now ?? row)[name], row[name]].map((value) => (value === null ? "missing" : words(value)));
    return stands === told ? stands : h("span", {}, stands, " ", h("s", { class: "note", title: "As first reported" }, told));
  };
  const spends = isSpending(shown);
  const period = { name: "Period", cell: (row) => calendar.name(row.period).replace(/^Period /, "") };
  const number = (name, cell) => ({ name, numeric: true, cell });
  const told = (some) =>
    table(
      "Observed periods, newest first",
      [
        period,
        ...(calendar.dated ? [{ name: "Last day", cell: (row) => (standing(row).date ? day(standing(row).date) : "") }] : []),
        number("Return", now("log_return", (value) => percent(Math.expm1(value), 2))),
        ...everyAsset(history).map((name) => number(name, ({ period }) => returned(assetReturns(history, period - 1)?.[name]))),
        number("Advised", now("advised_allocation", allocation)),
        number("Held", now("executed_allocation", allocation)),
        ...(isCostly(shown) ? [number("Traded", ({ account }) => percent(account.turnover)), number("Cost", ({ account }) => inCurrency(account.cost))] : []),
        ...(spends ? [number("Spent", now("spent", (amount = 0) => inCurrency(amount)))] : []),
        number("Wealth", now("wealth", inCurrency)),
        number("Reported", ({ observed_ms }) => moment(observed_ms)),
      ],
      some,
    );
  const { holder, all } = firstOf(rows, NEWEST, told);
  const quant = () =>
    table(
      "Observed periods in the paper\u2019s terms",
      [
        period,
        number("Log-return", now("log_return", (value) => figures(value, 4))),
        number("Radius", now("radius", (value) => figures(value, 3))),
        number("Returns seen", ({ sample_size }) => count(sample_size)),
      ],
      rows,
    );
  const file = `session-${short(shown.id)}.csv`;
  return section(
    "Periods so far",
    holder,
    h(
      "p",
      { class: "foot" },
      all,
      h("button", { class: "quiet", onclick: () => save(csv(shown), file, "text/csv") }, "Save as CSV"),
    ),
    noted(shown),
    corrections(shown),
    renewals(shown),
    shown.right,
    disclosure("For the quant", quant),
  );
}

/** Returns the CSV of the periods, one row each: plain numbers, shares and returns in percent. A corrected period has its current values and
 * the first reported ones. */
export function csv({ history, calendar, policy, cautionScale }) {
  const { observations, corrections } = history;
  const assets = everyAsset(history);
  const own = wealths(history);
  const deep = falls(history);
  const isCorrected = corrections.length > 0;
  const costly = isCostly({ policy });
  const simple = (log_return) => ((log_return ?? null) === null ? null : hundred(simpleReturn(log_return)));
  const at = (milliseconds) => (milliseconds === undefined ? null : new Date(milliseconds).toISOString());
  const madeIn = (row) => corrections.filter(({ correction }) => row.corrections?.includes(correction));
  /** Returns the column of a current value, and that of the first reported one if the session has corrections. */
  const both = (name, unit, of) => [[`${name}${unit}`, (row) => of(row.now ?? row)], isCorrected && [`${name} told first${unit}`, of]];
  /** The heading of each column, its value in a row, and its value at the start. */
  const columns = [
    ["Period", ({ period }) => period, 0],
    ["Name", ({ period }) => calendar.name(period), "Start"],
    ["Last day", (row) => standing(row).date],
    ...both("Return", ", %", ({ log_return }) => simple(log_return)),
    ["The bank paid, %", ({ period }) => hundred(rateIn(history, period))],
    ["Money added", ({ period }) => addedIn(history, period)],
    ...both("Advised", ", %", ({ advised_allocation }) => hundred(advised_allocation)),
    ...["from", "to"].map((end, index) => costly && [`Best kept ${end}, %`, ({ band }) => hundred(band?.[index])]),
    ...both("Held", ", %", ({ executed_allocation }) => hundred(executed_allocation)),
    ["Traded, %", ({ account }) => hundred(account.turnover)],
    ...(isSpending({ policy, history }) ? both("Spent", "", ({ spent }) => spent ?? 0) : []),
    costly && ["Trading cost", ({ account }) => account.cost],
    ...assets.flatMap((name) => [
      [`${name} returned, %`, ({ period }) => simple(assetReturns(history, period - 1)?.[name])],
      [`${name} held, %`, (row) => hundred(assetsHeld(row)[name])],
    ]),
    ...both("Wealth", "", ({ wealth }) => wealth).map((column) => column && [...column, own[0]]),
    ...besides(history).map(({ name, share }) => [name, mixed(history, share)]).map(([name, wealths]) => [name, ({ period }) => wealths[period], own[0]]),
    ...benchmarks(history).map(({ name, wealths }) => [name, ({ period }) => wealths[period], own[0]]),
    ["Below the highest, %", ({ period }) => hundred(deep[period]), 0],
    isCautious(policy.specification.problem) && [`Caution, % a ${calendar.unit}`, (row) => hundred((row.now ?? row).radius * cautionScale)],
    ["Returns seen", ({ sample_size }) => sample_size],
    ["Reported", ({ observed_ms }) => at(observed_ms)],
    isCorrected && ["Put right", (row) => at(madeIn(row).at(-1)?.corrected_ms)],
    isCorrected && ["Put right because", (row) => madeIn(row).map(({ reason }) => reason).join("; ")],
  ].filter(Boolean);
  return csvText([columns.map(([name]) => name), columns.map(([, , start]) => start), ...observations.map((row) => columns.map(([, of]) => of(row)))]);
}

const ONE = ["log_return", "simple_return", "price", "previous_price", "executed_allocation"];
const REPORT = [...ONE, ...ONE.map((name) => `${name}s`), "missing", "date", "rate", "flow", "spent", "wealth"];
const reportOf = (said) => Object.fromEntries(REPORT.filter((name) => (said[name] ?? false) !== false).map((name) => [name, said[name]]));

/** Sends a confirmed correction, on a press of `button`. */
function correct(button, { id, session, refresh }, period, report, reason, news) {
  const request = { correction: session.corrections + 1, period, reason, confirm: true, ...report };
  return pressed(button, async () => {
    await post(`/sessions/${id}/corrections`, request);
    await refresh(news);
  });
}

/** Shows the last report, with what to do if it was wrong. */
export function lastReport(shown) {
  const { history, calendar } = shown;
  const row = history.observations.at(-1);
  if (!row) return "";
  const { log_return, executed_allocation } = row.now ?? row;
  const held = history.assets ? { executed_allocations: assetsHeld(row) } : { executed_allocation };
  const name = calendar.inText(row.period);
  const { date } = standing(row);
  const undo = ({ target }) => {
    const words = `Take back the return of ${name}?\n\nThe period stays without a return until you enter one. The original report stays on record.`;
    if (!confirm(words)) return;
    const report = { missing: true, ...held, ...(date ? { date } : {}) };
    correct(target, shown, row.period, report, "The report was taken back", `The return of ${name} is taken back.`);
  };
  const takeOut = ({ target }) => {
    const words = `Remove ${name}?\n\nIt then counts as never reported, and you can report it again. The original report stays on record.`;
    if (confirm(words)) correct(target, shown, row.period, { change: "remove" }, "The period was removed", `${calendar.name(row.period)} is removed.`);
  };
  const mend = () => reveal(shown.right);
  const back = log_return === null ? "no return is known" : percent(Math.expm1(log_return), 2);
  const said = log_return !== null && history.assets ? `${back} of the assets together` : back;
  return h(
    "p",
    { class: "note last" },
    `Last report, ${name}: ${said}. `,
    h("span", { "data-needs": "operate" }, h("button", { class: "link", onclick: mend }, "Correct it"), log_return === null ? "" : [", ", h("button", { class: "link", onclick: undo }, "take it back")], " or ", h("button", { class: "link", onclick: takeOut }, "remove the period")),
  );
}

/** Returns the form for a correction, in a fold. */
export function righting(shown) {
  const fold = disclosure("Correct a period", () => correctionForm(shown));
  fold.dataset.needs = "operate";
  return fold;
}

/** Lists what is noted on the periods: total losses, and prices that did not come. */
function noted({ history, calendar }) {
  const rows = [...history.observations].reverse();
  const notes = rows.flatMap((row) => ((row.now ?? row).notes ?? []).map(({ sentence }) => `${calendar.name(row.period)}: ${sentence}.`));
  return notes.length === 0 ? "" : h("ul", { class: "corrections notes" }, notes.map((words) => h("li", {}, words)));
}

/** Lists the corrections, newest first; the newest can be undone. */
function corrections(shown) {
  const { history, calendar } = shown;
  if (history.corrections.length === 0) return "";
  const done = { replace: "corrected", insert: "inserted", remove: "removed" };
  /** Returns the current number of a corrected period, or the former number of a removed one. */
  const now = ({ correction, period }) => history.observations.find(({ corrections }) => corrections?.includes(correction))?.period ?? period;
  const words = (made) => {
    const change = made.change ?? "replace";
    const name = change === "remove" ? `Period ${made.period}` : calendar.name(now(made));
    return `${name} was ${done[change]} on ${moment(made.corrected_ms)}: ${made.reason}`;
  };
  const undo = (button, made) => {
    if (made.change === "insert") return correct(button, shown, made.period, { change: "remove" }, `Correction ${made.correction} was undone`, `Period ${made.period} is removed again.`);
    const row = history.observations[made.period - 1];
    const earlier = history.corrections.filter(({ correction }) => row.corrections.includes(correction) && correction < made.correction).at(-1);
    const said = earlier ?? row.reported;
    const news = `${calendar.name(made.period)} is back to its earlier report.`;
    return correct(button, shown, made.period, reportOf(said), `Correction ${made.correction} was undone`, news);
  };
  const made = [...history.corrections].reverse();
  return h(
    "ul",
    { class: "corrections" },
    made.map((one, index) => h("li", {}, words(one), index === 0 && one.change !== "remove" ? [" ", h("button", { class: "link", "data-needs": "operate", onclick: ({ target }) => undo(target, one) }, "Undo")] : null)),
  );
}

/** Lists the policies that followed the first, newest first. */
function renewals({ history: { renewals }, calendar }) {
  if (renewals.length === 0) return "";
  const words = ({ period, policy, names, renewed_ms }, index) => [
    `From ${calendar.inText(period)} on with `,
    policyLink(policy, index < NEWEST),
    `${names ? `, in ${names.join(", ")}` : ""}, since ${moment(renewed_ms)}`,
  ];
  return h("ul", { class: "renewals" }, [...renewals].reverse().map((made, index) => h("li", {}, ...words(made, index))));
}
