// The colours of strategies: one each whatever the page, seen against what is behind them, and told apart by dashes too.

import assert from "node:assert/strict";
import { test } from "node:test";
import { browser, service } from "./ballast.js";
import { dashboardModule } from "./modules.js";
import { visit } from "./page.js";

const { colourOf, colourOfLevel, colourOfMix } = await dashboardModule("strategies.js");

/** Strategies that stand on a page together, as reports call them. */
const PAGES = [
  ["adaptive", "static", "plug_in", "known_law", "parametric_adaptive", "parametric_static", "all_bank", "sixty_forty", "all_stock"],
  ["static", "plug_in", "cost_blind", "own_mix", "sixty_forty", "all_stock", "all_bank", "own"],
  ["policy", "robust", "robust_sup", "robust_static", "plug_in", "minimum_variance", "inverse_volatility", "equal_shares", "sixty_equal", "own"],
];

test("every strategy has a colour, no two of a page the same, and the same ones on every page", () => {
  for (const names of PAGES) {
    const colours = names.map(colourOf);
    assert.ok(colours.every((colour) => colour >= 0), `${names} have ${colours}`);
    assert.equal(new Set(colours).size, names.length, `${names} have ${colours}`);
  }
  for (const [one, other] of [["static", "robust_static"], ["all_stock", "equal_shares"]]) assert.equal(colourOf(one), colourOf(other));
  const mixes = Array.from({ length: 11 }, (_, tenth) => colourOfMix(tenth / 10));
  assert.equal(new Set(mixes).size, 11, `${mixes}`);
  assert.deepEqual([mixes[0], mixes[6], mixes[10]], ["all_bank", "sixty_forty", "all_stock"].map(colourOf));
  for (const count of [1, 2, 3]) {
    const levels = Array.from({ length: count }, (_, index) => colourOfLevel(index, count));
    assert.equal(levels[Math.min(1, count - 1)], colourOf("adaptive"));
    assert.equal(new Set([...levels, ...PAGES[1].map(colourOf)]).size, count + PAGES[1].length);
  }
});

test("each stands out from the page, in light and in dark, and lines differ by their dashes", async () => {
  const [ballast, chromium] = await Promise.all([service(), browser()]);
  try {
    const page = await chromium.newPage();
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme });
      await visit(page, `${ballast.url}/`);
      const shown = await page.evaluate(async () => {
        const { h, s } = await import("/dashboard/dom.js");
        const context = h("canvas", { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true });
        const light = (...paints) => {
          for (const [colour, opacity] of paints) {
            context.globalAlpha = opacity;
            context.fillStyle = colour;
            context.fillRect(0, 0, 1, 1);
          }
          const linear = [...context.getImageData(0, 0, 1, 1).data].slice(0, 3).map((byte) => (byte / 255 <= 0.03928 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4));
          return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
        };
        const contrast = (one, other) => (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
        const papers = ["--paper", "--sheet"].map((name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim());
        const drawn = (kind, token, tag) => {
          const element = s(tag, { class: `${kind} s${token}` });
          document.querySelector("main").append(s("svg", {}, element));
          return getComputedStyle(element);
        };
        return Array.from({ length: 20 }, (_, token) => token).filter((token) => token !== 10).map((token) => {
          const [line, bar, dot, range] = [drawn("line", token, "path"), drawn("bar", token, "rect"), drawn("dot", token, "circle"), drawn("range", token, "line")];
          const least = Math.min(...papers.flatMap((paper) => [line.stroke, range.stroke, token === 1 ? dot.stroke : dot.fill].map((colour) => contrast(light([paper, 1], [colour, 1]), light([paper, 1]))).concat(contrast(light([paper, 1], [bar.fill, Number(bar.opacity)]), light([paper, 1])))));
          return { token, least, colour: line.stroke, dash: line.strokeDasharray };
        });
      });
      for (const { token, least } of shown) assert.ok(least >= 3, `s${token} stands out by ${least} in ${colorScheme}`);
      assert.equal(new Set(shown.map(({ colour }) => colour)).size, shown.length);
      assert.equal(new Set(shown.slice(0, 10).map(({ dash }) => dash)).size, 10, shown.map(({ dash }) => dash).join(" | "));
    }
  } finally {
    await chromium.close();
    await ballast.stop();
  }
});
