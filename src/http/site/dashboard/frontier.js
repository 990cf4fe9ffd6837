// The frontier of caution: what more or less caution would lose on histories like this one. The request, and its
// report.

import { post } from "./api.js";
import { extent } from "./chart.js";
import { h, section, table } from "./dom.js";
import { pressed } from "./form.js";
import { minus, percent, tick } from "./format.js";
import { intervalChart } from "./interval_chart.js";
import { shareOf } from "./specification.js";

export function body(report) {
  const words = h("div", { class: "words" }, report.sentences.map((sentence) => h("p", {}, minus(sentence))));
  // All laws share one scale, which starts at no loss.
  const domain = extent(report.resampled.flatMap(({ points }) => points.flatMap(({ lost: { low, high } }) => [low, high])), [0]);
  return [words, ...report.resampled.map((resampled) => drawn(report, resampled, domain))];
}

const TITLES = {
  smoothed: () => "Records drawn from the returns seen, smoothed",
  block: ({ length }) => `Records drawn in blocks of ${length} periods in a row`,
  without_premium: () => "Records of a market that pays no more than the bank",
};

/** Losses come in basis points and are shown in percent. */
const inPercent = (value) => tick(value / 100, 0.001);
const scaled = (scale) => ({ 0: "No caution", 1: "This caution" })[scale] ?? `${scale} times this`;

/** Draws one law: what each scale of caution loses, and how much that varies. */
function drawn({ own, per_year }, { bootstrap, best, points: scales }, domain) {
  const title = TITLES[bootstrap.kind](bootstrap);
  const total = (shares) => shares.reduce((sum, share) => sum + share, 0);
  const lost = `Lost ${per_year ? "a year" : "a period"}, %`;
  const rows = scales.map((point, index) => ({ ...point, name: scaled(point.scale), own: total(own[index]) }));
  const number = (name, cell) => ({ name, numeric: true, cell });
  return section(
    title,
    h("p", { class: "note" }, `The best allocation for this market is ${percent(total(best))}.`),
    intervalChart({ title: lost, noun: "Caution", rows: rows.map(({ name, lost }) => ({ name, ...lost })), domain, format: inPercent, tick: (value, step) => tick(value / 100, step / 100) }),
    table(
      `${title}: ${lost.toLowerCase()}, at each multiple of the caution`,
      [
        { name: "Caution", cell: ({ name }) => name },
        number("Lost on average", ({ lost }) => inPercent(lost.value)),
        number("Varies between records by", ({ deviation }) => inPercent(deviation.value)),
        number("Above the least loss", ({ beyond_least }) => (beyond_least ? inPercent(beyond_least.value) : "\u2013")),
        number("Beyond its own mix", ({ beyond_own_mix }) => inPercent(beyond_own_mix.value)),
        number("Held on average", ({ total }) => percent(total)),
        number("Held on this record", ({ own }) => percent(own)),
      ],
      rows,
    ),
  );
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
