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

/** The training that goes on with an advice, and the form that opens a session. */
export const FOLLOWING = "#/train?follow=advice";
export const OPENING = "#/sessions/new";
/** The advice for the coming period. */
export const ADVISING = "#/advise";
/** The plan for years. */
export const PLANNING = "#/plan";
/** The share of a strategy. */
export const SIZING = "#/sleeve";

const TEXTS = "input[name]:not([type=file], [type=checkbox], [type=radio]), textarea[name]";
const fieldsOf = (form) => [...form.querySelectorAll(TEXTS)].filter((field) => field.closest("[hidden]") === null);

/** Keeps the texts of a form's fields at `place` while the tab is open. Returns `{restore(), keep(), settle(), drop(), isKept,
 * note(again)}`: `restore` fills the fields that are there, and is called again once the form has more; `keep` is called after the form
 * changed its own fields, `settle` after all of them were sent, and `drop` if the form is over. */
export function keptFields(form, place) {
  const drafts = draft(place);
  const known = drafts.read() ?? {};
  const initial = new Map();
  const note = () => fieldsOf(form).forEach(({ name, value }) => initial.has(name) || initial.set(name, value));
  let isOver = false;
  const keep = () => {
    if (isOver) return;
    note();
    for (const { name, value } of fieldsOf(form)) {
      if (value === initial.get(name)) delete known[name];
      else known[name] = value;
    }
    if (Object.keys(known).length > 0) drafts.keep(known);
    else drafts.drop();
  };
  form.addEventListener("input", keep);
  const restore = () => {
    note();
    for (const field of fieldsOf(form).filter(({ name, value }) => name in known && value !== known[name])) {
      field.value = known[field.name];
      field.dispatchEvent(new Event("input"));
      field.closest("details")?.setAttribute("open", "");
    }
  };
  const settle = () => {
    for (const { name, value } of fieldsOf(form)) initial.set(name, value);
    for (const name of Object.keys(known)) delete known[name];
    drafts.drop();
  };
  const drop = () => {
    isOver = true;
    drafts.drop();
  };
  return { restore, keep, settle, drop, isKept: Object.keys(known).length > 0, note: drafts.note };
}
