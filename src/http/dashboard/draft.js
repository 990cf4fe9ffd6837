// Keeps a half-filled form while the tab is open: a reload, Back or a click in the navigation does not lose it.

import { h } from "./dom.js";

/** `{read(), keep(content), drop(), note(again)}` of the form at `place`. */
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
      // More than the browser keeps, which is millions of letters: the form goes on without.
      drop();
    }
  };
  /** That what stands here was typed before; `again()` shows the form as it is without. */
  const note = (again) =>
    h("p", { class: "note", role: "status" }, "This is what you typed here before. ", h("button", { type: "button", class: "link", onclick: () => (drop(), again()) }, "Start again"));
  return { read, keep, drop, note };
}
