// Two rows of a list ticked, and the way to the page that shows the two side by side.

import { h } from "./dom.js";

/** `{box(id, name), link}` of a list of `kind`, "sessions" or "policies": the tick of a row, and the link that two ticks give. */
export function ticking(kind) {
  let ticked = [];
  const boxes = new Map();
  const note = h("span", { class: "note", role: "status" });
  const go = h("a", { class: "button quiet", hidden: true }, "Compare the two");
  const tell = () => {
    for (const [id, box] of boxes) box.checked = ticked.includes(id);
    go.hidden = ticked.length < 2;
    go.href = `#/compare?${kind}=${ticked.map(encodeURIComponent).join(",")}`;
    note.textContent = ["Tick two to compare them.", "Tick one more to compare the two.", ""][ticked.length];
  };
  const box = (id, name) => {
    const control = h("input", { type: "checkbox", class: "tickbox", "aria-label": `Compare ${name}` });
    control.checked = ticked.includes(id);
    control.addEventListener("change", () => {
      // A third tick takes the place of the first.
      ticked = control.checked ? [...ticked, id].slice(-2) : ticked.filter((one) => one !== id);
      tell();
    });
    boxes.set(id, control);
    return control;
  };
  tell();
  return { box, link: h("span", { class: "comparing" }, note, go) };
}
