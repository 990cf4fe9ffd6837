// One session, fit to show to a client: what to hold now and why, the return to report, how it went, and its basis.

import { adviceView } from "./advice.js";
import { get, remove } from "./api.js";
import { grown, risky } from "./comparators.js";
import { holdings, wealthCourse, worstFallFact } from "./course.js";
import { declaredSession } from "./declared_session.js";
import { announce, facts, h, section } from "./dom.js";
import { addedIn, banked, netAdded, spentIn, standing } from "./flows.js";
import { pressed } from "./form.js";
import { allocation, count, counted, percent, points, short } from "./format.js";
import { asking } from "./frontier.js";
import { futuresOf } from "./futures.js";
import { inCurrency } from "./money.js";
import { labelled, titled } from "./naming.js";
import { observeForm } from "./observe.js";
import { lastReport, observed, righting } from "./observed.js";
import { calendar, day, isoDay } from "./periods.js";
import { presentSwitch } from "./present.js";
import { due } from "./renewal_due.js";
import { moneyToday } from "./money_today.js";
import { nearness } from "./sensitivity.js";
import { severalAdvice, severalHeld, severalWorst } from "./several.js";
import { presentAssets } from "./several_fields.js";
import { hasBall, isCautious, isParametric, moments, utility } from "./specification.js";
import { conservatism } from "./what_if.js";
import { worstMarket } from "./worst_market.js";

export async function view(id, leaving) {
  const session = await get(`/sessions/${id}`, leaving);
  if (session.states) return ofDeclared(id, session, leaving);
  const [history, policy] = await Promise.all([get(`/sessions/${id}/history`, leaving), get(`/policies/${session.policy}`, leaving)]);
  const holder = h("div", {});
  const shown = { id, policy, leaving };
  const known = (session, history) => ({
    ...shown,
    session,
    history,
    refresh,
    calendar: calendar(history, policy.specification.problem.periods_per_year),
    cautionScale: cautionScale(policy.specification.problem),
  });
  /** Shows the session again after a report: with a receipt, or with the result of `alert(history)`. */
  const refresh = async (news, alert) => {
    const now = known(...(await Promise.all([get(`/sessions/${id}`, leaving), get(`/sessions/${id}/history`, leaving)])));
    const { session, calendar, history } = now;
    const ended = session.state === "completed" ? "The session is completed with wealth" : "Wealth";
    const words = `${news ?? `${calendar.name(session.period - 1)} is recorded.`} ${ended} ${inCurrency(session.wealth)}.`;
    await fill(holder, { ...now, notice: alert ? alert(history) : h("p", { class: "note receipt" }, words) });
    if (!alert) announce(words);
    holder.querySelector("#advice")?.focus();
  };
  await fill(holder, known(session, history));
  const trail = [...trailed(session, policy), `, ${utility(policy.specification.problem.utility)}`];
  const identity = h("div", { class: "identity" }, labelled("Session", `/sessions/${id}`, id, session), h("p", { class: "quick" }, h("a", { href: `#/sessions/${id}/letter` }, "Letter"), h("a", { href: `#/sessions/${id}/track` }, "Track record"), presentSwitch()));
  return { title: titled("Session", id, session.name), trail: h("p", { class: "trail" }, trail), under: [identity, letterhead(policy)], body: [holder, h("p", { class: "printed note" }, DISCLAIMER), h("p", { class: "end" }, session.state === "active" ? goOn(id) : null, deletion(id, titled("Session", id, session.name)))] };
}

/** Returns the page of a session of a declared problem. */
async function ofDeclared(id, session, leaving) {
  const policy = await get(`/policies/${session.policy}`, leaving);
  const title = titled("Session", id, session.name);
  const trail = h("p", { class: "trail" }, trailed(session, policy));
  return { title, trail, under: h("div", { class: "identity" }, labelled("Session", `/sessions/${id}`, id, session), h("p", { class: "quick" }, presentSwitch())), body: [await declaredSession(id, session, policy, leaving), h("p", { class: "end" }, goOn(id), deletion(id, title))] };
}

const trailed = (session, policy) => [h("a", { href: "#/sessions" }, "Overview"), " \u203a ", h("a", { href: `#/policies/${session.policy}` }, titled("Policy", session.policy, policy.name))];

/** The text at the end of the printed page. */
const DISCLAIMER = "This is computed from past returns, which do not predict the future. Statements about the worst market hold only for the markets that the record allows.";

/** Returns the line for the printed page only: the day and the policy. */
const letterhead = ({ policy, name, specification: { problem, fund } }) =>
  h("p", { class: "printed note" }, `${day(isoDay(new Date()))}. ${fund ? `${fund.assets.join(", ")}. ` : ""}By ${name ? `\u201c${name}\u201d` : `policy ${short(policy)}`}, for ${utility(problem.utility)}.`);

/** Returns how much one unit of the radius takes from the average return; with a normal law the radius is in standard deviations. */
const cautionScale = (problem) => (isParametric(problem.framework) ? moments(problem.history).deviation : 1);

async function fill(holder, told) {
  const { id, session, history, leaving } = told;
  const shown = { ...told, right: null };
  shown.right = history.observations.length > 0 ? righting(shown) : null;
  if (session.state === "completed") {
    const ended = [h("div", {}, completed(shown), shown.notice ?? "", lastReport(shown)), wealthCourse(shown)];
    return holder.replaceChildren(h("div", { class: "columns" }, ended), figures(shown, null), history.assets ? severalHeld(shown) : held(shown, null), observed(shown));
  }
  const action = await get(`/action?session=${id}`, leaving);
  const { advice, found } = (history.assets ? ofSeveral : ofOne)(shown, action, [shown.notice ?? "", observeForm(action, shown), moneyToday(shown, action, place(shown, action)), lastReport(shown)]);
  holder.replaceChildren(
    changed(shown),
    due(shown),
    ending(shown),
    h("div", { class: "columns" }, advice, wealthCourse(shown)),
    figures(shown, action),
    ...found,
    shown.policy.specification.problem.spending ? "" : futuresOf(`/sessions/${id}`, leaving, { format: inCurrency, x: { label: "Period", format: shown.calendar.after, here: shown.calendar.after, tick: shown.calendar.brief, whole: true } }),
    observed(shown),
    frontier(shown),
  );
}

/** Returns the advice, followed by `rest`, and the sections on how it was found and what was held. */
function ofOne(shown, action, rest) {
  const { id, session, policy, leaving, calendar } = shown;
  const advice = adviceView(action, place(shown, action), rest);
  const near = nearness({ id, policy, leaving });
  const cautious = isCautious(policy.specification.problem);
  const caution = cautious ? conservatism(shown, action) : null;
  const worst = worstMarket({ ...shown, cautious }, advice, () => near.ask().then(() => caution?.ask()));
  return { advice: advice.element, found: [near.element, worst, caution?.element ?? "", held(shown, action)] };
}

/** Returns the same for several assets, without advice for other amounts of caution. */
function ofSeveral(shown, action, rest) {
  const assets = presentAssets(shown.history);
  return { advice: severalAdvice(action, place(shown, action), assets, rest), found: [severalWorst(action, assets, shown.calendar), severalHeld(shown)] };
}

/** Returns the context of the advice: its period, the end of the horizon, and the terms in money. */
export function place({ session, history, policy, calendar }, { period }) {
  const { trading_cost, horizon, spending } = policy.specification.problem;
  const name = calendar.name(period);
  const which = session.rolling || period > session.horizon ? "" : ` of ${session.horizon}`;
  const last = standing(history.observations.at(-1));
  return {
    heading: name === `Period ${period}` ? [name, which] : [name, `, period ${period}${which}`],
    end: spending ? spentEnd(calendar) : session.rolling ? `${counted(horizon, calendar.unit)} from now` : `at the end of ${calendar.inText(session.horizon)}`,
    cautious: isCautious(policy.specification.problem),
    price: last.price ?? null,
    prices: last.prices ?? {},
    cost: trading_cost,
    wealth: session.wealth,
  };
}

/** Says what a sure amount is, where the policy plans spending. */
const spentEnd = ({ unit }) => `spent every ${unit}, in money of now`;

function figures(shown, action) {
  const { session, history, calendar, policy } = shown;
  const put = netAdded(history);
  const change = grown(history).at(-1) / 100 - 1;
  const moved = history.observations.some((_, index) => addedIn(history, index + 1) !== 0);
  const apart = moved ? `, time-weighted; ${inCurrency(Math.abs(put))} ${put < 0 ? "withdrawn" : "added"} in all` : "";
  const spent = history.observations.reduce((all, _, index) => all + spentIn(history, index + 1), 0);
  const used = spent > 0 ? `${moved ? "" : ", time-weighted"}; ${inCurrency(spent)} spent in all` : "";
  const end = policy.specification.problem.spending ? spentEnd(calendar) : session.rolling ? "one policy horizon from now" : `at the end of ${calendar.inText(session.horizon)}`;
  const caution = action && points(action.radius * shown.cautionScale, 2);
  return h(
    "div",
    { class: "figures" },
    facts([
      ["Wealth", inCurrency(session.wealth), `${change >= 0 ? "+" : ""}${percent(change)} since the start${apart}${used}`],
      [`Held in ${risky(shown.history)}`, allocation(session.holding), "of wealth, before trading"],
      action && ["Worth as much as a sure", inCurrency(action.certainty_equivalent), end],
      action && ["All in the bank", inCurrency(action.floor), `${end}, if all is sold now`],
      history.observations.length > 0 && worstFallFact(shown),
      action && isCautious(shown.policy.specification.problem) && ["Caution", caution, `how much lower the average return a ${calendar.unit} may really be`, "inside"],
      [
        "Returns seen",
        count(session.sample_size),
        `${counted(session.period - 1, "period")} observed${session.rolling ? "" : ` of ${session.horizon}`}`,
        "inside",
      ],
    ]),
  );
}

/** Warns that the market has changed, if it has. */
function changed({ session: { drift } }) {
  if (drift.level === "none") return "";
  const how = drift.level === "alarm" ? "has changed" : "may have changed";
  const words = `The market ${how}. If nothing had changed, at most one session in ${count(Math.floor(drift.highest))} would show so clear a sign. The advice rests on all returns seen; a policy trained on newer returns may serve better.`;
  return h("p", { class: "note wrong" }, words);
}

/** Returns the link to another policy for the session, from the next period on. */
const goOn = (id, words = "Continue with another policy") => h("a", { class: "button quiet", href: `#/renew?sessions=${id}` }, words);

/** Warns that this is the policy's last period and that no other policy follows automatically. */
function ending({ id, session, calendar }) {
  if (session.renew || session.rolling || session.period < session.horizon) return "";
  return h("p", { class: "note wrong" }, `${calendar.name(session.horizon)} is the last period that its policy advises. `, h("a", { href: `#/renew?sessions=${id}` }, "Continue with another policy"), ".");
}

function completed({ id, session, history }) {
  const bank = banked(history, session.horizon).at(-1);
  return section(
    "Completed",
    h(
      "div",
      { class: "advice", id: "advice", tabindex: -1 },
      h("p", { class: "big" }, h("span", {}, "It ended with "), h("strong", {}, inCurrency(session.wealth))),
      h("p", { class: "sentence" }, `The bank alone would have reached ${inCurrency(bank)}.`),
      h("p", { class: "actions" }, goOn(id), h("a", { class: "button quiet", href: `#/sessions/new?policy=${session.policy}` }, "Open another session")),
    ),
  );
}

const held = (shown, action) => section("What it held", h("div", { class: "duo" }, ...holdings(shown, action)));

/** Offers the frontier of caution, if the policy has a ball. */
function frontier({ session, policy, history }) {
  const { problem } = policy.specification;
  if (!hasBall(problem)) return "";
  const element = section(
    "How much caution",
    h(
      "p",
      { class: "note" },
      "What other amounts of caution would lose on many records drawn like this one. Each period counts alone, without trading costs, without discounting older returns, and without money added or withdrawn.",
    ),
    h("p", {}, asking(policy.specification, history.record, session.wealth)),
  );
  element.classList.add("asked-for");
  element.dataset.needs = "train";
  return element;
}

function deletion(id, name) {
  const button = h("button", { class: "quiet danger", "data-needs": "operate" }, "Delete");
  const act = async () => {
    await remove(`/sessions/${id}`);
    location.hash = "#/sessions";
  };
  button.addEventListener("click", () => confirm(`Delete ${name.replace(/^S(?=ession)/, "s")} and all its reports for good?`) && pressed(button, act));
  return button;
}
