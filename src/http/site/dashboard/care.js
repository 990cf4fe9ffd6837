// The sessions that need care: their report is overdue, their next policy does not come, their returns have changed, or
// they end. The service reports the reasons of each session, and how many sessions there are.

import { counted, count } from "./format.js";
import { daysLate, isoDay } from "./periods.js";

/** Returns `{next, late}` of a session: when its next report is due, and by how many days it is overdue. */
export const care = ({ next, care }) => ({
  next,
  late: care.includes("overdue") ? Math.max(1, daysLate(next, isoDay(new Date()))) : 0,
});

const REASONS = {
  overdue: ["is overdue", "are overdue"],
  renewal: ["waits for its next policy", "wait for their next policies"],
  alarm: ["is in a market that has changed", "are in markets that have changed"],
  ending: ["is completed or in its last period", "are completed or in their last period"],
};

/** Says how many sessions need care, and why; `isWarned` if a warning of another kind stands above. */
export function careWords({ sessions, any, ...reasons }, isWarned = false) {
  if (any === 0 && isWarned) return "Otherwise no session needs care.";
  if (any === 0) return `None of ${counted(sessions, "session")} needs care.`;
  const parts = Object.entries(REASONS).filter(([reason]) => reasons[reason] > 0);
  const why = parts.map(([reason, [one, many]]) => `${count(reasons[reason])} ${reasons[reason] === 1 ? one : many}`).join(", ");
  return `${count(any)} of ${counted(sessions, "session")} ${any === 1 ? "needs" : "need"} care: ${why}.`;
}
