// The key that this page sends to the service. It is kept in this tab's session storage: it ends with the tab, and no
// other page sees it.

import { h } from "./dom.js";
import { moment } from "./format.js";

const PLACE = "ballast-key";

export const held = () => sessionStorage.getItem(PLACE);

/** Returns the headers of every request. */
export const shown = () => (held() ? { authorization: `Bearer ${held()}` } : {});

/** Says why the current key was refused, expired or not valid, and what to do. */
export function refusedWords({ value }, isKept) {
  const [, at] = /^a key that expired at (\S+)$/.exec(value ?? "") ?? [];
  const why = at ? `Your key expired at ${moment(Date.parse(at))}.` : "The key is not valid here: it may have been revoked, or pasted in part.";
  return `${why} Paste a new one${isKept ? ": what you typed is kept" : ""}.`;
}

/** Asks for another key in a dialog over the unchanged page; then the user can send the refused request again. */
export function askForKey(words) {
  if (document.querySelector("dialog[open]")) return;
  const dialog = h("dialog", { class: "asking", "aria-labelledby": "key-asked" }, h("h2", { id: "key-asked" }, "Another key is needed"), h("p", { class: "sentence" }, words));
  const close = () => dialog.close();
  dialog.append(keyForm(close), h("p", {}, h("button", { class: "link", onclick: close }, "Go back to the page")));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

/** Returns a form that takes a key or forgets the current one; `done()` is called after either. */
export function keyForm(done) {
  const typed = h("input", { id: "key", type: "password", autocomplete: "off", spellcheck: "false", required: true });
  const keep = (event) => {
    event.preventDefault();
    sessionStorage.setItem(PLACE, typed.value.trim());
    done();
  };
  const forget = () => {
    sessionStorage.removeItem(PLACE);
    done();
  };
  return h(
    "form",
    { class: "key", onsubmit: keep },
    h("div", { class: "field" }, h("label", { for: "key" }, "Key"), typed),
    h(
      "div",
      { class: "actions" },
      h("button", {}, "Use this key"),
      held() ? h("button", { type: "button", class: "quiet", onclick: forget }, "Forget the current key") : null,
    ),
  );
}
