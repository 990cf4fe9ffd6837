// A figure of a report as a picture: node figure.js REPORT.html PICTURE.png "start of its caption"

import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

import { browser } from "./ballast.js";

const [report, picture, caption] = process.argv.slice(2);
const chromium = await browser();
const page = await chromium.newPage({ viewport: { width: 900, height: 700 }, deviceScaleFactor: 1.5 });
// As on paper: without what is there to be pressed.
await page.emulateMedia({ media: "print" });
await page.goto(pathToFileURL(resolve(report)).href);
await page.locator("figure", { hasText: caption }).screenshot({ path: picture });
await chromium.close();
