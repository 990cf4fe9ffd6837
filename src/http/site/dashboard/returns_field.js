// The field for returns: typed, pasted or from a file, and always read by the service. Below it, a sentence and a chart
// show what was read. The page asks what the text leaves open, and the form has no returns until that is answered.

import { post, text } from "./api.js";
import { lineChart } from "./chart.js";
import { h } from "./dom.js";
import { fileDrop } from "./file_drop.js";
import { pressed } from "./form.js";
import { count, minus, percent, percentTick } from "./format.js";

const KINDS = {
  simple: "Simple returns",
  log: "Log-returns",
  price: "Prices",
  gross: "Gross returns (1.012)",
  cumulated: "Cumulative gains since the start",
};
const UNITS = { percent: "Percent (1.2)", fraction: "Fractions (0.012)" };
const ORDERS = { false: "The oldest", true: "The newest" };
/** Pause in typing before the text is read, in milliseconds. */
const PAUSE = 300;
/** A longer text, in letters, is read only when the field is left. */
const LONG = 200_000;
/** The longest history that the service accepts and a chart shows. */
const MOST = 20_000;
/** Monthly returns of the US stock market. */
export const EXAMPLE = "/dashboard/us_market_monthly.csv";
/** Most lines of a chart that can be told apart. */
const LINES = 7;
const HINT = "With dates, or oldest first. Separated by spaces, commas, semicolons, tabs or lines.";
/** The answers that are dropped when another column or kind is chosen. */
const FOLLOWS = {
  columns: ["kind", "unit", "unusual", "excess", "decimal_comma"],
  kind: ["unit", "unusual", "excess"],
};

/**
 * Returns `{element, show(history, assets), trouble(), typed(), restore(typed)}`. `changed(series, answer)` is called at every change, with
 * the series read, `{column, log_returns}`, and the service's answer; with none and null while the text has no single reading. With
 * `several`, more than one column may be chosen. `trouble()` waits for a pending reading and says why there are no returns, or null. `name`
 * is the request's field. `blank` says what an empty field means, if it may be empty. `example` holds the choices for the bundled returns, if
 * they are offered. `bank(rate, periodsPerYear)` takes the bank's latest rate from a column.
 */
export function returnsField({ name, label, blank = null, example = null, several = false, changed, bank = null }) {
  const id = `f-${name.replace(/[^a-z0-9]+/gi, "-")}`;
  const area = h("textarea", { id, name, rows: 6, spellcheck: "false", "aria-describedby": `${id}-note` });
  area.dataset.described = `${id}-note`;
  const note = h("p", { class: "note", id: `${id}-note`, role: "status", tabindex: -1 });
  const asked = h("div", { class: "asked" });
  let [said, answer, pending, reading, asking, stale] = [{}, null, 0, Promise.resolve(), new AbortController(), false];
  const tell = (outcome, sentence) => {
    note.classList.toggle("wrong", outcome === "refused");
    note.classList.toggle("telling", outcome === "read" || outcome === "asked");
    note.textContent = sentence;
    // What the form said about the text before it was read again.
    element.querySelector(`#${id}-error`)?.remove();
    area.setAttribute("aria-describedby", `${id}-note`);
    if (outcome === "refused") area.setAttribute("aria-invalid", "true");
    else area.removeAttribute("aria-invalid");
  };
  const judge = async () => {
    asking.abort();
    asking = new AbortController();
    const { signal } = asking;
    answer = null;
    if (area.value.trim() === "") {
      said = {};
      asked.replaceChildren();
      return tell("nothing", blank ? `${blank} ${HINT}` : HINT);
    }
    try {
      answer = await post("/returns", { text: area.value, choices: said }, signal);
    } catch (error) {
      if (signal.aborted) return;
      answer = { outcome: "refused", sentence: error.message };
    }
    tell(answer.outcome, words(answer));
    asked.replaceChildren(...below(answer, { said, say, forget, area, bank, several }));
  };
  const take = () => {
    clearTimeout(pending);
    stale = false;
    changed([], null);
    reading = judge().then(() => answer?.outcome === "read" && changed(answer.series, answer));
    return reading;
  };
  const wait = () => {
    asking.abort();
    answer = null;
    changed([], null);
    asked.replaceChildren();
    tell("nothing", "It is read once you leave the field.");
  };
  const say = (more) => {
    for (const name of Object.keys(more)) for (const after of FOLLOWS[name] ?? []) delete said[after];
    said = { ...said, ...more };
    take().then(() => note.focus());
  };
  const forget = () => {
    said = {};
    take().then(() => area.focus());
  };
  const open = (content, known = {}) => {
    said = { ...known };
    area.value = content;
    take();
  };
  area.addEventListener("input", (event) => {
    clearTimeout(pending);
    if (!isTyping(event)) return open(area.value);
    stale = true;
    if (area.value.length <= LONG) pending = setTimeout(take, PAUSE);
    else wait();
  });
  area.addEventListener("change", () => stale && take());
  const trouble = async () => {
    await (stale ? take() : reading);
    if (answer?.outcome === "read") return null;
    if (answer === null) return blank ? null : "Returns are needed: paste them, or choose a file.";
    return answer.outcome === "asked" ? `Answer this first: ${words(answer)}` : words(answer);
  };
  const show = (history, assets = null) => {
    said = { kind: "log", unit: "fraction", unusual: true, excess: false, ...(assets ? { columns: assets } : {}) };
    area.value = assets ? [assets, ...history].map((row) => row.join("\t")).join("\n") : history.join(" ");
    reading = judge();
  };
  /** Returns the text and the answers about it, for `restore`. */
  const typed = () => ({ text: area.value, said });
  const restore = ({ text, said }) => open(text, said);
  const element = h(
    "div",
    {},
    drop(id, open, example),
    h("div", { class: "field wide" }, h("label", { for: id }, label), area, note, asked),
  );
  judge();
  return { element, show, trouble, typed, restore };
}

const words = ({ sentence, questions }) => {
  const said = sentence ?? questions.map(({ question }) => question).join(" ");
  return minus(said.charAt(0).toUpperCase() + said.slice(1));
};

/** Tells whether the text is edited by typing, which keeps the answers about it; pasting starts a new text. */
const isTyping = ({ inputType = "" }) => /^(insertText|insertLineBreak|deleteContent|deleteWord)/.test(inputType);

/** Returns the zone for a file, with the example if `example` gives its choices. */
function drop(id, open, example) {
  const zone = fileDrop(id, open);
  if (!example) return zone;
  const load = async () => open(await text(EXAMPLE), example);
  const offer = h("button", { type: "button", class: "link", onclick: () => pressed(offer, load) }, "Use the example: US stock market, monthly");
  zone.append(h("p", {}, offer));
  return zone;
}

/** Shows what the user can do about the text: answer questions, go to a fault, or choose another reading. */
function below(answer, { said, say, forget, area, bank, several }) {
  const again = h("button", { type: "button", class: "link", onclick: forget }, "Discard the answers");
  const isSaid = Object.keys(said).some((name) => name !== "latest");
  switch (answer.outcome) {
    case "asked":
      return [questions(answer.questions, say, several), ...(isSaid ? [again] : [])];
    case "refused":
      return [...(answer.place ? [shown(answer.place, area)] : []), ...(isSaid ? [again] : [])];
    default:
      return [
        h("div", { class: "fields" }, otherwise(answer, said, say, several)),
        ...(bank && answer.rate ? [offered(answer, bank)] : []),
        ...(answer.series[0].log_returns.length <= MOST && answer.series.length <= LINES ? [picture(answer)] : []),
      ];
  }
}

/** Shows each question with its answers as radio buttons, or as checkboxes for columns if `several` may be chosen, and one button for all
 * answers. */
function questions(asked, say, several) {
  const isMany = ({ asks }) => several && asks === "columns";
  const group = (one) =>
    h(
      "fieldset",
      {},
      h("legend", {}, minus(one.question), isMany(one) ? " Several columns mean several assets." : ""),
      one.options.map(({ label, sentence }, index) =>
        h(
          "label",
          { class: "option" },
          h("input", { type: isMany(one) ? "checkbox" : "radio", name: `asked-${one.asks}`, value: index }),
          h("span", {}, minus(label), sentence ? h("span", { class: "note" }, ` ${minus(sentence)}`) : null),
        ),
      ),
    );
  const groups = asked.map(group);
  const answered = () => {
    const chosen = groups.map((group) => [...group.querySelectorAll(":checked")]);
    const open = chosen.findIndex((boxes) => boxes.length === 0);
    if (open >= 0) return groups[open].querySelector("input").focus();
    const choices = (index) => chosen[index].map(({ value }) => asked[index].options[value].choices);
    const columns = (index) => ({ columns: choices(index).flatMap((choice) => choice.columns) });
    say(Object.assign({}, ...asked.flatMap((one, index) => (isMany(one) ? columns(index) : choices(index)))));
  };
  const button = h("button", { type: "button", class: "quiet", onclick: answered }, "Read it this way");
  return h("div", {}, groups, h("p", { class: "actions" }, button));
}

function shown({ line, value }, area) {
  const go = () => {
    const start = area.value.split("\n").slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
    const at = Math.max(start, area.value.indexOf(value, start));
    area.focus();
    area.setSelectionRange(at, at + value.length);
  };
  return h("button", { type: "button", class: "link", onclick: go }, "Show the place");
}

/** Shows the choices that read the same text in another way. */
function otherwise({ columns, series, dates, newest_first, count: all }, said, say, several) {
  const [{ column, kind, unit }] = series;
  const taken = series.map(({ column }) => column);
  const values = columns.filter(({ name, holds }) => holds === "values" || taken.includes(name));
  const choice = (name, label, choices, value, read = (value) => value) =>
    field(
      label,
      h(
        "select",
        { id: `read-${name}`, onchange: ({ target }) => say({ [name]: read(target.value) }) },
        Object.entries(choices).map(([key, words]) => h("option", { value: key, selected: key === value }, words)),
      ),
    );
  const names = Object.fromEntries(values.map(({ name }) => [name, name]));
  const keep = ({ target }) => say({ latest: Number(target.value) > 0 ? Math.round(Number(target.value)) : undefined });
  const latest = h("input", { id: "read-latest", type: "number", min: 2, max: all, onchange: keep });
  latest.value = Math.min(all, said.latest ?? all);
  return [
    values.length > 1 && (several ? ticked(values, taken, (columns) => say(columns.length > 1 ? { columns, kind, ...(unit ? { unit } : {}) } : { columns })) : choice("columns", "Column", names, column, (name) => [name])),
    choice("kind", "They are", KINDS, kind),
    unit && choice("unit", "In", UNITS, unit),
    dates === undefined &&
      choice("newest_first", "The first is", ORDERS, String(newest_first), (value) => value === "true"),
    field(`Latest returns used, of ${count(all)}`, latest),
  ];
}

/** Shows the columns to use, each one an asset; all are of one kind. */
function ticked(values, taken, say) {
  const element = h("div", { class: "field checks", role: "group", "aria-label": "Columns" });
  const boxes = () => [...element.querySelectorAll("input")];
  const change = ({ target }) => {
    const columns = boxes().filter(({ checked }) => checked).map(({ value }) => value);
    if (columns.length > 0) say(columns);
    else target.checked = true;
  };
  element.append(
    h("span", {}, "Columns, each an asset"),
    ...values.map(({ name }) => h("label", {}, h("input", { type: "checkbox", name: "read-columns", value: name, checked: taken.includes(name), onchange: change }), name)),
  );
  return element;
}

const field = (label, control) => h("div", { class: "field" }, h("label", { for: control.id }, label), control);

/** Offers the bank's rate from a column to the form. */
function offered({ rate: { column, rates }, periods_per_year }, bank) {
  const last = rates.at(-1);
  const use = () => bank(last, periods_per_year);
  const label = `Take the bank\u2019s rate from ${column}: ${percent(last, 3)} a period`;
  return h("p", {}, h("button", { type: "button", class: "quiet", onclick: use }, label));
}

/** Returns the log-returns of columns date by date, null before the first of a column. */
export function byDate(series) {
  const [{ missing = 0, log_returns }] = series;
  return Array.from({ length: missing + log_returns.length }, (_, date) => series.map(({ missing = 0, log_returns }) => log_returns[date - missing] ?? null));
}

function picture({ series, dates }) {
  const [values, ...others] = series.map(({ missing = 0, log_returns }) => [...Array(missing).fill(null), ...log_returns.map(Math.expm1)]);
  const at = (index) => (index < values.length ? (dates?.[index] ?? String(index + 1)) : "");
  return lineChart({
    title: `Returns read, ${at(0)} to ${at(values.length - 1)}`,
    height: 130,
    // Leaves room for half of the last date.
    x: {
      values: values.map((_, index) => index),
      domain: [0, 1.05 * (values.length - 1)],
      label: dates ? "" : "Return",
      format: at,
      whole: true,
    },
    y: { format: (value) => percent(value, 2), tick: percentTick, also: [0] },
    series: [values, ...others].map((values, index) => ({ name: others.length > 0 ? series[index].column : "", kind: "line", bare: true, values })),
  });
}
