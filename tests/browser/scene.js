// A service, a browser and a page of it for the tests of one file, there from its first line on and closed after its last test.

import { after } from "node:test";
import { browser, service } from "./ballast.js";

export const [ballast, chromium] = await Promise.all([service(), browser()]);
export const page = await chromium.newPage({ viewport: { width: 1280, height: 900 } });
page.setDefaultTimeout(20_000);

after(async () => {
  await chromium.close();
  await ballast.stop();
});
