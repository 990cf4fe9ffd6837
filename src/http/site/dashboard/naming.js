// The labels of things: the name that somebody gave, and otherwise the distinctive part of the identifier.

import { get, patch } from "./api.js";
import { announce, h } from "./dom.js";
import { area, input, refusal, sending } from "./form.js";
import { short } from "./format.js";

/** Returns the name of a thing within a sentence. */
export const called = (id, name) => name || short(id);

/** Returns the name of a thing, or its kind and identifier if it has no name. */
export const titled = (noun, id, name) => name || `${noun} ${short(id)}`;

/** Returns the head of a row: the name with the identifier below, or the identifier alone. */
export function headed(href, id, name) {
  const code = h("code", {}, short(id));
  return name ? [h("a", { href }, name), " ", h("span", { class: "under" }, code)] : h("a", { href }, code);
}

/** Returns a link to a policy by its identifier; if `asked`, its name is requested and replaces the identifier. */
export function policyLink(id, asked = true) {
  const link = h("a", { href: `#/policies/${id}` }, `policy ${short(id)}`);
  const name = ({ name }) => name && link.replaceChildren(name);
  if (asked) get(`/policies/${id}`).then(name, () => {});
  return link;
}

export const tagList = (tags) => (tags.length > 0 ? h("span", { class: "tags" }, tags.map((tag) => h("span", { class: "tag" }, tag))) : null);

/** Returns the tags in a text, separated by commas; a quoted text is one tag, with its quotes doubled. */
const tagsOf = (text) =>
  [...text.matchAll(/\s*(?:"((?:[^"]|"")*)"\s*|([^,]*))(?:,|$)/g)]
    .map(([, whole, plain]) => (whole === undefined ? plain : whole.replaceAll('""', '"')).trim())
    .filter(Boolean);

/** Returns a tag as it is typed, in quotes if needed. */
const quoted = (tag) => (/^"|,/.test(tag) ? `"${tag.replaceAll('"', '""')}"` : tag);

const CLEARED = { name: "", notes: "", tags: [] };

/** Returns `{parts, read(), show(labels)}`: the fields for name, tags and notes. `read()` gives those that are not blank, or all of them with
 * `{all: true}`. `changed()` is called at every edit. */
export function labelFields({ within, changed } = {}) {
  const text = { within, inputmode: "text", changed };
  const name = input({ ...text, name: "name", label: "Name", note: "May be blank." });
  const tags = input({ ...text, name: "tags", label: "Tags", note: "For searching. Separate tags by commas; quote a tag that contains a comma. May be blank." });
  const notes = area({ within, changed, name: "notes", label: "Notes", note: "May be blank." });
  const read = ({ all = false } = {}) => {
    const said = {
      name: name.control.value.trim(),
      notes: notes.control.value.trim(),
      tags: tagsOf(tags.control.value),
    };
    return Object.fromEntries(Object.entries(said).filter(([, value]) => all || value.length > 0));
  };
  const show = (labels) => {
    const given = { ...CLEARED, ...labels };
    for (const [field, value] of [[name, given.name], [notes, given.notes], [tags, [given.tags].flat().map(quoted).join(", ")]])
      if (field.control !== document.activeElement) field.control.value = value ?? "";
  };
  return { name, tags, notes, parts: [name, tags, notes], read, show };
}

/** The role needed to change the labels of a thing. */
const CHANGES = { Session: "operate", Policy: "train" };

/** Returns the labels of the thing at `path`, shown below its heading and edited in place. */
export function labelled(noun, path, id, labels) {
  const element = h("div", { class: "labels" });
  const rest = () => {
    const edit = h("button", { class: "link", "data-needs": CHANGES[noun], onclick: change }, labels.name ? "Edit" : "Give it a name");
    const line = h("p", { class: "note" }, labels.name ? [`${noun} `, h("code", {}, short(id)), " "] : null, tagList(labels.tags), " ", edit);
    element.replaceChildren(line, labels.notes ? h("p", { class: "note prose" }, labels.notes) : "");
    return edit;
  };
  const change = () => {
    const fields = labelFields({ within: "label-" });
    fields.show(labels);
    const before = fields.read({ all: true });
    const save = h("button", { type: "submit" }, "Save");
    const leave = h("button", { type: "button", class: "quiet", onclick: () => rest().focus() }, "Cancel");
    const form = h("form", { novalidate: true, "aria-label": `Labels of this ${noun.toLowerCase()}` }, h("div", { class: "fields" }, fields.parts.map((part) => part.element)), refusal(), h("p", { class: "send" }, save, leave));
    sending(form, save, async () => {
      const edited = Object.entries(fields.read({ all: true })).filter(([name, value]) => JSON.stringify(value) !== JSON.stringify(before[name]));
      if (edited.length > 0) labels = await patch(path, Object.fromEntries(edited));
      const title = titled(noun, id, labels.name);
      document.querySelector("h1").textContent = title;
      document.title = `${title} \u00b7 Ballast`;
      rest().focus();
      announce(`It is now called ${title}.`);
    });
    element.replaceChildren(form);
    fields.name.control.focus();
  };
  rest();
  return element;
}
