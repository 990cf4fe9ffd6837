// Subscriptions: the programs that are told of events, how their deliveries fare, and the form for another.

import { get, post, remove } from "./api.js";
import { announce, h, section } from "./dom.js";
import { fieldset, input, pressed, refusal, sending } from "./form.js";
import { count, counted, moment } from "./format.js";
import { fraction } from "./number_text.js";

/** The events by their names, in words. */
export const EVENTS = {
  advice_changed: "The advice of a session changed",
  left_band: "A holding left the range in which it is best kept",
  drift_alarm: "Returns are no longer like the record",
  renewal_failed: "The next policy of a session could not be trained",
  report_due: "The report of a session is due",
  report_late: "The report of a session is late",
  job_ended: "A job ended",
};

export async function view(_, leaving) {
  const trail = h("p", { class: "trail" }, h("a", { href: "#/key" }, "Key"));
  const lead = "Another program can be told of what happens here: each event is sent to its address, signed, until it is accepted. People can be told by e-mail. ";
  const list = h("div");
  const read = async () => {
    const { subscriptions } = await get("/subscriptions", leaving);
    list.replaceChildren(...(subscriptions.length > 0 ? subscriptions.map((one) => card(one, read)) : [h("p", {}, "No program is told of anything yet.")]));
  };
  await read();
  const form = h("div", { "data-needs": "operate" }, section("Tell another program", subscribing(read)));
  return { title: "Subscriptions", trail, body: [h("p", { class: "lead" }, lead, h("a", { href: "/guide/subscriptions" }, "How to receive events"), "."), list, form] };
}

/** Returns the form for another subscription; `made()` is called once there is one. */
function subscribing(made) {
  const url = input({ name: "url", label: "Address", note: "Encrypted (https), and public. For an e-mail: mailto:someone@example.com, if the service has a mail server.", inputmode: "url" });
  const change = input({ name: "least_change", label: "Least change of the advice, %", note: "Smaller changes are not sent.", value: "5", unit: "percent" });
  const events = h(
    "div",
    { class: "field checks", role: "group", "aria-label": "Events" },
    Object.entries(EVENTS).map(([value, words]) => h("label", {}, h("input", { type: "checkbox", name: "events", value, checked: value !== "job_ended" }), words)),
  );
  const send = h("button", { type: "submit" }, "Subscribe");
  const place = h("div");
  const form = h("form", { novalidate: true }, fieldset("Who is told of what", [url, change, events]), refusal(), h("p", { class: "send" }, send), place);
  // A request that is sent again after a lost answer makes no second subscription.
  let key = crypto.randomUUID();
  sending(form, send, async () => {
    const text = change.control.value.trim();
    const request = { url: url.control.value.trim(), events: [...events.querySelectorAll(":checked")].map(({ value }) => value), least_change: fraction(text) ?? text };
    const { secret } = await post("/subscriptions", request, undefined, { "idempotency-key": key });
    key = crypto.randomUUID();
    place.replaceChildren(...(isMail(request.url) ? [] : [secretWords(secret)]));
    announce("Subscribed.");
    await made();
  });
  form.addEventListener("input", () => (key = crypto.randomUUID()));
  return form;
}

/** Tells whether events are sent by e-mail, which is not signed. */
const isMail = (url) => /^mailto:/i.test(url);

/** Shows a secret, which the service does not show again. */
const secretWords = (secret) => h("p", { class: "sentence" }, "Keep this secret, with which each event is signed. It is not shown again: ", h("code", {}, secret));

/** Returns the card of a subscription; `changed()` reads them all again. */
function card({ subscription, url, events, sessions, least_change, delivered, waiting, dead, dropped, failures, last_delivered_ms, last_error, dead_letters }, changed) {
  const path = `/subscriptions/${subscription}`;
  const told = events.map((event) => (event === "advice_changed" && least_change > 0 ? `${EVENTS[event]} by more than ${Number((100 * least_change).toPrecision(6))}\u202f%` : EVENTS[event]));
  const fares = [
    `${counted(delivered, "event")} accepted${last_delivered_ms === null ? "" : `, the last ${moment(last_delivered_ms)}`}`,
    waiting > 0 ? `${count(waiting)} to be sent` : null,
    dead > 0 ? `${count(dead)} given up` : null,
    dropped > 0 ? `${count(dropped)} lost, because as many were kept already` : null,
  ];
  const place = h("div");
  const action = (words, act, attributes = {}) => {
    const button = h("button", { type: "button", class: "quiet", "data-needs": "operate", ...attributes }, words);
    button.addEventListener("click", () => pressed(button, act));
    return button;
  };
  const resend = async () => {
    const { queued } = await post(`${path}/resend`);
    announce(`${counted(queued, "event")} queued again.`);
    await changed();
  };
  const rotate = async () => place.replaceChildren(secretWords((await post(`${path}/secret`)).secret), h("p", { class: "note" }, "For a day the secret before signs too."));
  const end = async () => {
    if (!confirm("Delete this subscription, with what is still to be sent?")) return;
    await remove(path);
    announce("Deleted.");
    await changed();
  };
  return h(
    "section",
    { class: "card", "aria-label": url },
    h("h2", {}, url),
    h("ul", { class: "points" }, told.map((words) => h("li", {}, words))),
    sessions.length > 0 ? h("p", {}, `Only ${counted(sessions.length, "session")}.`) : null,
    h("p", {}, `${fares.filter(Boolean).join("; ")}.`),
    last_error === null ? null : h("p", { class: "note wrong" }, `${counted(failures, "attempt")} failed${last_delivered_ms === null ? "" : " since then"}: ${last_error}.`),
    dead_letters.length > 0 ? h("details", {}, h("summary", {}, "The newest events that were given up"), dead_letters.map(({ event, created_ms, error, body }) => h("div", {}, h("p", {}, `${EVENTS[event]}, ${moment(created_ms)}: ${error}.`), h("pre", { tabindex: 0 }, body)))) : null,
    h("p", { class: "send" }, dead > 0 ? action("Send them again", resend) : null, isMail(url) ? null : action("New secret", rotate), action("Delete", end, { class: "quiet danger" })),
    place,
  );
}
