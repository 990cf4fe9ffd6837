// What the key in use allows its holder to do, in words.

import { get } from "./api.js";
import { h } from "./dom.js";
import { moment, short } from "./format.js";
import { held } from "./key.js";

/** What each role may do; an admin may do all of it. */
const ROLES = {
  read: "see policies, sessions and jobs",
  operate: "open sessions and report their returns",
  train: "train policies and compare strategies",
  admin: "see the audit, and the service\u2019s figures over all tenants",
};

/** The roles of the key in use, requested once for each key. */
let known = { of: undefined };

/** Returns the roles that parts of the page need and the key in use lacks; none if the service does not say. */
export async function lacking() {
  if (known.of !== held()) known = { of: held(), holder: get("/key") };
  const holder = await known.holder.catch(() => (known = { of: undefined }));
  if (!holder.key || holder.roles.includes("admin")) return [];
  return ["operate", "train"].filter((role) => !holder.roles.includes(role));
}

/** Says what the key in use may not do. */
export const lackWords = (role) => `The key in use may not ${ROLES[role].replace(" and ", " or ")}: it lacks the role ${role}.`;

const listed = (words) => words.join(", ").replace(/, (?=[^,]*$)/, " and ");

/** Says in a sentence or two what the key may do; blank if the service does not say. */
export async function holderWords(signal) {
  const holder = await get("/key", signal).catch(() => null);
  if (holder === null) return "";
  const { key, tenant, roles, expires_ms } = holder;
  const whose = h("b", {}, tenant);
  if (key === null)
    return h("p", { class: "note" }, "This service asks for no key: anyone who can reach it may do everything, as the tenant ", whose, ".");
  const may = Object.keys(ROLES).filter((role) => roles.includes(role));
  const missing = Object.keys(ROLES).filter((role) => role !== "admin" && !roles.includes(role));
  return h(
    "p",
    { class: "note" },
    "You are the tenant ",
    whose,
    `, with the key ${short(key)} (${listed(may)}). You may ${listed(may.map((role) => ROLES[role]))}${missing.length > 0 ? `, and not ${missing.map((role) => ROLES[role]).join(", nor ")}` : ""}.`,
    expires_ms === null ? "" : ` The key expires on ${moment(expires_ms)}.`,
    " You cannot see what other tenants have.",
  );
}
