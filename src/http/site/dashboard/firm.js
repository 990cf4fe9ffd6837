// The firm that writes letters: its name, logo, closing line and disclaimer, and the currency of amounts. Only this browser keeps them; the
// service gets them with each letter.

import { h } from "./dom.js";
import { area, input } from "./form.js";
import { currency, keepCurrency, LETTERS } from "./money.js";

/** Where the browser keeps the firm. */
const PLACE = "ballast-firm";
/** The largest logo, in bytes. */
const LARGEST_LOGO = 200 * 1024;
/** Kinds of pictures that every browser can draw. */
const KINDS = "image/png,image/jpeg,image/webp";
/** Most letters of each text, so that a letter stays on one page. */
const LONGEST = { name: 80, closing: 200, disclaimer: 600 };

/** Returns what this browser keeps of the firm: `{name, closing, disclaimer, logo}`, the logo as a data URL. */
export function firm() {
  try {
    const kept = JSON.parse(localStorage.getItem(PLACE));
    return kept !== null && typeof kept === "object" ? kept : {};
  } catch {
    return {};
  }
}

/** Keeps the firm; returns false if the browser has no room for it. */
function keep(content) {
  try {
    localStorage.setItem(PLACE, JSON.stringify(content));
    return true;
  } catch {
    return false;
  }
}

/** Tells whether a data URL holds a picture that this browser can draw. */
async function isPicture(url) {
  const [, type, base64] = /^data:(image\/[a-z]+);base64,(.*)$/.exec(url) ?? [];
  if (!KINDS.split(",").includes(type)) return false;
  try {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    await createImageBitmap(new Blob([bytes], { type }));
    return true;
  } catch {
    return false;
  }
}

const read = (file) =>
  new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.addEventListener("load", () => resolve(reader.result));
    reader.addEventListener("error", () => reject(reader.error));
    reader.readAsDataURL(file);
  });

/** Returns the form of the firm in a fold, which is open until the firm has a name; `changed()` is called after every change. */
export function firmForm(changed) {
  const message = h("p", { class: "error", role: "alert" });
  const set = (part) => {
    const content = { ...firm(), ...part };
    message.textContent = keep(content) ? "" : "The browser has no room left to keep this.";
    changed();
  };
  const known = firm();
  const field = (make, name, label, note) => make({ within: "firm-", inputmode: "text", name, label, note, value: known[name] ?? "", maxlength: LONGEST[name], changed: (text) => set({ [name]: text.trim().slice(0, LONGEST[name]) }) });
  const fields = [
    field(input, "name", "Name of the firm"),
    currencyField(changed, "firm-"),
    field(input, "closing", "Closing line", "The last line of each letter. May be blank."),
    field(area, "disclaimer", "Disclaimer", "In small print below it. May be blank."),
  ];
  return h(
    "details",
    { class: "firm-form", open: !known.name },
    h("summary", {}, "Firm"),
    h(
      "form",
      { novalidate: true, onsubmit: (event) => event.preventDefault() },
      h("div", { class: "fields" }, fields.map(({ element }) => element), logoField(message, set)),
      message,
      h("p", { class: "note" }, "Only this browser keeps it. The service gets it with each letter and does not keep it."),
    ),
  );
}

/** Returns the field for the currency of amounts, which this browser keeps; `changed()` is called when they are written in another way. */
export function currencyField(changed, within = "") {
  const take = (text) => {
    const before = currency();
    field.control.toggleAttribute("aria-invalid", false);
    if (!keepCurrency(text)) field.control.setAttribute("aria-invalid", "true");
    if (currency() !== before) changed();
  };
  const field = input({ within, name: "currency", label: "Currency", placeholder: "Such as EUR", inputmode: "text", maxlength: LETTERS, value: currency() ?? "", changed: take });
  field.element.title = "A code of three letters (ISO 4217). Amounts have no currency if it is blank. This browser keeps it.";
  return field;
}

function logoField(message, set) {
  const file = h("input", { type: "file", id: "firm-logo", accept: KINDS, class: "unseen" });
  const away = h("button", { type: "button", class: "link", hidden: !firm().logo, onclick: () => (set({ logo: undefined }), (away.hidden = true), file.focus()) }, "Remove the logo");
  const take = async (chosen) => {
    if (chosen.size > LARGEST_LOGO) return "The logo has more than 200 KB. Choose a smaller picture.";
    const url = await read(chosen);
    if (!(await isPicture(url))) return "This file is not a PNG, JPEG or WebP picture.";
    set({ logo: url });
    away.hidden = false;
    return message.textContent;
  };
  file.addEventListener("change", async () => {
    if (file.files[0]) message.textContent = await take(file.files[0]);
    // Allows the same file to be chosen again after a change.
    file.value = "";
  });
  return h("div", { class: "field" }, h("span", {}, file, h("label", { class: "button quiet", for: file.id }, "Choose a logo")), h("p", { class: "note" }, "PNG, JPEG or WebP, up to 200 KB. May be left out. ", away));
}
