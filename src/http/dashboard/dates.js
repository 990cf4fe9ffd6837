// Dates of a record's rows: in one form for the whole column, never guessed row by row, and never taken for numbers.
//
// A moment is `{year, month, day}`; a form says how fine it is. Years of two digits are no dates here: Jan-20 is a day or a
// month, of this century or the last.

import { Question } from "./outcomes.js";

const MONTHS = [
  "January",
  "February",
  "March",
  "April",
  "May",
  "June",
  "July",
  "August",
  "September",
  "October",
  "November",
  "December",
];
const NAME = `(${MONTHS.map((name) => name.slice(0, 3)).join("|")})[a-z]*\\.?`;
const TIME = "(?:[T ]\\d{1,2}:\\d{2}.*)?";
const [EARLIEST, LATEST] = [1700, 2200];
/** A column is one of dates where so many of its cells are: written apart by marks, or in digits that might be numbers. */
const MOSTLY = { marked: 0.5, digits: 0.9 };
/** 1-2020 is the shortest date that is no number. */
const SHORTEST = 6;
/** Rows by which the forms of a column are told from those that cannot be its. */
const FIRST = 50;
const DAY_MILLISECONDS = 86_400_000;

const byName = (name) => MONTHS.findIndex((month) => month.slice(0, 3).toLowerCase() === name.toLowerCase()) + 1;
const form = (pattern, fine, order, digits = false) => ({
  pattern: new RegExp(`^${pattern}$`, "i"),
  fine,
  order,
  digits,
});

/** `order` says what each group of the pattern is; D and M are the same day and month as d and m, in the American order. */
const FORMS = [
  form(`(\\d{4})[-/.](\\d{1,2})[-/.](\\d{1,2})${TIME}`, "day", "ymd"),
  form("(\\d{4})[-/](\\d{1,2})", "month", "ym"),
  form("(\\d{4})M(\\d{1,2})", "month", "ym"),
  form(`(\\d{1,2})[./-](\\d{1,2})[./-](\\d{4})${TIME}`, "day", "dmy"),
  form(`(\\d{1,2})[/-](\\d{1,2})[/-](\\d{4})${TIME}`, "day", "mdy"),
  form("(\\d{1,2})[./-](\\d{4})", "month", "my"),
  form(`(\\d{1,2})[ .-]*${NAME}[ ,-]*(\\d{4})`, "day", "dny"),
  form(`${NAME} (\\d{1,2}),? (\\d{4})`, "day", "ndy"),
  form(`${NAME}[ -]?(\\d{4})`, "month", "ny"),
  form(`(\\d{4})[ -]?${NAME}`, "month", "yn"),
  form("(\\d{4})[ -]?Q([1-4])", "quarter", "yq"),
  form("Q([1-4])[ -]?(\\d{4})", "quarter", "qy"),
  form("(\\d{4})(\\d{2})(\\d{2})", "day", "ymd", true),
  form("(\\d{4})(\\d{2})", "month", "ym", true),
];
const YEARS = form("(\\d{4})", "year", "y", true);
const PARTS = {
  y: (text) => ({ year: Number(text) }),
  m: (text) => ({ month: Number(text) }),
  d: (text) => ({ day: Number(text) }),
  n: (text) => ({ month: byName(text) }),
  q: (text) => ({ month: 3 * Number(text) }),
};

/** The moment that `text` is in one form, or null. */
function momentOf(text, { pattern, order }) {
  const found = pattern.exec(text);
  if (!found) return null;
  const parts = [...order].map((part, index) => PARTS[part](found[index + 1]));
  const { year, month = 1, day = 1 } = Object.assign({}, ...parts);
  const real = month >= 1 && month <= 12 && day >= 1 && day <= new Date(Date.UTC(year, month, 0)).getUTCDate();
  return real && year >= EARLIEST && year <= LATEST ? { year, month, day } : null;
}

/** Whether `text` alone is a date that no one would take for a number. */
export const couldBeDate = (text) =>
  text.length >= SHORTEST && FORMS.some((form) => !form.digits && momentOf(text, form) !== null);

/**
 * The form of a column's cells, or null where they are no dates. `alone` where nothing else stands in the rows: then years
 * may as well be prices and are no dates. A reader is asked where day and month can change places.
 */
export function formOf(texts, said, { alone = false } = {}) {
  const [first, ...others] = bestForms(texts);
  if (first === undefined) return !alone && areYears(texts) ? YEARS : null;
  const american = others.find(({ order }) => order === "mdy");
  if (first.order !== "dmy" || !american) return first;
  if (said.dates) return said.dates === "month" ? american : first;
  const doubtful = texts.find((text) => told(momentOf(text, first), "day") !== told(momentOf(text, american), "day"));
  if (doubtful === undefined) return first;
  const words = (form) => told(momentOf(doubtful, form), "day");
  throw new Question("dates", `Which day is ${doubtful}?`, [
    { words: words(first), said: { dates: "day" } },
    { words: words(american), said: { dates: "month" } },
  ]);
}

/** The forms that most of the texts are in, of all that fit them. A form that none of the first is in fits no column. */
function bestForms(texts) {
  const [first, share] = [
    texts.slice(0, FIRST),
    (some, form) => some.filter((text) => momentOf(text, form)).length / some.length,
  ];
  const shares = FORMS.filter((form) => share(first, form) > 0).map((form) => ({ form, share: share(texts, form) }));
  const fitting = shares.filter(({ form, share }) => share >= (form.digits ? MOSTLY.digits : MOSTLY.marked));
  const best = Math.max(0, ...fitting.map(({ share }) => share));
  return fitting.filter(({ share }) => share === best).map(({ form }) => form);
}

/** Whole numbers of four digits that go up or down by one. */
function areYears(texts) {
  const moments = texts.map((text) => momentOf(text, YEARS));
  if (moments.length < 2 || moments.includes(null)) return false;
  const steps = moments.slice(1).map(({ year }, index) => year - moments[index].year);
  return steps.every((step) => step === steps[0]) && Math.abs(steps[0]) === 1;
}

/** A date of a row: `{moment, rank, fine}`, ranks in the order of time; null where `text` is none in this form. */
export function dateOf(text, form) {
  const moment = momentOf(text, form);
  return (
    moment && { moment, fine: form.fine, rank: Date.UTC(moment.year, moment.month - 1, moment.day) / DAY_MILLISECONDS }
  );
}

/** How far apart rows are: the word for it, the unit of one period, and how many are missing between neighbours. */
const RHYTHMS = [
  { days: [1, 4], word: "daily", unit: "day" },
  { days: [5, 9], word: "weekly", unit: "week", span: 7 },
  { days: [26, 33], word: "monthly", unit: "month", months: 1 },
  { days: [85, 97], word: "quarterly", unit: "quarter", months: 3 },
  { days: [350, 380], word: "yearly", unit: "year", months: 12 },
];
/** Days without a row that a holiday explains. */
const LONGEST_BREAK = 7;

/** The rhythm of dates in order: `{word, unit, missing, after}`, `after` the date before the first hole. */
export function rhythmOf(dates) {
  const gaps = dates.slice(1).map(({ rank }, index) => rank - dates[index].rank);
  if (gaps.length === 0) return { word: "one date", unit: "period", missing: 0 };
  const median = [...gaps].sort((a, b) => a - b)[(gaps.length - 1) >> 1];
  const found = RHYTHMS.find(({ days: [low, high] }) => median >= low && median <= high);
  if (found === undefined) return { word: "at uneven distances", unit: "period", missing: 0 };
  const holes = gaps.map((gap, index) => missingIn(found, dates[index], dates[index + 1], gap));
  const missing = holes.reduce((sum, hole) => sum + hole, 0);
  return { word: found.word, unit: found.unit, missing, after: dates[holes.findIndex((hole) => hole > 0)] };
}

function missingIn({ months, span }, from, to, gap) {
  if (months) return Math.max(0, Math.round(monthsBetween(from.moment, to.moment) / months) - 1);
  if (span) return Math.max(0, Math.round(gap / span) - 1);
  return gap > LONGEST_BREAK ? 1 : 0;
}

const monthsBetween = (from, to) => 12 * (to.year - from.year) + to.month - from.month;

/** A moment in words, as fine as the rows are. */
export function told({ year, month, day }, unit) {
  if (unit === "year") return String(year);
  if (unit === "quarter") return `Q${Math.ceil(month / 3)} ${year}`;
  if (unit === "month") return `${MONTHS[month - 1]} ${year}`;
  return `${day} ${MONTHS[month - 1]} ${year}`;
}
