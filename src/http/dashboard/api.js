// The service's own interface, as /docs describes it.

/** A refusal or a failure, as a problem document (RFC 9457). */
export class Problem extends Error {
  constructor(document) {
    super(document.detail || document.title);
    Object.assign(this, { title: document.title, status: document.status, field: document.field, rule: document.rule });
  }

  /** Whether the request may have gone through unheard, or may do so later: sending it again is what to do. */
  get passing() {
    return this.status === 0 || this.status === 503;
  }
}

async function send(method, path, body, signal) {
  const request = { method, signal, headers: {} };
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
  throw new Problem(await response.json().catch(() => fallback));
}

const parsed = async (answer) => (await answer).json();

export const get = (path, signal) => parsed(send("GET", path, undefined, signal));
export const post = (path, body, signal) => parsed(send("POST", path, body, signal));
export const remove = (path) => send("DELETE", path);
export const text = async (path) => (await send("GET", path)).text();

let described;

/** Whether this service has a call, such as `/what-if`. */
export async function offers(path) {
  described ??= get("/openapi.json").then((description) => description.paths);
  return path in (await described.catch(() => ({})));
}

/** Every entry of a list, page after page, to at most `most`. */
export async function list(path, name, signal, most = 200) {
  const page = await get(`${path}?limit=${most}`, signal);
  return { entries: page[name], more: page.next !== null };
}

/**
 * Follows a job: `changed(job)` at once and at every change, until it ends or `signal` aborts.
 * The browser reconnects by itself and says which event it saw last.
 */
export function follow(job, changed, signal) {
  const source = new EventSource(`/jobs/${job}/events`);
  const heard = (event) => {
    const now = JSON.parse(event.data);
    if (isOver(now)) source.close();
    changed(now);
  };
  source.addEventListener("state", heard);
  source.addEventListener("progress", heard);
  signal.addEventListener("abort", () => source.close());
}

export const isOver = (job) => ["succeeded", "failed", "cancelled"].includes(job.state);
