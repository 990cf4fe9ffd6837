// Limits on the shares of several assets in what is held of them: the fields of a form, and the words of an answer.

import { h } from "./dom.js";
import { input } from "./form.js";
import { allocation } from "./format.js";
import { fraction } from "./number_text.js";

/** A share this near to its limit has reached it: advice is shown to a tenth of a percent. */
const NEAR = 0.0005;
/** Most groups of a request. */
const MOST = 30;
const PLACE = "problem.limits";

const text = ({ control }) => control.value.trim();
const isGiven = (field) => text(field) !== "";
/** Returns the fraction in a field, or its text if it is no number: the service says what is wrong with it. */
const value = (field) => fraction(text(field)) ?? text(field);
const range = (low, high) => ({ ...(isGiven(low) && { min: value(low) }), ...(isGiven(high) && { max: value(high) }) });

/** Returns the fields of a range: the lowest and the highest share of `name`. */
function rangeFields(path, within, name, changed) {
  const one = (end, word) => input({ within, name: `${path}.${end}`, label: `${word} share of ${name}, %`, unit: "percent", changed });
  return [one("min", "Lowest"), one("max", "Highest")];
}

/** Returns `{element, fields, limits()}`: the limits in a fold, the fields of those that are of no group, and the limits of the request,
 * undefined if there is none. */
export function limitFields(assets, changed) {
  const each = assets.map((name, index) => rangeFields(`${PLACE}.assets.${name}`, `limit-${index}-`, name, changed));
  const turnover = input({ name: `${PLACE}.max_turnover`, label: "Largest turnover, %", note: "The changes of these shares added up: 200 sells all and buys others. Blank: any.", unit: "percent", changed });
  const groups = [];
  const added = h("div", {});
  const more = h("button", { type: "button", class: "quiet", onclick: () => add() }, "Add a group");
  const draw = () => {
    added.replaceChildren(...groups.map(({ element }) => element));
    more.hidden = groups.length >= MOST;
  };
  let count = 0;
  const add = () => {
    const group = groupFields(assets, (count += 1), {
      changed,
      remove: () => {
        groups.splice(groups.indexOf(group), 1);
        draw();
        changed();
        more.focus();
      },
    });
    groups.push(group);
    draw();
    group.element.querySelector("input").focus();
  };
  const limits = () => {
    const ranges = assets.map((name, index) => [name, range(...each[index])]).filter(([, range]) => Object.keys(range).length > 0);
    const named = groups.map((group) => group.limit()).filter(Boolean);
    const found = {
      ...(ranges.length > 0 && { assets: Object.fromEntries(ranges) }),
      ...(named.length > 0 && { groups: named }),
      ...(isGiven(turnover) && { max_turnover: value(turnover) }),
    };
    return Object.keys(found).length > 0 ? found : undefined;
  };
  const note = h("p", { class: "note" }, "Shares of what is held of all assets together, which come to 100\u202f%. A blank field limits nothing.");
  const element = h("details", {}, h("summary", {}, "Limits on the shares"), note, h("div", { class: "fields" }, each.flat().map(({ element }) => element)), added, h("p", {}, more), h("div", { class: "fields" }, turnover.element));
  return { element, fields: [...each.flat(), turnover], limits };
}

/** Returns `{element, limit()}`: the fields of a group of assets, and its limit, null while no asset or no share is chosen. */
function groupFields(assets, number, { changed, remove }) {
  const within = `group-${number}-`;
  const name = input({ within, name: `${PLACE}.groups.name`, label: "Name of the group", value: `Group ${number}`, inputmode: "text", maxlength: 100, changed });
  const [low, high] = rangeFields(`${PLACE}.groups`, within, "the group", changed);
  const boxes = assets.map((asset) => h("input", { type: "checkbox", value: asset, onchange: changed }));
  const choices = h("div", {}, boxes.map((box) => h("label", { class: "option" }, box, box.value)));
  const away = h("button", { type: "button", class: "link", onclick: remove }, "Remove the group");
  const element = h("fieldset", { class: "group" }, h("legend", {}, `Group ${number}`), choices, h("div", { class: "fields" }, [name, low, high].map(({ element }) => element)), away);
  const limit = () => {
    const chosen = boxes.filter(({ checked }) => checked).map((box) => box.value);
    const shares = range(low, high);
    return chosen.length === 0 || Object.keys(shares).length === 0 ? null : { name: text(name), assets: chosen, ...shares };
  };
  return { element, limit };
}

/** Says which limits an advice keeps, and which of them it reaches; blank if there is none. */
export function limitWords(limits, { allocation: shares, total }) {
  if (!limits) return "";
  const part = (names) => names.reduce((sum, name) => sum + shares[name], 0) / total;
  const words = (name, { min, max }, share) => {
    const told = min === undefined ? `at most ${allocation(max)}` : max === undefined ? `at least ${allocation(min)}` : `${allocation(min)} to ${allocation(max)}`;
    const isReached = [min || undefined, max].some((limit) => Math.abs(share - limit) < NEAR);
    return `${name} ${told}${isReached ? " (reached)" : ""}`;
  };
  const all = [
    ...Object.entries(limits.assets ?? {}).map(([name, range]) => words(name, range, part([name]))),
    ...(limits.groups ?? []).map((group) => words(`${group.name} (${group.assets.join(", ")})`, group, part(group.assets))),
    ...(limits.max_turnover === undefined ? [] : [`turnover at most ${allocation(limits.max_turnover)}`]),
  ];
  return h("p", { class: "sentence" }, `Limits on the shares of what is held: ${all.join("; ")}.`);
}
