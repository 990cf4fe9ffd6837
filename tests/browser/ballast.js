// The real binary on a free port with a data folder of its own, and the real Chromium.

import { execFile, spawn } from "node:child_process";
import { existsSync } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { chromium } from "playwright-core";

const run = promisify(execFile);
const built = (name) => fileURLToPath(new URL(`../../target/release/${name}`, import.meta.url));
export const BINARY = process.env.BALLAST_BINARY ?? built("ballast");
/** The program of the measurements and experiments. */
export const LAB = process.env.BALLAST_LAB_BINARY ?? built("ballast-lab");
/** Where the page's files are read from, in the place of those in the binary: a change of them needs no build to be looked at. */
const FILES = process.env.BALLAST_DASHBOARD;
const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";

/** Starts the service; `url` is where it listens, `key(...roles)` makes a key, of another tenant by `keyOf(tenant, ...roles)`, `kill()` ends
 * it at once and `start()` starts it again at the same address over the same data; `stop()` ends it and takes its data away. */
export async function service() {
  const folder = await mkdtemp(join(tmpdir(), "ballast-browser-"));
  let [process_, ended] = [];
  const start = async (listen) => {
    process_ = spawn(BINARY, ["serve", "--listen", listen, "--data", folder], { stdio: ["ignore", "pipe", "ignore"] });
    ended = new Promise((resolve) => process_.once("exit", resolve));
    const failed = new Promise((_, reject) => process_.once("error", reject));
    const listening = (async () => {
      for await (const line of createInterface(process_.stdout)) {
        const address = /listening on (http:\S+)/.exec(line);
        if (address) return address[1];
      }
      throw new Error(`${BINARY} ended before it listened`);
    })();
    return Promise.race([listening, failed]);
  };
  const end = (signal) => {
    process_.kill(signal);
    return ended;
  };
  const url = await start("127.0.0.1:0");
  const stop = async () => {
    await end("SIGTERM");
    await rm(folder, { recursive: true });
  };
  const keyOf = async (tenant, ...roles) => {
    const given = roles.flatMap((role) => ["--role", role]);
    return (await run(BINARY, ["keys", "create", "--new", "--data", folder, "--tenant", tenant, ...given])).stdout.trim();
  };
  return { url, stop, key: (...roles) => keyOf("default", ...roles), keyOf, kill: () => end("SIGKILL"), start: () => start(new URL(url).host) };
}

export async function browser() {
  const launched = await chromium.launch({
    executablePath: CHROMIUM,
    args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking"],
  });
  if (FILES === undefined) return launched;
  const newContext = launched.newContext.bind(launched);
  launched.newContext = async (options) => {
    const context = await newContext(options);
    await context.route("**/dashboard/*", (route) => {
      const path = join(FILES, basename(new URL(route.request().url()).pathname));
      // The example's returns stand elsewhere.
      return existsSync(path) ? route.fulfill({ path }) : route.continue();
    });
    await context.route(({ pathname }) => pathname === "/", async (route) => {
      if (route.request().resourceType() !== "document") return route.continue();
      const response = await route.fetch().catch(() => null);
      return response ? route.fulfill({ response, path: join(FILES, "index.html") }) : route.abort();
    });
    await context.route("**/guide/guide.css", (route) => route.fulfill({ path: join(FILES, "../guide/guide.css") }));
    await context.route(/\/docs(\/(page\.css|start\.js))?$/, (route) => {
      const name = basename(new URL(route.request().url()).pathname);
      return route.fulfill({ path: join(FILES, "../../description/documentation", name === "docs" ? "index.html" : name) });
    });
    return context;
  };
  return launched;
}

/** A job once it has ended. */
export async function ended(url, job) {
  for (;;) {
    const now = await call(url, `/jobs/${job}`);
    if (now.finished_ms !== null) return now;
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** The policy of a training, once it is trained. */
export async function trained(url, request) {
  const { job } = await call(url, "/train", request);
  const { state, policy, error } = await ended(url, job);
  if (!policy) throw new Error(`${state}: ${error}`);
  return policy;
}

/** Cancels the jobs that have not ended: one that was asked for on the page for its request alone would keep others waiting. */
export async function cancelJobs(url) {
  const { jobs } = await call(url, "/jobs");
  await Promise.all(jobs.filter(({ finished_ms }) => finished_ms === null).map(({ job }) => fetch(`${url}/jobs/${job}/cancel`, { method: "POST" })));
}

/** The service's answer to a request with a JSON body. */
export async function call(url, path, body) {
  const request = body && {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(body),
  };
  const response = await fetch(url + path, request);
  const answer = await response.json();
  if (!response.ok) throw new Error(`${path}: ${answer.detail}`);
  return answer;
}
