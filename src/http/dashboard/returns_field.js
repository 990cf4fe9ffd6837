// The field that takes returns: typed, pasted or out of a file, all by the one reader. What was read stands below it in a
// sentence, what cannot be told from the text is asked there, and until it is answered the form has no returns.

import { text } from "./api.js";
import { announce, h } from "./dom.js";
import { count } from "./format.js";
import { ASKED, read } from "./returns_reader.js";

const KINDS = { simple: "Simple returns", log: "Log-returns", price: "Prices" };
const UNITS = { percent: "Percent (1.2)", fraction: "Fractions (0.012)" };
const ORDERS = { oldest: "The oldest", newest: "The newest" };
/** Numbers are not judged while they are being typed, for so long, in milliseconds. */
const PAUSE = 300;
/** The market column of the example, and twenty years of its months: what the demo trains on. */
const EXAMPLE = { file: "/dashboard/us_market_monthly.csv", said: { column: 1, latest: 240 } };
const HINT = "Oldest first, or with dates in any order. Separated by spaces, commas, semicolons, tabs or lines.";

/**
 * `{element, show(logReturns), trouble()}`; `changed(logReturns)` at every change, with none of them while the text is not
 * one reading. `trouble()` reads what is still being typed, and says why there are no returns, or null. `name` is the
 * request's field; `blank` is what an empty field means, where it may be empty.
 */
export function returnsField({ name, label, blank = null, example = false, changed }) {
  const id = `f-${name.replace(/[^a-z0-9]+/gi, "-")}`;
  const area = h("textarea", { id, name, rows: 6, spellcheck: "false", "aria-describedby": `${id}-note` });
  const note = h("p", { class: "note", id: `${id}-note`, role: "status" });
  const asked = h("div", { class: "asked" });
  let [said, answer, pending] = [{}, { outcome: "nothing" }, 0];
  const judge = () => {
    clearTimeout(pending);
    pending = 0;
    answer = read(area.value, said);
    tell();
  };
  const take = () => {
    judge();
    changed(answer.returns ?? []);
  };
  const say = (more) => {
    said = { ...said, ...more };
    take();
  };
  const tell = () => {
    note.classList.toggle("wrong", answer.outcome === "refused");
    note.classList.toggle("telling", ["reading", "question"].includes(answer.outcome));
    note.textContent = answer.sentence ?? answer.message ?? (blank ? `${blank} ${HINT}` : HINT);
    asked.replaceChildren(...asking(answer, said, say, area));
  };
  const open = (content, known = {}) => {
    said = known;
    area.value = content;
    take();
  };
  area.addEventListener("input", (event) => {
    if (!isTyping(event)) said = {};
    clearTimeout(pending);
    if (isTyping(event)) pending = setTimeout(take, PAUSE);
    else take();
  });
  const trouble = () => {
    if (pending) take();
    if (answer.outcome === "reading") return null;
    if (answer.outcome === "nothing") return blank ? null : "Returns are needed: paste them, or choose a file.";
    return answer.outcome === "question" ? `To be answered first: ${answer.message}` : answer.message;
  };
  const show = (returns) => {
    said = { kind: "log", unit: "fraction", confirmed: true };
    area.value = returns.join(" ");
    judge();
  };
  const element = h(
    "div",
    {},
    drop(id, open, example),
    h("div", { class: "field wide" }, h("label", { for: id }, label), area, note, asked),
  );
  tell();
  return { element, show, trouble };
}

/** What is typed is mended word by word and keeps what was said of it; what is pasted is another text. */
const isTyping = ({ inputType = "" }) => /^(insertText|insertLineBreak|deleteContent|deleteWord)/.test(inputType);

/** Where a file is chosen or dropped. */
function drop(id, open, example) {
  const fail = (error) => announce(error.message);
  const file = h("input", {
    type: "file",
    id: `${id}-file`,
    accept: ".csv,.tsv,.txt,text/csv,text/plain",
    class: "unseen",
  });
  const opened = async (chosen) => chosen && open(await chosen.text());
  file.addEventListener("change", () => opened(file.files[0]));
  const chosen = h("label", { class: "button quiet", for: file.id }, "Choose a CSV file");
  const zone = h("div", { class: "drop" }, h("p", {}, file, chosen, " or drop one here, or paste below."));
  const load = () => text(EXAMPLE.file).then((content) => open(content, EXAMPLE.said), fail);
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

/** What a person can say of the text: the answers to a question, the place of a fault, or another reading. */
function asking(answer, said, say, area) {
  switch (answer.outcome) {
    case "question":
      return [h("div", { class: "actions", role: "group", "aria-label": answer.message }, answers(answer, say))];
    case "refused":
      return [
        shown(answer.place, area),
        Object.values(said).some((value) => value !== undefined) ? again(say) : null,
      ].filter(Boolean);
    case "reading":
      return [h("div", { class: "fields" }, otherwise(answer.settled, said, say))];
    default:
      return [];
  }
}

const answers = ({ choices }, say) =>
  choices.map(({ words, said }) => h("button", { type: "button", class: "quiet", onclick: () => say(said) }, words));

function again(say) {
  const forget = Object.fromEntries(ASKED.map((name) => [name, undefined]));
  return h("button", { type: "button", class: "link", onclick: () => say(forget) }, "Forget what was said of it");
}

function shown(place, area) {
  if (!place) return null;
  const go = () => {
    area.focus();
    area.setSelectionRange(place.start, place.start + place.text.length);
  };
  return h("button", { type: "button", class: "link", onclick: go }, "Show the place");
}

/** Choices that read the same text otherwise. What was said after the one that changes is asked anew. */
function otherwise({ kind, unit, columns, dated, all }, said, say) {
  const change = (name) => (value) => {
    const later = ASKED.slice(ASKED.indexOf(name) + 1).map((after) => [after, undefined]);
    say({ ...Object.fromEntries(later), [name]: value });
  };
  const choice = (name, label, choices, value) =>
    field(
      label,
      h(
        "select",
        { id: `read-${name}`, onchange: ({ target }) => change(name)(target.value) },
        options(choices, value),
      ),
    );
  const places = columns && Object.fromEntries(columns.map(({ words, said: { column } }) => [column, words]));
  const pick = ({ target }) => change("column")(Number(target.value));
  const keep = ({ target }) => say({ latest: Number(target.value) > 0 ? Number(target.value) : undefined });
  const latest = h("input", { id: "read-latest", type: "number", min: 2, max: all, onchange: keep });
  latest.value = Math.min(all, said.latest ?? all);
  return [
    places && field("Column", h("select", { id: "read-column", onchange: pick }, options(places, String(said.column)))),
    choice("kind", "They are", KINDS, kind),
    unit && choice("unit", "In", UNITS, unit),
    dated ? null : choice("order", "The first is", ORDERS, said.order ?? "oldest"),
    field(`Latest returns used, of ${count(all)}`, latest),
  ];
}

const field = (label, control) => h("div", { class: "field" }, h("label", { for: control.id }, label), control);

const options = (choices, chosen) =>
  Object.entries(choices).map(([value, words]) => h("option", { value, selected: value === chosen }, words));
