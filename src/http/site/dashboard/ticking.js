// Selected rows of a list, and their actions: compare up to four, take many to one page, or delete them.

import { MOST, numbered } from "./beside.js";
import { h } from "./dom.js";
import { pressed } from "./form.js";
import { count } from "./format.js";

/** Most names listed in the question before a deletion. */
const NAMED = 20;

/**
 * Returns `{box(id, name), link, drawn()}` for a list of `kind`, "sessions" or "policies": the checkbox of a row, the actions for the ticked
 * rows, and what to call with the rows that are shown. Up to four rows may be ticked, or any number if `many` is given: `{links: [{words(count), at}], asked(count), remove(id), removed()}`, with links to
 * the addresses `at`, the question before a deletion, the deletion of one row, and what to do afterwards.
 */
export function ticking(kind, many = null) {
  let ticked = [];
  const [boxes, names] = [new Map(), new Map()];
  const note = h("span", { class: "note", role: "status", tabindex: -1 });
  const go = h("a", { class: "button quiet", hidden: true });
  const links = (many?.links ?? []).map((link) => ({ ...link, element: h("a", { class: "button quiet", hidden: true }) }));
  let shown = [];
  const every = many && h("button", { type: "button", class: "link", onclick: () => ((ticked = ticked.length > 0 ? [] : [...shown]), tell(), every.focus()) });
  const deletion = many && h("button", { class: "quiet danger", hidden: true, "data-needs": "operate" });
  const tell = () => {
    for (const [id, box] of boxes) box.checked = ticked.includes(id);
    const query = `${kind}=${ticked.map(encodeURIComponent).join(",")}`;
    go.hidden = ticked.length < 2 || ticked.length > MOST;
    go.textContent = go.hidden ? "" : `Compare the ${numbered(ticked.length)}`;
    go.href = `#/compare?${query}`;
    const unseen = ticked.filter((id) => !shown.includes(id)).length;
    const which = many && ticked.length > 0 ? `${count(ticked.length)} ticked${unseen > 0 ? `, ${count(unseen)} of them not shown here` : ""}. ` : "";
    note.textContent = `${which}${[`Tick two to ${numbered(MOST)} to compare them.`, "Tick one more to compare."][ticked.length] ?? ""}`;
    if (!many) return;
    link.toggleAttribute("data-ticked", ticked.length > 0);
    every.textContent = ticked.length > 0 ? "Untick all" : `Tick all ${count(shown.length)}`;
    every.hidden = ticked.length === 0 && shown.length < 2;
    deletion.hidden = ticked.length === 0;
    for (const { element, at, words } of links) {
      element.hidden = ticked.length === 0;
      element.href = `${at}?${query}`;
      element.textContent = words(ticked.length);
    }
    deletion.textContent = `Delete the ${count(ticked.length)}`;
  };
  const box = (id, name) => {
    const control = h("input", { type: "checkbox", class: "tickbox", "aria-label": `${many ? "Tick" : "Compare"} ${name}` });
    control.checked = ticked.includes(id);
    control.addEventListener("change", () => {
      // If no more than those that are compared may be ticked, one more replaces the first.
      ticked = control.checked ? [...ticked, id].slice(many ? 0 : -MOST) : ticked.filter((one) => one !== id);
      tell();
    });
    boxes.set(id, control);
    names.set(id, name);
    return control;
  };
  const removeAll = async () => {
    const asked = [...ticked];
    /** The rows that could not be deleted, by the reason. */
    const kept = new Map();
    for (const id of asked) {
      const error = await many.remove(id).then(() => null, (error) => error);
      if (error && error.status !== 404) kept.set(error.message, [...(kept.get(error.message) ?? []), id]);
    }
    ticked = [...kept.values()].flat();
    tell();
    await many.removed();
    if (kept.size > 0) throw new Error([...kept].map(([reason, ids]) => `Not deleted: ${ids.map((id) => names.get(id)).join(", ")}. ${reason}`).join(" "));
    note.textContent = `${count(asked.length)} deleted.`;
    note.focus();
  };
  deletion?.addEventListener("click", () => {
    const rest = ticked.length - NAMED;
    const listed = ticked.slice(0, NAMED).map((id) => names.get(id)).join(", ");
    if (confirm(`${many.asked(ticked.length)}\n\n${listed}${rest > 0 ? ` and ${count(rest)} more` : ""}`)) pressed(deletion, removeAll);
  });
  const link = h("div", { class: "comparing" }, note, every, go, links.map(({ element }) => element), deletion);
  tell();
  return { box, link, drawn: (ids) => ((shown = ids), tell()) };
}
