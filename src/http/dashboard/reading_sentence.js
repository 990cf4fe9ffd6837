// What was read, in the words a person can check it by.

import { told } from "./dates.js";
import { count, counted, percent } from "./format.js";
import { moments } from "./specification.js";

const KINDS = { simple: "simple return", log: "log-return" };
const UNITS = { percent: "in percent", fraction: "as fractions" };

/** Two sentences on the last `used` returns of a record: what they are and in which order, then their moments. */
export function sentence(record, used) {
  const { dates, rhythm, order, name, kind, returns } = record;
  const from = name === "" ? "" : ` from ${name}`;
  const span = dates ? `, ${rhythm.word}, ${spanOf(record, used)}` : "";
  const unit = rhythm?.unit ?? "period";
  const { mean, deviation } = moments(kind === "log" ? returns.slice(-used) : returns.slice(-used).map(Math.expm1));
  return [
    `${numberOf(record, used)}${from}${span}, ${order}.`,
    `Mean ${percent(mean, 2)}, standard deviation ${percent(deviation, 2)} a ${unit}.`,
    ...holes(record),
  ].join(" ");
}

/** "120 simple returns in percent", "the latest 240 of 1,108 returns of 1,109 prices". */
function numberOf({ kind, unit, values, returns }, used) {
  const latest = used < returns.length ? `The latest ${count(used)} of ` : "";
  if (kind === "price") return `${latest}${counted(returns.length, "return")} of ${counted(values.length, "price")}`;
  return `${latest}${counted(returns.length, KINDS[kind])} ${UNITS[unit]}`;
}

/** First and last date of the returns used; a price's own date stands for the return that led to it. */
function spanOf({ dates, rhythm }, used) {
  const [first, last] = [dates.at(-used), dates.at(-1)].map(({ moment }) => told(moment, rhythm.unit));
  return `${first} to ${last}`;
}

function holes({ rhythm, blank, remarks }) {
  const said = [];
  if (rhythm?.missing > 0) {
    const breaks = rhythm.unit === "day" ? "break of more than a week" : `missing ${rhythm.unit}`;
    const many =
      rhythm.missing === 1
        ? `One ${breaks} lies`
        : `${count(rhythm.missing)} ${breaks.replace(/^(missing \w+|break)/, "$1s")} lie`;
    said.push(`${many} between the rows, the first after ${told(rhythm.after.moment, rhythm.unit)}.`);
  }
  if (blank > 0) said.push(`${counted(blank, "blank cell")} before or after the numbers left out.`);
  if (remarks > 0) said.push(`${counted(remarks, "line")} of remarks passed over.`);
  return said;
}
