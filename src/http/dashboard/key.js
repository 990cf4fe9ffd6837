// The key this page shows to the service. It lives in this tab's session storage: gone with the tab, seen by no other page.

import { h } from "./dom.js";

const PLACE = "ballast-key";

export const held = () => sessionStorage.getItem(PLACE);

/** What goes with every request. */
export const shown = () => (held() ? { authorization: `Bearer ${held()}` } : {});

/** A form that takes a key, or gives up the one held; `done()` hears of either. */
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
      held() ? h("button", { type: "button", class: "quiet", onclick: forget }, "Forget the key held") : null,
    ),
  );
}
