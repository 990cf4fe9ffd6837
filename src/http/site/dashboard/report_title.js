// The titles of a job and its report: from the policy, the assets and the history that they are about, or from their
// day.

import { get } from "./api.js";
import { counted, moment } from "./format.js";
import { dated, unitOf } from "./periods.js";

export const KINDS = { train: "Training", evaluate: "Evaluation", backtest: "Backtest", frontier: "Frontier of caution" };

/** Describes a job by its time, if nothing else is known besides its kind. */
export const byDay = ({ created_ms }) => `, ${moment(created_ms)}`;

/** Most assets named in a title. */
const NAMED = 3;

function ofAssets(assets) {
  if (!assets) return " of stocks";
  const rest = assets.length - NAMED;
  const named = rest > 0 ? [...assets.slice(0, NAMED), `${rest} more`] : assets;
  return ` of ${named.join(", ").replace(/, (?=[^,]*$)/, named.length > 1 ? " and " : ", ")}`;
}

const onRecord = ({ history }) => `, on ${counted(history.length, "return")}`;

const ABOUT = {
  async evaluate({ request: { problem, policies }, problem: declared }, signal) {
    const [policy] = Object.values(policies);
    const { name } = policy ? await get(`/policies/${policy}`, signal).catch(() => ({})) : {};
    if (name) return ` of ${name}`;
    // A comparison has a declaration in the place of an investor's problem.
    if (declared) return `${ofAssets(Object.keys(declared.actions))}, ${counted(declared.horizon, "period")} ahead`;
    return `${ofAssets(problem.assets)}${onRecord(problem)}, ${counted(problem.horizon, unitOf(problem.periods_per_year))} ahead`;
  },
  backtest({ request, assets, dates, periods, periods_per_year }) {
    // The walk-forward of a declared problem has one too.
    if (request?.problem) return `${ofAssets(Object.keys(request.problem.actions))}, ${counted(request.problem.history.length - request.window, "period")}`;
    const length = periods[0].wealth.length;
    return `${ofAssets(assets)}, ${dates ? `${dated(dates[0])} to ${dated(dates[length - 1])}` : counted(length, unitOf(periods_per_year))}`;
  },
  frontier: ({ request: { problem } }) => `${ofAssets(problem.assets)}${onRecord(problem)}`,
};

/** Returns what a report is about, as the text after its kind in a title. */
export const about = async (kind, report, signal) => ABOUT[kind](report, signal);

/** Titles by job: the content of a report does not change, but the name of a policy may. */
const known = new Map();

/** Passes the result of `about` to `then` once `element` is visible: reports are long, and most of a list is never seen. */
export function whenSeen(element, { job, kind, report }, then) {
  const observer = new IntersectionObserver(async ([{ isIntersecting }]) => {
    if (!isIntersecting) return;
    observer.disconnect();
    const words = known.get(job) ?? (await get(report).then((report) => about(kind, report)).catch(() => null));
    if (words && kind !== "evaluate") known.set(job, words);
    if (words) then(words);
  });
  observer.observe(element);
}
