// Creates elements without markup strings: text is always text, so nothing from a server or a file can become an
// element.

const SVG = "http://www.w3.org/2000/svg";

/** An HTML element. `on...` attributes are listeners, `true` is present, `false` and null are absent. */
export function h(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

/** An SVG element. */
export function s(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === false || value === null || value === undefined) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(
    ...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false),
  );
  return element;
}

/** Returns a table. `columns` are `{name, cell(row), numeric, sorted}`; `sorted` is "ascending" or "descending" if the rows are in that
 * order. The first column heads its row. */
export function table(caption, columns, rows) {
  const cell = (row, column, index) =>
    h(
      index === 0 ? "th" : "td",
      { scope: index === 0 ? "row" : null, class: column.numeric ? "number" : null, "data-name": index === 0 ? null : column.label ?? column.name },
      column.cell(row),
    );
  return h(
    "div",
    { class: "table", tabindex: 0, role: "region", "aria-label": caption },
    h(
      "table",
      {},
      h("caption", { class: "unseen" }, caption),
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          columns.map(({ name, numeric, sorted }) => h("th", { scope: "col", class: numeric ? "number" : null, "aria-sort": sorted }, name)),
        ),
      ),
      h(
        "tbody",
        {},
        rows.map((row) =>
          h(
            "tr",
            {},
            columns.map((column, index) => cell(row, column, index)),
          ),
        ),
      ),
    ),
  );
}

/** Returns content that a reader opens; it is built when first opened. */
export function disclosure(summary, build) {
  const details = h("details", {}, h("summary", {}, summary));
  const fill = () => details.children.length === 1 && details.append(build());
  details.addEventListener("toggle", fill);
  // A script that opens it continues before the toggle event arrives.
  details.addEventListener("reveal", fill);
  return details;
}

/** Opens a disclosure, builds its content at once, and moves to its first field. */
export function reveal(details) {
  details.dispatchEvent(new Event("reveal"));
  details.open = true;
  details.scrollIntoView({ block: "center" });
  details.querySelector("input, select, textarea")?.focus();
}

/** Returns a list of key figures: `[name, value, note, kind]`; `kind` is "inside" if the figure is not for clients. */
export function facts(entries) {
  const fact = ([name, value, note, kind]) =>
    h("div", { class: kind }, h("dt", {}, name), h("dd", {}, value), note ? h("dd", { class: "note" }, note) : null);
  return h("dl", { class: "facts" }, entries.filter(Boolean).map(fact));
}

/** Returns a titled part of a page. A title of two texts ends with what is not for clients. */
export function section(title, ...children) {
  const [words, inside] = [title].flat();
  const heading = h("h2", { id: `h-${words.toLowerCase().replace(/[^a-z0-9]+/g, "-")}` }, words, inside ? h("span", { class: "inside" }, inside) : null);
  return h("section", { "aria-labelledby": heading.id }, heading, children);
}

/** Returns the section for the quant at the end of a page; it is not printed. */
export function quantSection(summary, build) {
  const element = section("For the quant", disclosure(summary, build));
  element.classList.add("asked-for");
  return element;
}

/** Announces a text to screen readers without moving the focus. */
export function announce(text) {
  document.getElementById("status").textContent = text;
}
