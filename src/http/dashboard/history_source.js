// Where a history of returns comes from: a file, typed numbers, or the example that Ballast carries.

import { text } from "./api.js";
import { logReturns, read } from "./csv.js";
import { announce, h } from "./dom.js";
import { counted, percent } from "./format.js";
import { moments } from "./specification.js";

const KINDS = { simple: "Simple returns", log: "Log-returns", price: "Prices" };
/** Twenty years of months: what the demo trains on. */
const USUAL_LENGTH = 240;

/** The part of a form that gives a history; `changed(logReturns)` whenever it does. */
export function historySource(changed) {
  const values = h("textarea", {
    id: "f-problem-history",
    name: "problem.history",
    rows: 4,
    spellcheck: "false",
    "aria-describedby": "history-note",
  });
  const note = h(
    "p",
    { class: "note", id: "history-note", role: "status" },
    "At least two log-returns, oldest first, separated by spaces, commas or lines.",
  );
  const columns = h("div", { class: "fields", hidden: true });
  const file = h("input", { type: "file", id: "csv", accept: ".csv,.tsv,.txt,text/csv,text/plain", class: "unseen" });
  const drop = h(
    "div",
    { class: "drop" },
    h(
      "p",
      {},
      file,
      h("label", { class: "button quiet", for: "csv" }, "Choose a CSV file"),
      " or drop one here. Columns of returns or prices are found by themselves.",
    ),
    h(
      "p",
      {},
      h(
        "button",
        { type: "button", class: "link", onclick: () => example() },
        "Use the example: US stock market, monthly",
      ),
    ),
  );
  const told = (returns) => {
    if (returns.length < 2) return;
    const { mean, deviation } = moments(returns);
    note.textContent = `${counted(returns.length, "log-return")}: mean ${percent(mean, 2)}, standard deviation ${percent(deviation, 2)} a period.`;
  };
  const show = (returns) => {
    if (values !== document.activeElement) values.value = returns.join(" ");
    told(returns);
  };
  const taken = (returns) => {
    show(returns);
    changed(returns);
  };
  values.addEventListener("input", () => {
    const words = values.value.split(/[\s,;]+/).filter((word) => word !== "");
    const returns = words.map((word) => (Number.isFinite(Number(word)) ? Number(word) : word));
    if (returns.every(Number.isFinite)) told(returns);
    changed(returns);
  });
  const open = (name, content) => {
    try {
      columns.replaceChildren(...columnFields(name, read(content), taken, fail));
      columns.hidden = false;
    } catch (error) {
      fail(error);
    }
  };
  const fail = (error) => {
    note.textContent = error.message;
    announce(error.message);
  };
  const example = async () => open("us_market_monthly.csv", await text("/dashboard/us_market_monthly.csv").catch(fail));
  file.addEventListener("change", async () => file.files[0] && open(file.files[0].name, await file.files[0].text()));
  drop.addEventListener("dragover", (event) => {
    event.preventDefault();
    drop.classList.add("over");
  });
  drop.addEventListener("dragleave", () => drop.classList.remove("over"));
  drop.addEventListener("drop", async (event) => {
    event.preventDefault();
    drop.classList.remove("over");
    const dropped = event.dataTransfer.files[0];
    if (dropped) open(dropped.name, await dropped.text());
  });
  const element = h(
    "fieldset",
    {},
    h("legend", {}, "The returns seen so far"),
    drop,
    columns,
    h("div", { class: "field wide" }, h("label", { for: values.id }, "Log-returns, as fractions"), values, note),
  );
  return { element, show };
}

/** Column, kind, unit and length of a file that was read; the first numeric column unless told otherwise. */
function columnFields(name, { columns, rows }, taken, fail) {
  const option = (value, words, selected) => h("option", { value, selected }, words);
  const column = h(
    "select",
    { id: "csv-column" },
    columns.map(({ name }, index) => option(index, name, index === 0)),
  );
  const kind = h(
    "select",
    { id: "csv-kind" },
    Object.entries(KINDS).map(([value, words]) => option(value, words)),
  );
  const unit = h(
    "select",
    { id: "csv-unit" },
    option("fraction", "Fractions (0.012)"),
    option("percent", "Percent (1.2)"),
  );
  const length = h("input", { id: "csv-length", type: "number", min: 2, max: rows });
  const use = () => {
    try {
      const returns = logReturns(columns[column.value].values, kind.value, unit.value === "percent");
      taken(returns.slice(-Math.max(2, Number(length.value) || returns.length)));
    } catch (error) {
      fail(error);
    }
  };
  const guessed = () => {
    const chosen = columns[column.value];
    kind.value = chosen.kind;
    unit.value = chosen.inPercent ? "percent" : "fraction";
    length.value = Math.min(chosen.values.length - (chosen.kind === "price" ? 1 : 0), USUAL_LENGTH);
    use();
  };
  column.addEventListener("change", guessed);
  for (const control of [kind, unit, length]) control.addEventListener("input", use);
  guessed();
  const field = (label, control) => h("div", { class: "field" }, h("label", { for: control.id }, label), control);
  return [
    field(`Column of ${name}`, column),
    field("It holds", kind),
    field("In", unit),
    field(`Latest rows, of ${rows}`, length),
  ];
}
