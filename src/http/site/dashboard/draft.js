// Keeps a half-filled form while the tab is open: a reload, Back or a click in the navigation does not lose it.

import { h } from "./dom.js";

/** Returns `{read(), keep(content), drop(), note(again)}` for the form at `place`. */
export function draft(place) {
  const key = `ballast-draft ${place}`;
  const drop = () => sessionStorage.removeItem(key);
  const read = () => {
    try {
      return JSON.parse(sessionStorage.getItem(key));
    } catch {
      return null;
    }
  };
  const keep = (content) => {
    try {
      sessionStorage.setItem(key, JSON.stringify(content));
    } catch {
      // The browser stores at most some millions of letters: the form works without the draft.
      drop();
    }
  };
  /** Says that the content was typed before; `again()` shows the form without it. */
  const note = (again) =>
    h("p", { class: "note", role: "status" }, "This is what you typed here before. ", h("button", { type: "button", class: "link", onclick: () => (drop(), again()) }, "Start again"));
  return { read, keep, drop, note };
}
