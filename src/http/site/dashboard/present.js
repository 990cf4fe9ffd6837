// Present mode: a session's page as its client may see it, larger and without anything to press. Only the address keeps it.

import { announce, h } from "./dom.js";

const MARK = "?present";

const isPresented = () => location.hash.endsWith(MARK);
const isShown = () => "present" in document.documentElement.dataset;

/** Returns the address of the page without the mark of present mode. */
export const pageOf = (hash) => (hash.endsWith(MARK) ? hash.slice(0, -MARK.length) : hash);

/** Shows the page as the address says. */
export function present() {
  if (isPresented()) document.documentElement.dataset.present = "";
  else delete document.documentElement.dataset.present;
  for (const control of document.querySelectorAll("[role=switch].presenting")) tell(control);
}

/** Enters or leaves present mode if the address of the page `shown` changed in that alone; returns whether it did. The page is not read again,
 * so that nothing typed is lost. */
export function presentOnly(shown) {
  if (pageOf(location.hash) !== shown || isPresented() === isShown()) return false;
  present();
  announce(isPresented() ? "Presenting. Press Escape to leave." : "No longer presenting.");
  return true;
}

function tell(control) {
  control.setAttribute("aria-checked", isPresented());
  control.textContent = isPresented() ? "Leave" : "Present";
}

/** Returns the switch on a session's page. */
export function presentSwitch() {
  const turn = () => (location.hash = isPresented() ? pageOf(location.hash) : `${location.hash}${MARK}`);
  const control = h("button", { type: "button", role: "switch", class: "link presenting", "aria-label": "Present", title: "Show the page to the client. Escape leaves.", onclick: turn });
  tell(control);
  return control;
}

/** Escape leaves present mode, unless it closes a dialog. */
export function leaveByEscape(event) {
  if (event.key === "Escape" && isPresented() && !document.querySelector("dialog[open]")) location.hash = pageOf(location.hash);
}
