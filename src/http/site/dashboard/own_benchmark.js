// A benchmark of the reader's own beside a session's track record: returns by date, pasted here, shown and not kept.

import { disclosure, h } from "./dom.js";
import { input } from "./form.js";
import { colourOf } from "./strategies.js";
import { returnsField } from "./returns_field.js";

/** Units of periods that are matched by their month, because a month may end on another day elsewhere. */
const BY_MONTH = ["month", "quarter", "year"];

/** Returns a day, month or year as the last day that it may hold, to be compared as text. */
const lastDay = (date) => `${date}${{ 4: "-12-31", 7: "-31" }[date.length] ?? ""}`;

/**
 * Returns the simple return of each period, compounded from dated log-returns; null for a period that they do not cover. `ends` are the last
 * days of the periods, that before the first included. A period with fewer than half of the usual number of returns is not covered.
 */
export function inPeriods(dates, log_returns, ends, unit) {
  const key = (date) => (BY_MONTH.includes(unit) ? lastDay(date).slice(0, 7) : lastDay(date));
  const keys = dates.map(key);
  const within = ends.slice(1).map((end, index) => log_returns.filter((_, k) => keys[k] > key(ends[index]) && keys[k] <= key(end)));
  const usual = within.map(({ length }) => length).sort((one, other) => one - other)[within.length >> 1];
  return within.map((some) => (some.length === 0 || 2 * some.length < usual ? null : Math.expm1(some.reduce((sum, value) => sum + value, 0))));
}

/** Returns the part of the page where a benchmark is pasted; `show(line)` draws it beside the others, and nothing for null. */
export function ownBenchmark(calendar, length, show) {
  const ends = Array.from({ length: length + 1 }, (_, period) => calendar.date(period));
  if (ends.includes(null)) return h("p", { class: "note asked-for" }, "A benchmark of your own needs the dates of all periods.");
  const build = () => {
    const line = h("p", { class: "note", role: "status" });
    let found = null;
    const draw = () => show(found && { name: name.control.value.trim() || "My benchmark", colour: colourOf("own"), wealth: found });
    const name = input({ name: "benchmark_name", label: "Its name", value: "My benchmark", inputmode: "text", maxlength: 60, changed: draw });
    const changed = (series, answer) => {
      found = null;
      line.textContent = "";
      if (series.length > 0) {
        const returns = answer.dates ? inPeriods(answer.dates, series[0].log_returns, ends, calendar.unit) : [null];
        const missing = returns.flatMap((back, index) => (back === null ? [calendar.name(index + 1)] : []));
        if (!answer.dates) line.textContent = "The returns need dates.";
        else if (missing.length > 0) line.textContent = `No return for ${missing.slice(0, 3).join(", ")}${missing.length > 3 ? " and others" : ""}.`;
        else found = returns.reduce((levels, back) => [...levels, levels.at(-1) * (1 + back)], [100]);
      }
      draw();
    };
    name.element.classList.add("choosing");
    const returns = returnsField({ name: "benchmark", label: "Its returns or prices, with dates", blank: "Shown here, and not kept.", changed });
    return h("div", {}, name.element, returns.element, line);
  };
  return h("section", { class: "asked-for", "aria-label": "A benchmark of your own" }, disclosure("Compare with a benchmark of your own", build));
}
