// The titles of a job and its report: from the policy, the assets and the history that they are about, or from their
// day.

import { get } from "./api.js";
import { counted, moment } from "./format.js";
import { dated, unitOf } from "./periods.js";

export const KINDS = { train: "Training", evaluate: "Evaluation", backtest: "Backtest", frontier: "Frontier of caution" };

/** A job of which no more is known, beside its kind. */
export const byDay = ({ created_ms }) => `, ${moment(created_ms)}`;

/** So many assets are named in a title. */
const NAMED = 3;

function ofAssets(assets) {
  if (!assets) return " of stocks";
  const rest = assets.length - NAMED;
  const named = rest > 0 ? [...assets.slice(0, NAMED), `${rest} more`] : assets;
  return ` of ${named.join(", ").replace(/, (?=[^,]*$)/, named.length > 1 ? " and " : ", ")}`;
}

const onRecord = ({ history }) => `, on ${counted(history.length, "return")}`;

const ABOUT = {
  async evaluate({ request: { problem, policies } }, signal) {
    const [policy] = Object.values(policies);
    const { name } = policy ? await get(`/policies/${policy}`, signal).catch(() => ({})) : {};
    return name ? ` of ${name}` : `${ofAssets(problem.assets)}${onRecord(problem)}, ${counted(problem.horizon, unitOf(problem.periods_per_year))} ahead`;
  },
  backtest({ assets, dates, periods, periods_per_year }) {
    const length = periods[0].wealth.length;
    return `${ofAssets(assets)}, ${dates ? `${dated(dates[0])} to ${dated(dates[length - 1])}` : counted(length, unitOf(periods_per_year))}`;
  },
  frontier: ({ request: { problem } }) => `${ofAssets(problem.assets)}${onRecord(problem)}`,
};

/** What the report of a job of some kind is about, to stand behind the kind. */
export const about = async (kind, report, signal) => ABOUT[kind](report, signal);

/** What is in a report does not change; what a policy is called does. */
const known = new Map();

/** As `about`, to `then`, once `element` is seen: a report is long, and most of a list is not looked at. */
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
