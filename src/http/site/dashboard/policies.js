// Policies: those that were trained here, and those that were imported.

import { get, post } from "./api.js";
import { h, table } from "./dom.js";
import { pressed } from "./form.js";
import { count, moment, percent } from "./format.js";
import { called, headed, tagList } from "./naming.js";
import { foot, Pages } from "./pages.js";
import { ticking } from "./ticking.js";
import { caution, FRAMEWORKS, isDeclared, utility } from "./specification.js";

/** Rows shown at a time: fewer than in other lists, because each needs a call of its own. */
const PAGE = 50;

export async function view(_, leaving) {
  const pages = new Pages("/policies", "policies", leaving, { limit: PAGE });
  const detailed = (entries) =>
    Promise.all(
      entries.map(async (entry) => ({
        ...entry,
        detail: await get(`/policies/${entry.policy}`, leaving).catch(() => null),
      })),
    );
  const rows = await detailed(await pages.next());
  const actions = h(
    "div",
    { class: "actions" },
    importer(),
    h("a", { class: "button quiet", href: "#/declare", "data-needs": "train" }, "Declare a problem"),
    h("a", { class: "button", href: "#/train" }, "Train a policy"),
  );
  if (rows.length === 0) return { title: "Policies", actions, body: empty() };
  const ticks = ticking("policies");
  const holder = h("div", {}, listed(rows, ticks));
  const add = async (older) => {
    rows.push(...(await detailed(older)));
    holder.replaceChildren(listed(rows, ticks));
  };
  return { title: "Policies", actions, body: [ticks.link, holder, foot(pages, ["policy", "policies"], rows.length, add)] };
}

function empty() {
  return h(
    "div",
    { class: "empty" },
    h(
      "p",
      { class: "lead" },
      "No policy yet. A policy says how much to hold at every wealth and after every history. Train one to start.",
    ),
    h("p", { "data-needs": "train" }, h("a", { href: "#/train" }, "Train one"), ", or import a document that another Ballast exported."),
  );
}

function listed(rows, ticks) {
  const of =
    (read) =>
    ({ detail }) =>
      detail ? read(detail.specification.problem, detail) : "\u2013";
  const said = (read) => (row) => h("div", { class: "said" }, of(read)(row));
  return table(
    "Policies, newest first",
    [
      {
        name: "Policy",
        cell: ({ policy, name, tags }) =>
          h(
            "div",
            { class: "ticked" },
            ticks.box(policy, `policy ${called(policy, name)}`),
            h("div", {}, headed(`#/policies/${policy}`, policy, name), tagList(tags)),
          ),
      },
      { name: "Framework", cell: of(({ framework }) => FRAMEWORKS[framework]) },
      { name: "Investor", cell: said((problem) => (isDeclared({ problem }) ? `None: decides ${Object.keys(problem.actions).join(", ")}` : utility(problem.utility))) },
      { name: "Caution", cell: said((problem) => caution(problem)) },
      { name: "Periods ahead", numeric: true, cell: of(({ horizon }) => count(horizon)) },
      { name: "Bank return", numeric: true, cell: of(({ rate_per_step }) => percent(rate_per_step, 2)) },
      { name: "Returns", numeric: true, cell: of(({ history }) => count(history.length)) },
      { name: "Stored", cell: ({ created_ms }) => h("span", { title: moment(created_ms) }, moment(created_ms).split(",")[0]) },
    ],
    rows,
  );
}

function importer() {
  const file = h("input", {
    type: "file",
    accept: "application/json,.json",
    class: "unseen",
    id: "import",
    "aria-label": "Policy document to import",
  });
  const label = h("label", { class: "button quiet", for: "import" }, "Import");
  const act = async () => {
    const chosen = file.files[0];
    // Allows the same file to be chosen again after a change.
    const { policy } = await post("/policies/import", await chosen.text().finally(() => (file.value = "")));
    location.hash = `#/policies/${policy}`;
  };
  file.addEventListener("change", () => pressed(label, act));
  return h("span", { "data-needs": "train" }, file, label);
}
