// Rows of a list ticked, and the ways to the pages that show two of them side by side, or take many together.

import { h } from "./dom.js";

/**
 * `{box(id, name), link}` of a list of `kind`, "sessions" or "policies": the tick of a row, and the link that two ticks give. Two
 * may be ticked, or any number where there is something for `many`: `{words(count), at}`, a link to the address `at`.
 */
export function ticking(kind, many = null) {
  let ticked = [];
  const boxes = new Map();
  const note = h("span", { class: "note", role: "status" });
  const go = h("a", { class: "button quiet", hidden: true }, "Compare the two");
  const all = many && h("a", { class: "button quiet", hidden: true });
  const tell = () => {
    for (const [id, box] of boxes) box.checked = ticked.includes(id);
    const query = `${kind}=${ticked.map(encodeURIComponent).join(",")}`;
    go.hidden = ticked.length !== 2;
    go.href = `#/compare?${query}`;
    note.textContent = ["Tick two to compare them.", "Tick one more to compare the two."][ticked.length] ?? "";
    if (!many) return;
    all.hidden = ticked.length === 0;
    all.href = `${many.at}?${query}`;
    all.textContent = many.words(ticked.length);
  };
  const box = (id, name) => {
    const control = h("input", { type: "checkbox", class: "tickbox", "aria-label": `${many ? "Tick" : "Compare"} ${name}` });
    control.checked = ticked.includes(id);
    control.addEventListener("change", () => {
      // Where two are all, a third tick takes the place of the first.
      ticked = control.checked ? [...ticked, id].slice(many ? 0 : -2) : ticked.filter((one) => one !== id);
      tell();
    });
    boxes.set(id, control);
    return control;
  };
  tell();
  return { box, link: h("span", { class: "comparing" }, note, go, all) };
}
