// Which sessions need care: those whose report is overdue, that wait for their next policy, or whose returns have changed.

import { counted, count } from "./format.js";
import { daysLate, isoDay, nextDay } from "./periods.js";

/** A policy that is to follow is there within this, in milliseconds, unless something keeps it. */
const TRAINED = 3_600_000;

/** `{of(entry)}`: `{next, late, stuck, changed}` of a session at the moment `now`: when its next report is due by the calendar of its policy, a
 * period after the last day that it said, else after the day it reported last, or was opened; by how many days that is overdue;
 * whether its next policy fails to come; and whether its returns have changed. */
export function care(now) {
  const today = isoDay(new Date(now));
  const dueAfter = new Map();
  const due = (date, periods) => {
    const key = `${date} ${periods}`;
    if (!dueAfter.has(key)) dueAfter.set(key, nextDay(date, periods));
    return dueAfter.get(key);
  };
  const of = ({ date, last_report_ms, created_ms, periods_per_year, state, due: awaits, drift }) => {
    const next = state === "completed" ? null : due(date ?? isoDay(new Date(last_report_ms ?? created_ms)), periods_per_year);
    const stuck = awaits && now - (last_report_ms ?? created_ms) > TRAINED;
    return { next, late: next === null ? 0 : daysLate(next, today), stuck, changed: state !== "completed" && drift === "alarm" };
  };
  return { of, needs: (entry) => isBad(of(entry)) };
}

const isBad = ({ late, stuck, changed }) => late > 0 || stuck || changed;

const REASONS = [
  [({ late }) => late > 0, "is overdue", "are overdue"],
  [({ stuck }) => stuck, "waits for its next policy", "wait for their next policies"],
  [({ changed }) => changed, "has returns that have changed", "have returns that have changed"],
];

/** How many of the active sessions need care, and why, in a sentence. */
export function careWords(entries, { of }) {
  const active = entries.filter(({ state }) => state !== "completed");
  const found = active.map(of).filter(isBad);
  if (found.length === 0) return `None of ${counted(active.length, "active session")} needs care.`;
  const parts = REASONS.map(([is, one, many]) => [found.filter(is).length, one, many]).filter(([times]) => times > 0);
  const why = parts.map(([times, one, many]) => `${count(times)} ${times === 1 ? one : many}`).join(", ");
  return `${count(found.length)} of ${counted(active.length, "active session")} ${found.length === 1 ? "needs" : "need"} care: ${why}.`;
}
