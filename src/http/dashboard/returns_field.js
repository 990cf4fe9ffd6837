// The field that takes returns: typed, pasted or out of a file, all read by the service. What was read stands below it in a
// sentence and a chart, what cannot be told from the text is asked there, and until it is answered the form has no returns.

import { post, text } from "./api.js";
import { lineChart } from "./chart.js";
import { announce, h } from "./dom.js";
import { count, percent, percentTick } from "./format.js";

const KINDS = { simple: "Simple returns", log: "Log-returns", price: "Prices" };
const UNITS = { percent: "Percent (1.2)", fraction: "Fractions (0.012)" };
const ORDERS = { false: "The oldest", true: "The newest" };
/** Numbers are not judged while they are being typed, for so long, in milliseconds. */
const PAUSE = 300;
/** The service takes no longer history, and a chart shows no more. */
const MOST = 20_000;
/** Months of the US stock market. */
const EXAMPLE = "/dashboard/us_market_monthly.csv";
const HINT = "With dates, or oldest first. Separated by spaces, commas, semicolons, tabs or lines.";
/** What was said of these is asked anew once another column or kind is chosen. */
const FOLLOWS = { columns: ["kind", "unit", "large_deviation", "decimal_comma"], kind: ["unit", "large_deviation"] };

/**
 * `{element, show(logReturns), trouble()}`; `changed(logReturns, answer)` at every change, with none of them and null while the
 * text is not one reading, else with all that the service read. `trouble()` waits for what is still being read, and says why there are no returns, or null. `name` is the
 * request's field; `blank` is what an empty field means, where it may be empty; `example` what is said of the bundled returns
 * where they are offered; `bank(rate, periodsPerYear)` takes what a
 * column says that the bank paid last.
 */
export function returnsField({ name, label, blank = null, example = null, changed, bank = null }) {
  const id = `f-${name.replace(/[^a-z0-9]+/gi, "-")}`;
  const area = h("textarea", { id, name, rows: 6, spellcheck: "false", "aria-describedby": `${id}-note` });
  area.dataset.described = `${id}-note`;
  const note = h("p", { class: "note", id: `${id}-note`, role: "status", tabindex: -1 });
  const asked = h("div", { class: "asked" });
  let [said, answer, pending, reading, asking] = [{}, null, 0, Promise.resolve(), new AbortController()];
  const tell = (outcome, sentence) => {
    note.classList.toggle("wrong", outcome === "refused");
    note.classList.toggle("telling", outcome === "read" || outcome === "asked");
    note.textContent = sentence;
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
    asked.replaceChildren(...below(answer, { said, say, forget, area, bank }));
  };
  const take = () => {
    clearTimeout(pending);
    pending = 0;
    changed([], null);
    reading = judge().then(() => answer?.outcome === "read" && changed(answer.series[0].log_returns, answer));
    return reading;
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
    if (isTyping(event)) pending = setTimeout(take, PAUSE);
    else open(area.value);
  });
  const trouble = async () => {
    await (pending ? take() : reading);
    if (answer?.outcome === "read") return null;
    if (answer === null) return blank ? null : "Returns are needed: paste them, or choose a file.";
    return answer.outcome === "asked" ? `To be answered first: ${words(answer)}` : words(answer);
  };
  const show = (returns) => {
    said = { kind: "log", unit: "fraction", large_deviation: true };
    area.value = returns.join(" ");
    reading = judge();
  };
  const element = h(
    "div",
    {},
    drop(id, open, example),
    h("div", { class: "field wide" }, h("label", { for: id }, label), area, note, asked),
  );
  judge();
  return { element, show, trouble };
}

const words = ({ sentence, questions }) => {
  const said = sentence ?? questions.map(({ question }) => question).join(" ");
  return said.charAt(0).toUpperCase() + said.slice(1);
};

/** What is typed is mended word by word and keeps what was said of it; what is pasted is another text. */
const isTyping = ({ inputType = "" }) => /^(insertText|insertLineBreak|deleteContent|deleteWord)/.test(inputType);

/** The text of a file: UTF-16 where its first bytes say so. */
async function content(file) {
  const bytes = await file.arrayBuffer();
  const [first, second] = new Uint8Array(bytes);
  const wide = { "255 254": "utf-16le", "254 255": "utf-16be" }[`${first} ${second}`];
  return new TextDecoder(wide ?? "utf-8").decode(bytes);
}

/** Where a file is chosen or dropped. */
function drop(id, open, example) {
  const fail = (error) => announce(error.message);
  const file = h("input", {
    type: "file",
    id: `${id}-file`,
    accept: ".csv,.tsv,.txt,text/csv,text/plain",
    class: "unseen",
  });
  const opened = async (chosen) => chosen && open(await content(chosen));
  file.addEventListener("change", () => opened(file.files[0]));
  const chosen = h("label", { class: "button quiet", for: file.id }, "Choose a CSV file");
  const zone = h("div", { class: "drop" }, h("p", {}, file, chosen, " or drop one here, or paste below."));
  const load = () => text(EXAMPLE).then((content) => open(content, example), fail);
  const offer = h(
    "button",
    { type: "button", class: "link", onclick: load },
    "Use the example: US stock market, monthly",
  );
  if (example) zone.append(h("p", {}, offer));
  zone.addEventListener("dragover", (event) => {
    event.preventDefault();
    zone.classList.add("over");
  });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    zone.classList.remove("over");
    opened(event.dataTransfer.files[0]);
  });
  return zone;
}

/** What a person can say of the text: the answers to questions, the place of a fault, or another reading. */
function below(answer, { said, say, forget, area, bank }) {
  const again = h("button", { type: "button", class: "link", onclick: forget }, "Forget what was said of it");
  const isSaid = Object.keys(said).some((name) => name !== "latest");
  switch (answer.outcome) {
    case "asked":
      return [questions(answer.questions, say), ...(isSaid ? [again] : [])];
    case "refused":
      return [...(answer.place ? [shown(answer.place, area)] : []), ...(isSaid ? [again] : [])];
    default:
      return [
        h("div", { class: "fields" }, otherwise(answer, said, say)),
        ...(bank && answer.rate ? [offered(answer, bank)] : []),
        ...(answer.series[0].log_returns.length <= MOST ? [picture(answer)] : []),
      ];
  }
}

/** Each question with its answers as radio buttons, and one button that takes them all. */
function questions(asked, say) {
  const group = ({ asks, question, options }) =>
    h(
      "fieldset",
      {},
      h("legend", {}, question),
      options.map(({ label, sentence }, index) =>
        h(
          "label",
          { class: "option" },
          h("input", { type: "radio", name: `asked-${asks}`, value: index }),
          h("span", {}, label, sentence ? h("span", { class: "note" }, ` ${sentence}`) : null),
        ),
      ),
    );
  const groups = asked.map(group);
  const answered = () => {
    const chosen = groups.map((group) => group.querySelector(":checked"));
    const open = chosen.indexOf(null);
    if (open >= 0) return groups[open].querySelector("input").focus();
    say(Object.assign({}, ...chosen.map(({ value }, index) => asked[index].options[value].choices)));
  };
  const button = h("button", { type: "button", class: "quiet", onclick: answered }, "Read it so");
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

/** Choices that read the same text otherwise. */
function otherwise({ columns, series, newest_first, count: all }, said, say) {
  const [{ column, kind, unit }] = series;
  const values = columns.filter(({ name, holds }) => holds === "values" || name === column);
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
    values.length > 1 && choice("columns", "Column", names, column, (name) => [name]),
    choice("kind", "They are", KINDS, kind),
    unit && choice("unit", "In", UNITS, unit),
    newest_first !== undefined &&
      choice("newest_first", "The first is", ORDERS, String(newest_first), (value) => value === "true"),
    field(`Latest returns used, of ${count(all)}`, latest),
  ];
}

const field = (label, control) => h("div", { class: "field" }, h("label", { for: control.id }, label), control);

/** What a column says of the bank, for the form to take. */
function offered({ rate: { column, rates }, periods_per_year }, bank) {
  const last = rates.at(-1);
  const use = () => bank(last, periods_per_year);
  const label = `Take the bank\u2019s rate from ${column}: ${percent(last, 3)} a period`;
  return h("p", {}, h("button", { type: "button", class: "quiet", onclick: use }, label));
}

function picture({ series: [{ log_returns }], dates }) {
  const values = log_returns.map(Math.expm1);
  const at = (index) => (index < values.length ? (dates?.[index] ?? String(index + 1)) : "");
  return lineChart({
    title: `Returns read, ${at(0)} to ${at(values.length - 1)}`,
    height: 130,
    // Room for half of the last date.
    x: {
      values: values.map((_, index) => index),
      domain: [0, 1.05 * (values.length - 1)],
      label: dates ? "" : "Return",
      format: at,
      whole: true,
    },
    y: { format: (value) => percent(value, 2), tick: percentTick, also: [0] },
    series: [{ name: "", kind: "line", bare: true, values }],
  });
}
