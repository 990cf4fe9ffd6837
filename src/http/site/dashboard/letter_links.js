// Links under which a client reads the present letter without a key: made, shown once, and withdrawn.

import { get, post, remove } from "./api.js";
import { announce, h, section } from "./dom.js";
import { input, pressed, refusal, sending } from "./form.js";
import { moment } from "./format.js";

/** Days that a link is in force unless another number is typed. */
const USUAL_DAYS = 31;

/** Returns the section on the links to a session's letter; `dress()` gives the firm, the currency and the smallest trade of the letter. */
export async function letterLinks(id, dress, leaving) {
  const list = h("div");
  const read = async () => {
    const { links } = await get(`/sessions/${id}/links`, leaving);
    const present = links.filter(({ expires_ms }) => expires_ms > Date.now());
    list.replaceChildren(present.length > 0 ? h("ul", { class: "points" }, present.map((link) => line(link, read))) : h("p", { class: "note" }, "No link is in force."));
  };
  await read();
  return h("div", { class: "letter-links", "data-needs": "operate" }, section("A link for the client", h("p", {}, "Whoever has the link always sees the newest figures of this letter, until the link expires. It shows nothing else, and needs no key."), list, making(id, dress, read)));
}

/** Returns the form for another link; `made()` is called once there is one. */
function making(id, dress, made) {
  const days = input({ within: "link-", name: "days", label: "Days", note: "1 to 400, then the link leads nowhere.", value: String(USUAL_DAYS), inputmode: "numeric" });
  const send = h("button", { type: "submit", class: "quiet" }, "Make a link");
  const place = h("div", { role: "status" });
  const form = h("form", { novalidate: true, "aria-label": "A link for the client" }, h("div", { class: "fields" }, days.element), refusal(), h("p", { class: "send" }, send), place);
  sending(form, send, async () => {
    const text = days.control.value.trim();
    const { path } = await post(`/sessions/${id}/links`, { days: Number.isInteger(Number(text)) && text !== "" ? Number(text) : text, letter: dress() });
    const url = new URL(path, location.href).href;
    const copy = h("button", { type: "button", class: "link" }, "Copy");
    copy.addEventListener("click", () => pressed(copy, async () => (await navigator.clipboard.writeText(url), announce("Copied."))));
    place.replaceChildren(h("p", { class: "sentence" }, "Send this link to the client. It is not shown again: ", h("code", {}, url), " ", copy));
    await made();
  });
  return form;
}

function line({ link, created_ms, expires_ms }, changed) {
  const button = h("button", { type: "button", class: "link" }, "Withdraw");
  button.addEventListener("click", () =>
    pressed(button, async () => {
      await remove(`/links/${link}`);
      announce("The link leads nowhere now.");
      await changed();
    }),
  );
  return h("li", {}, `Made ${moment(created_ms)}, in force until ${moment(expires_ms)}. `, button);
}
