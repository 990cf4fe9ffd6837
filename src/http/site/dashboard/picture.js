// A chart as a file of its own: its drawing with title and legend, dark on white whatever the colours of the page.

import { h, s } from "./dom.js";

/** The style properties that a drawing needs to look the same without the style sheet. */
const STYLES = ["fill", "stroke", "stroke-width", "stroke-dasharray", "stroke-linejoin", "opacity", "font-size", "font-weight", "font-variant-numeric"];
const FONT = "Inter, system-ui, sans-serif";
const [MARGIN, HEAD, LINE] = [16, 26, 22];
/** Pixels of the PNG for each pixel of the drawing. */
const FINE = 2;
/** Approximate width of a letter of the legend, in pixels. */
const LETTER = 7.2;

/** Saves text or bytes under a name. */
export function save(content, name, type) {
  const link = h("a", { href: URL.createObjectURL(new Blob([content], { type })), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}

/** Returns the buttons that save a figure's drawing. */
export function pictureButtons(figure) {
  const name = () => titleOf(figure).toLowerCase().replace(/[^a-z0-9]+/g, "-");
  const button = (kind, act) =>
    h("button", { type: "button", class: "link", "aria-label": `Save ${titleOf(figure)} as ${kind}`, onclick: act }, kind);
  return h(
    "span",
    { class: "saving" },
    button("SVG", () => save(svgText(figure), `${name()}.svg`, "image/svg+xml")),
    button("PNG", async () => save(await png(figure), `${name()}.png`, "image/png")),
  );
}

const titleOf = (figure) => figure.querySelector("figcaption .title").textContent;

/** Returns the drawing with every style written out. */
function standing(figure) {
  const drawn = figure.querySelector(".plot svg");
  const [width, height] = ["width", "height"].map((side) => Number(drawn.getAttribute(side)));
  const [keys, lines] = legend(figure, width);
  const top = MARGIN + HEAD + LINE * lines;
  const whole = s("svg", {
    xmlns: "http://www.w3.org/2000/svg",
    width: width + 2 * MARGIN,
    height: height + top + MARGIN,
    viewBox: `0 0 ${width + 2 * MARGIN} ${height + top + MARGIN}`,
    "font-family": FONT,
  });
  const inner = s("g", { transform: `translate(${MARGIN} ${top})` }, [...drawn.cloneNode(true).children]);
  inner.querySelectorAll(".cursor").forEach((cursor) => cursor.remove());
  whole.append(
    s("rect", { class: "sheet", width: "100%", height: "100%" }),
    s("text", { class: "tick name", "font-weight": 600, x: MARGIN, y: MARGIN + 13 }, titleOf(figure)),
    ...keys,
    inner,
  );
  const holder = h("div", { class: "on-white unseen", "aria-hidden": "true" }, whole);
  document.body.append(holder);
  for (const element of whole.querySelectorAll("*")) {
    const style = getComputedStyle(element);
    for (const name of STYLES) element.setAttribute(name, style.getPropertyValue(name));
    element.removeAttribute("class");
  }
  holder.remove();
  return whole;
}

/** Draws the names beside their swatches, in as many lines as needed. */
function legend(figure, width) {
  let [x, line] = [0, 0];
  const keys = [...figure.querySelectorAll(".legend > span")].flatMap((entry) => {
    const swatch = entry.querySelector("svg");
    if (!swatch) return [];
    const name = [...entry.childNodes].filter(({ nodeType }) => nodeType === Node.TEXT_NODE).map(({ data }) => data).join("").trim();
    const room = 34 + LETTER * name.length;
    if (x > 0 && x + room > width) [x, line] = [0, line + 1];
    const y = MARGIN + HEAD + LINE * line;
    const place = s("g", { transform: `translate(${MARGIN + x} ${y})` }, [...swatch.cloneNode(true).children]);
    const words = s("text", { class: "tick name", x: MARGIN + x + 28, y: y + 8 }, name);
    x += room;
    return [place, words];
  });
  return [keys, keys.length > 0 ? line + 1 : 0];
}

const svgText = (figure) => new XMLSerializer().serializeToString(standing(figure));

/** Draws on a canvas, shape by shape, because this page may not load a picture that it made itself. */
async function png(figure) {
  const whole = standing(figure);
  const canvas = h("canvas", {});
  [canvas.width, canvas.height] = ["width", "height"].map((side) => FINE * Number(whole.getAttribute(side)));
  const context = canvas.getContext("2d");
  context.scale(FINE, FINE);
  paint(context, whole, canvas);
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

function paint(context, parent, canvas) {
  for (const element of parent.children) {
    const number = (name, otherwise = 0) => Number.parseFloat(element.getAttribute(name) ?? otherwise);
    context.save();
    const moved = /translate\(([-\d.]+)[ ,]+([-\d.]+)\)/.exec(element.getAttribute("transform") ?? "");
    if (moved) context.translate(Number(moved[1]), Number(moved[2]));
    context.globalAlpha = number("opacity", 1);
    context.lineWidth = number("stroke-width", 1);
    context.setLineDash((element.getAttribute("stroke-dasharray") ?? "").split(/[ ,]+/).map(Number.parseFloat).filter(Number.isFinite));
    const paint_ = { fill: element.getAttribute("fill"), stroke: element.getAttribute("stroke") };
    context.fillStyle = paint_.fill ?? "none";
    context.strokeStyle = paint_.stroke ?? "none";
    if (element.tagName === "g") paint(context, element, canvas);
    else if (element.tagName === "text") written(context, element, number);
    else {
      const shape = outline(element, number, canvas);
      if (paint_.fill !== "none" && element.tagName !== "line") context.fill(shape);
      if (paint_.stroke && paint_.stroke !== "none") context.stroke(shape);
    }
    context.restore();
  }
}

function outline(element, number, canvas) {
  const shape = new Path2D(element.getAttribute("d") ?? "");
  if (element.tagName === "circle") shape.arc(number("cx"), number("cy"), number("r"), 0, 2 * Math.PI);
  if (element.tagName === "line") {
    shape.moveTo(number("x1"), number("y1"));
    shape.lineTo(number("x2"), number("y2"));
  }
  if (element.tagName === "rect") {
    const whole = element.getAttribute("width") === "100%";
    shape.rect(number("x"), number("y"), whole ? canvas.width : number("width"), whole ? canvas.height : number("height"));
  }
  return shape;
}

function written(context, element, number) {
  context.font = `${element.getAttribute("font-weight")} ${element.getAttribute("font-size")} ${FONT}`;
  context.textAlign = { middle: "center", end: "right" }[element.getAttribute("text-anchor")] ?? "left";
  if (element.getAttribute("dy")) context.textBaseline = "middle";
  context.fillText(element.textContent, number("x"), number("y"));
}
