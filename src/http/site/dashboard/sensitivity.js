// How close the advice is to changing. This takes about a hundred robust steps, so it is loaded after the rest.

import { get } from "./api.js";
import { h, section } from "./dom.js";
import { minus } from "./format.js";

/** The frameworks that learn from returns; with the others no return changes the advice. */
const LEARN = ["adaptive", "plug_in", "parametric_adaptive"];

const HEADING = "How close the advice is to changing";

const FIXED = "No return changes the advice, because the policy does not learn from new returns.";

/** Returns `{element, ask()}`: the section, and the function that fills it from `/action`. */
export function nearness({ id, policy, leaving }) {
  const said = (words) => ({ element: section(HEADING, h("p", { class: "sentence" }, words)), ask: async () => {} });
  if (!LEARN.includes(policy.specification.problem.framework)) return said(FIXED);
  const holder = h("div", { "aria-live": "polite" }, h("p", { class: "note" }, "Computing the advice for about a hundred other records\u2026"));
  const ask = async () => {
    try {
      const { sensitivity } = await get(`/action?session=${id}&sensitivity=true`, leaving);
      const [first, ...rest] = sensitivity.sentences.map(minus);
      holder.replaceChildren(h("p", { class: "sentence lead" }, first), ...rest.map((words) => h("p", { class: "sentence" }, words)));
    } catch (error) {
      if (!leaving.aborted) holder.replaceChildren(h("p", { class: "error" }, error.message));
    }
  };
  return { element: section(HEADING, holder), ask };
}
