// Modules of the dashboard that need no page, for tests without a browser.

import { cp, mkdtemp, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const FOLDER = fileURLToPath(new URL("../../src/http/site/dashboard", import.meta.url));

/** A module by its name. Copied first: beside the sources nothing tells Node that they are ES modules. */
export async function dashboardModule(name) {
  const folder = await mkdtemp(join(tmpdir(), "ballast-modules-"));
  await cp(FOLDER, folder, { recursive: true });
  await writeFile(join(folder, "package.json"), '{"type":"module"}');
  return import(pathToFileURL(join(folder, name)));
}
