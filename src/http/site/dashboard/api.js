// Calls of the service's interface, as /docs describes it.

import { minus } from "./format.js";
import { held, refusedWords, shown } from "./key.js";

/** Delay before a broken stream is opened again, in milliseconds. */
const RECONNECT = 1000;

/** The type of a problem with an object that is not there. */
export const GONE = "/problems/not-found";
export const WAS_DELETED = "This session was deleted.";

/** A refusal or a failure, as a problem document (RFC 9457). */
export class Problem extends Error {
  constructor(document) {
    super(minus(document.detail || document.title));
    const { type, title, status, field, value, rule, doubts } = document;
    Object.assign(this, { type, title, status, field, value, rule, doubts });
  }

  /** Tells whether to send the request again: it may have succeeded without an answer, or may succeed later. */
  get passing() {
    return this.status === 0 || this.status === 429 || this.status === 503;
  }
}

async function send(method, path, body, signal, headers = {}) {
  const request = { method, signal, headers: { ...headers, ...shown() } };
  if (body !== undefined) {
    request.headers["content-type"] = "application/json";
    request.body = typeof body === "string" ? body : JSON.stringify(body);
  }
  const response = await fetch(path, request).catch((error) => {
    if (error.name === "AbortError") throw error;
    throw new Problem({ title: "No answer", status: 0, detail: "The service did not answer. Is it running?" });
  });
  if (response.ok) return response;
  const fallback = {
    title: response.statusText,
    status: response.status,
    detail: `The service answered ${response.status}.`,
  };
  const problem = new Problem(await response.json().catch(() => fallback));
  if (problem.status === 401 && held()) {
    problem.message = refusedWords(problem, method !== "GET");
    // The problem is with the key, not with a field: what was typed stays while the user pastes another key.
    problem.field = problem.rule = undefined;
    if (method !== "GET") dispatchEvent(new CustomEvent("key-refused", { detail: problem.message }));
  }
  // Whoever acts on a session has seen it: it was deleted since then.
  if (problem.type === GONE && problem.field === "session" && method !== "GET") {
    const session = problem.value;
    problem.message = WAS_DELETED;
    problem.field = problem.rule = undefined;
    dispatchEvent(new CustomEvent("session-deleted", { detail: session }));
  }
  throw problem;
}

const parsed = async (answer) => (await answer).json();

export const get = (path, signal) => parsed(send("GET", path, undefined, signal));
export const post = (path, body, signal, headers) => parsed(send("POST", path, body, signal, headers));
export const patch = (path, body) => parsed(send("PATCH", path, body));
export const remove = (path) => send("DELETE", path);
/** Asks for a page: its text and its headers. */
export async function page(path, body, signal) {
  const answer = await send("POST", path, body, signal);
  return { text: await answer.text(), headers: answer.headers };
}
export const text = async (path) => (await send("GET", path)).text();

/**
 * Follows a job: calls `changed(job)` at once and at every change, until the job ends or `signal` aborts. A broken stream is opened again
 * with the last event seen; `unheard(error)` is called then, and with null once the stream continues. It uses `fetch`, because an
 * `EventSource` cannot send a key.
 */
export async function follow(job, changed, signal, unheard = () => {}) {
  let seen = {};
  while (!signal.aborted) {
    try {
      const stream = await send("GET", `/jobs/${job}/events`, undefined, signal, seen);
      if (stream.status === 204) return;
      for await (const event of events(stream.body)) {
        seen = { "last-event-id": event.id };
        const now = JSON.parse(event.data);
        unheard(null);
        changed(now);
        if (isOver(now)) return;
      }
    } catch (error) {
      if (signal.aborted || (error instanceof Problem && !error.passing)) return;
      unheard(error);
    }
    await new Promise((resolve) => setTimeout(resolve, RECONNECT));
  }
}

/** Trains a policy and returns its identifier, once it is there. */
export async function trained(request, signal) {
  let now = await post("/train", request);
  await follow(now.job, (job) => (now = job), signal);
  if (!isOver(now)) now = await get(`/jobs/${now.job}`, signal);
  if (now.state !== "succeeded") throw new Error(`the training ${now.state}${now.error ? `: ${now.error}` : ""}`);
  return now.policy;
}

/** Yields the events of a stream, each with its fields; skips comments, which have no data. */
async function* events(body) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  const field = (line) => [line.split(":", 1)[0], line.slice(line.indexOf(":") + 1).trimStart()];
  let rest = "";
  try {
    for (;;) {
      const { value, done } = await reader.read();
      if (done) return;
      const blocks = (rest + value).split("\n\n");
      rest = blocks.pop();
      const found = blocks.map((block) => Object.fromEntries(block.split("\n").map(field)));
      yield* found.filter((event) => event.data);
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

/** Downloads the target of a link by a call with the key, because the browser alone would be refused. */
export async function download(event) {
  const link = event.currentTarget;
  if (!held() || link.href.startsWith("blob:")) return;
  event.preventDefault();
  const file = await (await send("GET", link.getAttribute("href"))).blob();
  const address = link.getAttribute("href");
  link.href = URL.createObjectURL(file);
  link.click();
  URL.revokeObjectURL(link.href);
  link.setAttribute("href", address);
}

export const isOver = (job) => ["succeeded", "failed", "cancelled"].includes(job.state);
