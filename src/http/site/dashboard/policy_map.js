// The policy of a declared problem as a map: what it does in a period, over one or two of its inputs.

import { post } from "./api.js";
import { lineChart } from "./chart.js";
import { plain } from "./declared_policy.js";
import { h, section } from "./dom.js";
import { fieldset, input, refusal, select, sending } from "./form.js";
import { percent, tick } from "./format.js";
import { heatmap } from "./heatmap.js";
import { pointed } from "./number_text.js";

/** Values of one input, and of each of two. */
const [ALONE, EACH] = [21, 13];

/** Returns the section with the form; the map is drawn below it. */
export function policyMap(id, { states, actions, noise, horizon }) {
  const names = Object.keys(states);
  const inputs = [...names, ...(horizon > 1 ? [noise.name] : [])];
  const within = "map-";
  const period = input({ within, name: "period", label: "In period", note: `1 to ${horizon}.`, value: String(Math.min(2, horizon)), inputmode: "numeric" });
  const across = select({ within, name: "across[0].input", label: "Across", choices: inputs.map((name) => [name, name]) });
  const up = select({ within, name: "across[1].input", label: "Upward", choices: [["", "Nothing: a curve"], ...inputs.map((name) => [name, name === noise.name ? `${name}, seen in each period before` : name])] });
  const drawn = Object.keys(actions);
  const what = select({ within, name: "what", label: "What is drawn", choices: [...drawn.map((name) => [name, name]), ["", "What it is worth"]] });
  if (names.length > 1) up.control.value = names[1];
  else if (horizon > 1) up.control.value = noise.name;
  const others = names.map((name, index) => input({ within: `${within}${index}-`, name: `state.${name}`, label: `${name}, if it is not drawn`, value: String(states[name].start) }));
  const place = h("div", { id: "policy-map" });
  const send = h("button", { type: "submit" }, "Draw");
  const more = h("details", {}, h("summary", {}, "Where the other states are"), h("div", { class: "fields" }, others.map(({ element }) => element)));
  const form = h("form", { novalidate: true }, fieldset("What to draw", [period, across, up, what]), more, refusal(), h("p", { class: "send" }, send));
  form.addEventListener("input", () => place.replaceChildren());
  sending(form, send, async () => {
    place.replaceChildren();
    const chosen = [across.control.value, up.control.value].filter(Boolean);
    const ends = (name) => (name === noise.name ? noise : states[name]);
    const ranges = chosen.map((name) => ({ input: name, from: ends(name).low, to: ends(name).high, points: chosen.length === 1 ? ALONE : EACH }));
    const now = pointed(period.control.value);
    const state = Object.fromEntries(names.map((name, index) => [name, pointed(others[index].control.value)]));
    // Unless it is drawn, the noise was in the middle of its support.
    const noises = chosen.includes(noise.name) || !(now > 1) ? [] : Array.from({ length: now - 1 }, () => (noise.low + noise.high) / 2);
    place.replaceChildren(...picture(await post("/decide", { policy: id, period: now, state, noises, across: ranges }), what.control.value));
  });
  return section("The policy as a map", form, place);
}

/** Draws one of the actions, or the worth if `name` is blank. */
function picture({ across: [x, y], points }, name) {
  const of = (point) => (point.actions === null ? null : name === "" ? point.value : point.actions[name]);
  const title = name || "Worth of this period and those after it";
  const known = points.map(of).filter((value) => value !== null);
  const faults = points.length - known.length;
  const words = faults === 0 ? "" : h("p", { class: "note wrong" }, `At ${faults} of ${points.length} points nothing can be decided, because a state may leave its range there.`);
  if (known.length === 0) return [words];
  const axis = ({ input, values }) => ({ name: input, label: input, values, format: plain, tick });
  if (!y) return [words, lineChart({ title, x: { ...axis(x), here: (value) => `${x.input} ${plain(value)}` }, y: { format: plain, tick }, series: [{ name: title, kind: "line", values: points.map(of) }] })];
  const at = (column, row) => points[column * y.values.length + row];
  const cells = (of) => y.values.map((_, row) => x.values.map((_, column) => of(at(column, row))));
  const range = [Math.min(...known), Math.max(...known)];
  const note = `Faded cells are those after which more than ${percent(0.1, 0)} of the outcomes lie beyond the states that were trained, or where nothing can be decided.`;
  return [words, heatmap({ title, name: title, x: axis(x), y: axis(y), field: cells((point) => of(point) ?? range[0]), solved: cells((point) => point.actions !== null && point.untrained_share <= 0.1), range, format: plain, dots: [], own: [Number.NaN, Number.NaN], note })];
}
