// Comparisons of strategies: through simulated futures, and through a history that happened.

import { h } from "./dom.js";
import { jobList } from "./jobs.js";
import { foot, Pages } from "./pages.js";

const KINDS = ["evaluate", "backtest"];

export async function view(_, leaving) {
  const pages = new Pages("/jobs", "jobs", leaving, { keep: ({ kind }) => KINDS.includes(kind) });
  const entries = await pages.next();
  const actions = h(
    "div",
    { class: "actions" },
    h("a", { class: "button quiet", href: "#/backtests/new" }, "Backtest a record"),
    h("a", { class: "button", href: "#/evaluations/new" }, "Compare out of sample"),
  );
  const lead =
    "No evaluation yet. An evaluation runs every kind of policy, and simple constant mixes, through the same futures and shows the wealth that each ends with. A backtest runs them through a record of returns.";
  if (entries.length === 0) return { title: "Evaluations", actions, body: h("p", { class: "lead" }, lead) };
  const jobs = jobList(entries, leaving);
  return {
    title: "Evaluations",
    actions,
    body: [jobs.element, foot(pages, ["evaluation", "evaluations"], entries.length, jobs.add)],
  };
}
