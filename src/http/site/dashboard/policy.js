// One policy: what it was trained for, what it does, and for the quant how well it was solved.

import { download, get, remove } from "./api.js";
import { lineChart } from "./chart.js";
import { declaredBody } from "./declared_policy.js";
import { disclosure, h, section, table } from "./dom.js";
import { pressed } from "./form.js";
import { basisPoints, count, figures, moment, percent, percentTick, short, wealth } from "./format.js";
import { futuresOf } from "./futures.js";
import { labelled, titled } from "./naming.js";
import { unitOf } from "./periods.js";
import { policyMap } from "./policy_map.js";
import { FRAMEWORKS, inPaperWords, inWords, isDeclared, warningList } from "./specification.js";
import { surfaceView } from "./surface_view.js";

export async function view(id, leaving) {
  const policy = await get(`/policies/${id}`, leaving);
  const { specification, diagnostics, annualised, warnings } = policy;
  if (isDeclared(specification)) return framed(id, policy, [], declaredBody(id, policy, policyMap(id, specification.problem), leaving));
  const { element, told } = answer(specification, diagnostics);
  const body = [
    h(
      "div",
      { class: "words" },
      element,
      ofSeveral(specification),
      inWords(specification, annualised).map((sentence) => h("p", {}, sentence)),
      warningList(warnings, specification.problem),
    ),
    again(id),
    section("What it holds", surfaceView({ id, problem: specification.problem, leaving, told })),
    policy.specification.problem.spending ? "" : futuresOf(`/policies/${id}`, leaving, { format: wealth }),
    solved(specification, diagnostics),
  ];
  const evaluate = h("a", { class: "button quiet", href: `#/evaluations/new?policy=${id}` }, "Evaluate");
  return framed(id, policy, [h("a", { class: "button", href: `#/sessions/new?policy=${id}` }, "Open a session"), evaluate], body);
}

/** Returns the page of a policy, with what every policy has beside its own `actions` and `body`. */
function framed(id, policy, own, body) {
  const actions = h(
    "div",
    { class: "actions" },
    own,
    h(
      "a",
      {
        class: "button quiet",
        href: `/policies/${id}/export`,
        download: `policy-${short(id)}.json`,
        onclick: (event) => pressed(event.currentTarget, () => download(event)),
      },
      "Export",
    ),
    deletion(id),
  );
  const trail = h(
    "p",
    { class: "trail" },
    h("a", { href: "#/policies" }, "Policies"),
    ` \u203a ${FRAMEWORKS[policy.framework]}, stored ${moment(policy.created_ms)}`,
  );
  return { title: titled("Policy", id, policy.name), trail, under: labelled("Policy", `/policies/${id}`, id, policy), actions, body };
}

function deletion(id) {
  const button = h("button", { class: "quiet danger", "data-needs": "train" }, "Delete");
  const act = async () => {
    await remove(`/policies/${id}`);
    location.hash = "#/policies";
  };
  const used = () => ["Sessions use this policy. Delete those first. ", h("a", { href: `#/?search=${id}` }, "Show them")];
  const words = (error) => (error.type === "/problems/in-use" ? used() : error.message);
  button.addEventListener("click", () => confirm("Delete this policy for good?") && pressed(button, act, words));
  return button;
}

/** Names the assets of a policy for several. */
function ofSeveral({ fund }) {
  if (!fund) return null;
  return h("p", {}, `It is for ${fund.assets.slice(0, -1).join(", ")} and ${fund.assets.at(-1)}. Below, \u201cstocks\u201d means all of them together.`);
}

/** Returns `{element, told(now)}`: what the policy holds now, exactly once its surface is read, and how often it holds nothing. */
function answer({ problem: { horizon, periods_per_year }, fund }, diagnostics) {
  const unit = unitOf(periods_per_year);
  const assets = fund ? "the assets" : "stocks";
  const isKnown = diagnostics[0].design_count === 1;
  const nothing = "Now it holds nothing: everything is in the bank.";
  const now = h("span", {}, !isKnown ? "" : diagnostics[0].all_bank_share === 0 ? `Now it holds ${assets}.` : nothing);
  const told = ({ band: [low, high], isExact }) => {
    const kept = low < high ? ` if everything is in the bank now, and keeps up to ${percent(high)}` : "";
    now.replaceChildren(...(high === 0 ? [nothing] : [`Now it holds${isExact ? "" : " about"} `, h("b", {}, percent(low)), ` in ${assets}${kept}.`]));
  };
  const share = (step) => percent(diagnostics[step].all_bank_share, 0);
  const steps = [!isKnown && [0, "first"], horizon > 1 && [horizon - 1, "last"]].filter(Boolean);
  const parts = steps.map(([step, which], index) => `in ${share(step)} of ${index === 0 ? "the situations it was trained for" : "those"} in the ${which} ${unit}`);
  return { element: h("p", {}, now, parts.length > 0 ? ` It holds nothing ${parts.join(", and ")}.` : ""), told };
}

/** Returns the links to train a similar policy. */
function again(id) {
  return h(
    "p",
    { class: "again", "data-needs": "train" },
    h("a", { href: `#/train?from=${id}` }, "Clone with one thing changed"),
    " \u00b7 ",
    h("a", { href: `#/train?newer=${id}` }, "Retrain on newer returns"),
  );
}

/** Shows one line for a manager, and the rest for the quant. */
function solved(specification, diagnostics) {
  const widest = Math.max(...diagnostics.map(({ duality_gap }) => duality_gap));
  const error = ({ expected_error, value }) => (expected_error ? 1e-4 * expected_error.total : (value?.leave_one_out_error ?? 0));
  const rough = Math.max(0, ...diagnostics.map(error));
  const within = (value) => (value < 5e-7 ? "less than 0.0001\u202f%" : percent(value, 4));
  const words = `Every step was solved with an error of ${within(widest)} of its worth. Between the situations solved, the policy is interpolated with an error of ${within(rough)}.`;
  return section(
    "How well it was solved",
    h("p", { class: "sentence" }, words),
    disclosure("For the quant", () =>
      h(
        "div",
        {},
        inPaperWords(specification).map((sentence) => h("p", { class: "sentence" }, sentence)),
        steps(diagnostics),
        disclosure("The whole specification", () => h("pre", { tabindex: 0 }, JSON.stringify(specification, null, 1))),
      ),
    ),
  );
}

function steps(diagnostics) {
  const periods = diagnostics.map(({ step }) => step + 1);
  const chart = (title, read, format, tick) =>
    lineChart({
      title,
      height: 130,
      x: { values: periods, label: "Period", format: String, whole: true },
      y: { format, tick, also: [0] },
      series: [{ name: "", kind: "line", values: diagnostics.map(read) }],
    });
  const names = [...new Set(diagnostics.flatMap(({ policy }) => policy?.features ?? []))];
  const length = (side, name) => (step) => {
    const index = step[side]?.features.indexOf(name) ?? -1;
    return index < 0 ? "\u2013" : figures(step[side].lengthscales[index], 2);
  };
  const period = { name: "Period", cell: ({ step }) => count(step + 1) };
  const figure = (name, cell) => ({ name, cell, numeric: true });
  const quality = [
    period,
    figure("Design points", ({ design_count }) => count(design_count)),
    figure("All in the bank", ({ all_bank_share }) => percent(all_bank_share)),
    figure("Uncertified", ({ uncertified_share }) => percent(uncertified_share)),
    figure("Expected error", ({ expected_error }) => basisPoints(expected_error && 1e-4 * expected_error.total)),
    figure("Duality gap", ({ duality_gap }) => basisPoints(duality_gap)),
    figure("Value, left out", ({ value }) => basisPoints(value?.leave_one_out_error)),
    figure("Policy, left out", ({ policy }) => percent(policy?.leave_one_out_error, 2)),
    figure("Value noise", ({ value }) => figures(value?.noise_variance, 2)),
    figure("Policy noise", ({ policy }) => figures(policy?.noise_variance, 2)),
  ];
  const lengthscales = (side) =>
    disclosure(
      `Lengthscales of the ${side} surrogate`,
      () =>
        [
          table(
            `Lengthscales of the ${side} surrogate, in standard deviations of each feature over the design`,
            [period, ...names.map((name) => figure(name.replace(/_/g, " "), length(side, name)))],
            diagnostics,
          ),
        ][0],
    );
  return [
    h(
      "div",
      { class: "trio" },
      chart("Design states all in the bank", ({ all_bank_share }) => all_bank_share, percent, percentTick),
      chart("Value surrogate, error left out", ({ value }) => value?.leave_one_out_error, basisPoints, basisPoints),
      chart("Largest duality gap", ({ duality_gap }) => duality_gap, basisPoints, basisPoints),
    ),
    h(
      "p",
      { class: "note" },
      "Errors are root mean squares of leave-one-out predictions. Those of the value and the gap are in basis points (1/100 %) of the certainty equivalent. That of the policy is in points of allocation. Noise is a share of the target\u2019s variance.",
    ),
    table("Diagnostics of every step", quality, diagnostics),
    lengthscales("value"),
    lengthscales("policy"),
  ];
}
