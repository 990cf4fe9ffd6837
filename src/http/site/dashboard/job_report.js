// The page of a job's report: the job until it is done, then the report as its own module draws it.

import { download, get } from "./api.js";
import * as backtest from "./backtest.js";
import * as comparison from "./comparison.js";
import * as declaredWalk from "./declared_walk.js";
import { h } from "./dom.js";
import * as evaluation from "./evaluation.js";
import { pressed } from "./form.js";
import { moment, short } from "./format.js";
import * as frontier from "./frontier.js";
import { until } from "./jobs.js";
import { policyLink } from "./naming.js";
import { save } from "./picture.js";
import { about, KINDS } from "./report_title.js";

const EVALUATIONS = ["Evaluations", "#/evaluations"];

/** Returns the view of a report. `drawn.body(report)` draws the page; `drawn.csv(report)`, if present, makes a CSV file. */
const reported = (kind, [above, href], drawn) => async (id, leaving) => {
  const job = await get(`/jobs/${id}`, leaving);
  const trail = h("p", { class: "trail" }, h("a", { href }, above));
  const under = h("p", { class: "note", title: id }, `Requested on ${moment(job.created_ms)}`);
  if (job.state !== "succeeded") return { title: KINDS[kind], trail, under, body: until(job, leaving) };
  const report = await get(job.report, leaving);
  const title = `${KINDS[kind]}${await about(kind, report, leaving)}`;
  const name = `${kind}-${short(id)}`;
  const sheet = drawn.csv && h("button", { class: "quiet", onclick: () => save(drawn.csv(report), `${name}.csv`, "text/csv") }, "Save as CSV");
  const whole = h("a", { class: "button quiet", href: job.report, download: `${name}.json`, onclick: (event) => pressed(event.currentTarget, () => download(event)) }, "Export");
  return { title, trail, under, actions: h("div", { class: "actions" }, [sheet, whole].filter(Boolean)), body: drawn.body(report, policyLink) };
};

/** Draws an evaluation: of an investor's strategies, or a comparison of policies of a declared problem with rules. */
const compared = (report, link) => (report.format === "ballast-comparison-1" ? comparison : evaluation).body(report, link, drawing);

/** Returns the link to the form that compares a policy on drawn records. */
const drawing = (policy) => h("a", { class: "button quiet", "data-needs": "train", href: `#/evaluations/new?policy=${policy}&records=drawn` }, "Draw records");

/** Returns the module of a walk-forward: of an investor's strategies, or of a declared problem. */
const walkOf = ({ format }) => (format === "ballast-declared-walk-1" ? declaredWalk : backtest);
const walked = { body: (report) => walkOf(report).body(report), csv: (report) => walkOf(report).csv(report) };

export const ofBacktest = reported("backtest", EVALUATIONS, walked);
export const ofEvaluation = reported("evaluate", EVALUATIONS, { body: compared });
export const ofFrontier = reported("frontier", ["Jobs", "#/jobs"], frontier);
