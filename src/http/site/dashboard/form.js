// Fields with their labels, notes and errors; refusals are shown at the field that they name.

import { h } from "./dom.js";
import { problemWords } from "./problem_words.js";

const identifier = (name) => `f-${name.replace(/[^a-z0-9]+/gi, "-")}`;

function field(name, label, note, control, within = "") {
  const id = identifier(within + name);
  const noteId = note ? `${id}-note` : null;
  control.id = id;
  control.name = name;
  if (noteId) control.setAttribute("aria-describedby", noteId);
  const element = h(
    "div",
    { class: "field" },
    h("label", { for: id }, label),
    control,
    note ? h("p", { class: "note", id: noteId }, note) : null,
  );
  return { name, element, control };
}

/** Returns a text field; `changed(text)` is called at every edit. `within` is a prefix of its id, for forms with the same field. `unit` is
 * "percent" if the field is in percent and the request holds a fraction, and "confidence" if the request holds one minus it. */
export function input({ name, label, note, changed, within, value = "", unit = null, ...attributes }) {
  const control = h("input", {
    type: "text",
    inputmode: "decimal",
    autocomplete: "off",
    "data-unit": unit,
    ...attributes,
  });
  control.value = value;
  if (changed) control.addEventListener("input", () => changed(control.value));
  return field(name, label, note, control, within);
}

/** Returns a field of several lines. */
export function area({ name, label, note, changed, within, value = "", rows = 2 }) {
  const control = h("textarea", { rows, class: "prose" });
  control.value = value;
  if (changed) control.addEventListener("input", () => changed(control.value));
  return field(name, label, note, control, within);
}

/** Returns a choice; `choices` maps values to texts, or lists pairs of both to fix their order. */
export function select({ name, label, note, choices, changed, within }) {
  const control = h(
    "select",
    {},
    (Array.isArray(choices) ? choices : Object.entries(choices)).map(([value, words]) => h("option", { value }, words)),
  );
  if (changed) control.addEventListener("change", () => changed(control.value));
  return field(name, label, note, control, within);
}

export function fieldset(legend, parts) {
  return h(
    "fieldset",
    {},
    h("legend", {}, legend),
    h(
      "div",
      { class: "fields" },
      parts.map((part) => part.element ?? part),
    ),
  );
}

/**
 * Shows a refusal at the field it names, or at the nearest one above it (`problem.history[3]` at `problem.history`), and moves there. If the
 * form has no such field, or the problem names none, it is shown in `message`.
 */
export function showProblem(form, message, problem, otherwise) {
  clear(form);
  let name = problem.field ?? "";
  let control = null;
  while (name !== "" && control === null) {
    const found = form.querySelector(`[name="${CSS.escape(name)}"]`);
    control = found && found.closest("[hidden]") === null ? found : null;
    name = name.replace(/(\.[^.[]*|\[\d+\]|^[^.[]*)$/, "");
  }
  if (control === null) {
    message.hidden = false;
    message.textContent = failureWords(problem);
    // Only a refusal that names a field can be corrected in `otherwise`.
    const place = problem.field ? otherwise : null;
    place?.closest("details")?.setAttribute("open", "");
    (place ?? message).focus();
    return;
  }
  for (let fold = control.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
  const part = /^\[(\d+)\]$/.exec((problem.field ?? "").slice(control.name.length));
  const own = problem.rule && (problem.field === control.name || part) && control.labels.length > 0;
  const label = own && `${control.labels[0].textContent}${part ? `, number ${Number(part[1]) + 1},` : ""}`;
  const ahead = [...form.querySelectorAll('[name="horizon"], [name$=".horizon"]')].find((field) => field.closest("[hidden]") === null);
  const words = own ? problemWords(problem, label, control.dataset.unit, ahead?.labels[0].textContent) : problem.message;
  const error = h("p", { class: "error", role: "alert", id: `${control.id}-error` }, words);
  control.setAttribute("aria-invalid", "true");
  control.dataset.described = control.getAttribute("aria-describedby") ?? "";
  control.setAttribute("aria-describedby", `${error.id} ${control.dataset.described}`.trim());
  control.closest(".field").append(error);
  control.focus();
  control.addEventListener("input", () => clear(form), { once: true });
}

const failureWords = (problem) => (problem.rule && problem.field ? problemWords(problem, inWords(problem.field)) : problem.message);

/** Runs `act` for a press of `button`, which is disabled meanwhile. A failure is shown beside it until it is pressed again. */
export async function pressed(button, act, words = failureWords) {
  if (button.nextElementSibling?.matches("span.error")) button.nextElementSibling.remove();
  button.disabled = true;
  try {
    await act();
    button.disabled = false;
  } catch (error) {
    button.disabled = false;
    button.after(h("span", { class: "error", role: "alert" }, words(error)));
    // A disabled button loses the focus.
    if (document.activeElement === document.body) button.focus();
  }
}

/** Returns the element for errors that belong to no field. */
export const refusal = () => h("p", { class: "error", role: "alert", tabindex: -1, hidden: true });

/** Runs `act` at every submission of `form`, with `button` disabled meanwhile. A failure is passed to `told(error)`, then shown at the field it
 * names, or in the form's message, or at `otherwise`. */
export function sending(form, button, act, { otherwise, told } = {}) {
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    button.disabled = true;
    try {
      await act();
    } catch (error) {
      told?.(error);
      showProblem(form, form.querySelector(":scope > .error"), error, otherwise);
    }
    button.disabled = false;
  });
}

/** Turns the last part of a field's path into a label: `design.sampling_law.degrees_of_freedom` is "Degrees of freedom". */
function inWords(path) {
  const last = path.replace(/\[\d+\]/g, "").split(".").at(-1).replaceAll("_", " ");
  return last[0].toUpperCase() + last.slice(1);
}

/** Removes all errors of a form. */
export function clear(form) {
  const message = form.querySelector(":scope > .error");
  if (message) message.hidden = true;
  for (const control of form.querySelectorAll("[aria-invalid]")) {
    control.removeAttribute("aria-invalid");
    control.setAttribute("aria-describedby", control.dataset.described);
    document.getElementById(`${control.id}-error`)?.remove();
  }
}
