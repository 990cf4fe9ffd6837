// Records written in every form that a spreadsheet or a program has, drawn at random: what is read is what was written, or
// it is asked, or refused. Nothing is read as something else.

import assert from "node:assert/strict";
import { test } from "node:test";
import { dashboardModule } from "./modules.js";

const { read } = await dashboardModule("returns_reader.js");

/** A generator of its own, so that a failure can be repeated. */
function random(seed) {
  let state = seed;
  const next = () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
  const whole = (low, high) => low + Math.floor(next() * (high - low + 1));
  return { next, whole, one: (choices) => choices[whole(0, choices.length - 1)] };
}

const NAMES = ["January", "February", "March", "April", "May", "June", "July", "August", "September", "October", "November", "December"];
const two = (value) => String(value).padStart(2, "0");
const DATES = [
  ({ y, m }) => `${y}-${two(m)}`,
  ({ y, m, d }) => `${y}-${two(m)}-${two(d)}`,
  ({ y, m, d }) => `${y}${two(m)}${two(d)}`,
  ({ y, m }) => `${y}${two(m)}`,
  ({ y, m, d }) => `${d}.${m}.${y}`,
  ({ y, m, d }) => `${two(d)}/${two(m)}/${y}`,
  ({ y, m, d }) => `${m}/${d}/${y}`,
  ({ y, m }) => `${NAMES[m - 1].slice(0, 3)} ${y}`,
  ({ y, m, d }) => `${y}-${two(m)}-${two(d)} 00:00:00`,
];

const marked = (value, decimal) => (decimal === "," ? value.replace(".", ",") : value);

function thousands(value, decimal) {
  const [whole, part] = value.split(".");
  const apart = whole.replace(/\B(?=(\d{3})+$)/g, decimal === "," ? "." : ",");
  return part ? `${apart}${decimal}${part}` : apart;
}

/** A record of monthly returns and one way of writing it down. */
function written(seed) {
  const { next, whole, one } = random(seed);
  const count = whole(6, 40);
  // Below a tenth of a percent a period the reader takes numbers for fractions, and says so.
  const size = one([0.006, 0.01, 0.04, 0.08]);
  const returns = Array.from({ length: count }, () => Number((size * (next() + next() + next() - 1.4)).toFixed(5)));
  const start = 12 * whole(1990, 2015) + whole(0, 11);
  const day = one([1, 15, 28]);
  const months = returns.map((_, k) => ({ y: Math.floor((start + k) / 12), m: ((start + k) % 12) + 1, d: day }));
  const kind = one(["fraction", "percent", "sign", "price"]);
  const decimal = one([".", ","]);
  const prices = returns.reduce((path, value) => [...path, path.at(-1) * (1 + value)], [whole(20, 4000)]);
  const cells = {
    fraction: () => returns.map((value) => marked(value.toFixed(5), decimal)),
    percent: () => returns.map((value) => marked((100 * value).toFixed(3), decimal)),
    sign: () => returns.map((value) => marked(`${(100 * value).toFixed(3)}%`, decimal)),
    price: () => prices.slice(1).map((value) => (thousands(value.toFixed(4), decimal))),
  }[kind]();
  const truth = kind === "price" ? returns.slice(1) : returns;
  const dated = next() < 0.7;
  const delimiter = decimal === "," ? one([";", "\t"]) : one([",", ";", "\t"]);
  const quote = (cell) => (cell.includes(delimiter) || next() < 0.1 ? `"${cell}"` : cell);
  const spell = one(DATES);
  const rows = cells.map((cell, k) => (dated ? [spell(months[k]), cell] : [cell]).map(quote).join(delimiter));
  const order = dated ? one(["oldest", "newest", "mixed"]) : "oldest";
  if (order === "newest") rows.reverse();
  if (order === "mixed") rows.sort(() => next() - 0.5);
  const heading = one([null, dated ? ["date", "fund"] : ["fund"]]);
  const lines = heading ? [heading.join(delimiter), ...rows] : rows;
  return { text: lines.join(one(["\n", "\r\n"])), truth, dated, kind };
}

const CASES = 4000;

test(`${CASES} records are read as written, asked about or refused`, (t) => {
  const outcomes = { reading: 0, question: 0, refused: 0 };
  for (let seed = 1; seed <= CASES; seed++) {
    const { text, truth } = written(seed);
    const answer = read(text);
    outcomes[answer.outcome]++;
    if (answer.outcome !== "reading") continue;
    const words = () => `seed ${seed}: ${answer.sentence}\n${text}`;
    assert.equal(answer.returns.length, truth.length, words());
    const wrong = answer.returns.findIndex((value, k) => Math.abs(Math.expm1(value) - truth[k]) > 2e-5);
    assert.equal(wrong, -1, words());
  }
  t.diagnostic(JSON.stringify(outcomes));
  assert.equal(outcomes.refused, 0, "a record well written is not refused");
  assert.ok(outcomes.reading > CASES / 2, JSON.stringify(outcomes));
});

test("a cell out of place is never passed over", () => {
  for (let seed = 1; seed <= 500; seed++) {
    const { text, truth } = written(seed);
    const { whole, one } = random(seed + 1e6);
    const rows = text.split("\n");
    const at = whole(1, rows.length - 1);
    rows[at] = rows[at].replace(/[^;,\t"]*"?(\r?)$/, `${one(["NA", "n/a", "#N/A", "x", "-", "null"])}$1`);
    const answer = read(rows.join("\n"));
    assert.notEqual(answer.outcome, "reading", `seed ${seed}: ${answer.sentence}, ${truth.length} were written\n${rows.join("\n")}`);
  }
});

test("any text gets an answer", () => {
  const pieces = ["1", "0.5", "-2", ",", ";", "\t", " ", "\n", '"', "%", "2020-01", "20200101", "a", "#", ".", "-", "1,234", "\u2212", "e5", "\ufeff"];
  for (let seed = 1; seed <= 5000; seed++) {
    const { whole, one } = random(seed);
    const text = Array.from({ length: whole(0, 30) }, () => one(pieces)).join("");
    const { outcome } = read(text);
    assert.ok(["nothing", "refused", "question", "reading"].includes(outcome), `${JSON.stringify(text)}: ${outcome}`);
  }
});
