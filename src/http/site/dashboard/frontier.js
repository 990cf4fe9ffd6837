// The frontier of caution: what more or less caution would lose on histories like this one. The request, and its
// report.

import { post } from "./api.js";
import { joined } from "./beside.js";
import { lineChart } from "./chart.js";
import { h, quantSection, section, table } from "./dom.js";
import { pressed } from "./form.js";
import { allocation, minus, percent, significant, tick } from "./format.js";
import { shareOf } from "./specification.js";

export function body(report) {
  const scales = report.resampled[0].points.map(({ scale }) => scale);
  const number = (name, cell) => ({ name, numeric: true, cell });
  const held = table("Held on this record, at each multiple of the caution", [{ name: "Caution", cell: (at) => scaled(scales[at]) }, number("Held on this record", (at) => allocation(sum(report.own[at])))], [...scales.keys()]);
  const most = ({ bootstrap, best }) => `${allocation(sum(best))} ${WORDS[bootstrap.kind].market(bootstrap)}`;
  const best = `The best allocation would be ${joined(report.resampled.map(most))}.`;
  return [
    h("div", { class: "words" }, trade(report), h("p", {}, best)),
    section("What caution costs and saves", chart(report), held),
    quantSection("Sentences of the report, and a table for each kind of record", () => h("div", {}, report.sentences.map((sentence) => h("p", { class: "note" }, minus(sentence))), report.resampled.map((resampled) => figures(report, resampled)))),
  ];
}

/** The kinds of records: the name of a line, the title of a table, and the market within a sentence. */
const WORDS = {
  smoothed: { name: "If returns are like the record\u2019s", title: () => "Records drawn from the returns seen, smoothed", market: () => "if returns are like the record\u2019s" },
  block: {
    name: "If they also follow each other as they did",
    title: ({ length }) => `Records drawn in blocks of ${length} periods in a row`,
    market: ({ length }) => `if ${length} in a row follow each other as they did`,
  },
  without_premium: { name: "If the market pays no more than the bank", title: () => "Records of a market that pays no more than the bank", market: () => "if the market pays no more than the bank" },
};

/** Losses come in basis points and are shown in percent. */
const inPercentTick = (value, step) => `${tick(value / 100, step / 100)}\u202f%`;
const inPercent = (value) => inPercentTick(value, 0.1);
const scaled = (scale) => ({ 0: "No caution", 1: "This caution" })[scale] ?? `${significant(scale)} times this`;
const sum = (shares) => shares.reduce((sum, share) => sum + share, 0);
const per = ({ per_year }) => (per_year ? "a year" : "a period");

/** Fewer standard errors may be chance. */
const TELLING = 2;

/** Says what this caution costs compared with none if the record is right, and what it saves if not. */
function trade(report) {
  const of = (wanted) => {
    const { points } = report.resampled.find(({ bootstrap }) => bootstrap.kind === wanted);
    const [none, full] = [0, 1].map((scale) => points.find((point) => point.scale === scale)?.lost.value);
    return full - none;
  };
  const [cost, saved] = [of("smoothed"), -of("without_premium")];
  if (!Number.isFinite(cost + saved)) return null;
  const words = (amount, verb, opposite) => `${amount < 0 ? opposite : verb} ${percent(Math.abs(amount) / 1e4, 2)} ${per(report)}`;
  const { evidence } = report;
  const shown = `The average return of the record lies ${evidence < 0 ? "below" : "above"} the bank\u2019s by ${tick(Math.abs(evidence), 0.1)} standard errors, which ${Math.abs(evidence) < TELLING ? "may be" : "is hardly"} chance.`;
  return h("p", {}, `Compared with no caution, this caution ${words(cost, "costs", "saves")} if returns are like the record\u2019s, and ${words(saved, "saves", "costs")} if the market pays no more than the bank. ${shown}`);
}

/** Draws what each kind of record loses, all in one chart from no loss on. */
function chart(report) {
  const values = report.resampled[0].points.map(({ scale }) => scale);
  return lineChart({
    title: `Lost on average ${per(report)}`,
    height: 260,
    x: { values, domain: [0, Math.max(...values)], label: "Caution", here: scaled, format: scaled, tick },
    y: { format: inPercent, tick: inPercentTick, also: [0] },
    series: report.resampled.map(({ bootstrap, points }) => ({ name: WORDS[bootstrap.kind].name, kind: "line", values: points.map(({ lost }) => lost.value), band: points.map(({ lost: { low, high } }) => [low, high]) })),
    note: `The least that anybody could lose is nothing: with the best allocation for that market. Bands show how exactly the records drawn determine a line, with ${percent(report.level, 0)} confidence.`,
  });
}

/** Returns the figures of one kind of record. */
function figures(report, { bootstrap, points }) {
  const number = (name, cell) => ({ name, numeric: true, cell });
  const title = WORDS[bootstrap.kind].title(bootstrap);
  return [
    h("h3", {}, title),
    table(
      `${title}: lost ${per(report)}, at each multiple of the caution`,
      [
        { name: "Caution", cell: ({ scale }) => scaled(scale) },
        number("Lost on average", ({ lost }) => inPercent(lost.value)),
        number("Varies between records by", ({ deviation }) => inPercent(deviation.value)),
        number("Above the least loss", ({ beyond_least }) => (beyond_least ? inPercent(beyond_least.value) : "\u2013")),
        number("Beyond its own mix", ({ beyond_own_mix }) => inPercent(beyond_own_mix.value)),
        number("Held on average", ({ total }) => percent(total)),
      ],
      points,
    ),
  ];
}

/** Returns the button that requests a frontier for a policy's problem with the current returns and wealth; `fund` is given for several assets. */
export function asking({ problem: asked, fund }, history, initial_wealth) {
  const { rate_per_step, periods_per_year, action_interval, utility, radius: whole, support } = asked;
  // The scales are multiples of the caution in use.
  const radius = whole.scale === undefined ? whole : { ...whole, scale: whole.scale * shareOf(asked) };
  const investor = { initial_wealth, action_interval, utility, radius, support };
  const problem = { history, rate_per_step, periods_per_year, ...investor, ...(fund && several(fund, radius)) };
  const button = h("button", { class: "quiet" }, "How much caution?");
  const act = async () => {
    const { job } = await post("/frontier", { problem });
    location.hash = `#/frontiers/${job}`;
  };
  button.addEventListener("click", () => pressed(button, act));
  return button;
}

/** Returns the request's fields of several assets, with the scale of the radius before it was widened for all their funds. */
function several({ assets, ground_norm, radius_factor }, radius) {
  const scale = radius.scale && radius.scale / radius_factor;
  return { assets, ground_norm, radius: { ...radius, scale } };
}
