// Long lists: newest first, more on request, and always a line that says if this is all.

import { get } from "./api.js";
import { announce, h } from "./dom.js";
import { count, counted } from "./format.js";

/** Entries of a page. */
const PAGE = 100;
/** The service's largest page, for lists to choose from. */
const LARGEST = 1000;

/** A list at `path`, which may have a query, page by page: `next()` gives the entries of the next page, `more` tells whether there may be one. */
export class Pages {
  constructor(path, name, signal, { limit = PAGE, keep = () => true } = {}) {
    Object.assign(this, { path, name, signal, limit, keep, after: null, more: true });
  }

  /** Returns at least one entry, unless none is left; with `keep`, reads as many pages as that takes. */
  async next() {
    const found = [];
    while (this.more && found.length === 0) {
      const after = this.after === null ? "" : `&after=${encodeURIComponent(this.after)}`;
      const page = await get(`${this.path}${this.path.includes("?") ? "&" : "?"}limit=${this.limit}${after}`, this.signal);
      found.push(...page[this.name].filter(this.keep));
      this.after = page.next;
      this.more = page.next !== null;
    }
    return found;
  }
}

/** Returns every entry of a list. */
export async function all(path, name, signal) {
  const pages = new Pages(path, name, signal, { limit: LARGEST });
  const found = [];
  while (pages.more) found.push(...(await pages.next()));
  return found;
}

/** Returns a holder with the first `most` rows, drawn by `draw`, and the button `all` that shows all rows, or null if there are no more. `now()`
 * returns the rows when it is pressed. */
export function firstOf(rows, most, draw, now = () => rows) {
  const holder = h("div", {}, draw(rows.slice(0, most)));
  if (rows.length <= most) return { holder, all: null };
  const all = h("button", { type: "button", class: "quiet", onclick: () => (holder.replaceChildren(draw(now())), all.remove()) }, `Show all ${count(rows.length)}`);
  return { holder, all };
}

/** Returns the line below a list of `shown` entries, named by `nouns` (singular and plural): whether there are more, and a button that `add`s them. */
export function foot(pages, nouns, shown, add) {
  const line = h("p", { class: "note" });
  const button = h("button", { class: "quiet" }, "Show more");
  const element = h("div", { class: "foot" }, line, button);
  const tell = () => {
    const these = counted(shown, ...nouns);
    line.textContent = pages.more ? `The newest ${these}. There are older ones.` : `${these}, and no more.`;
    button.hidden = !pages.more;
  };
  button.addEventListener("click", async () => {
    button.disabled = true;
    try {
      const entries = await pages.next();
      shown += entries.length;
      await add(entries);
      tell();
      announce(`${count(entries.length)} more. ${line.textContent}`);
    } catch (error) {
      line.textContent = error.message;
    }
    button.disabled = false;
  });
  tell();
  return element;
}
