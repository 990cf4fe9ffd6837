// One colour and one dash for each strategy, on every page: the tokens `.s0` to `.s19` of the stylesheet.

/** The kinds of strategies in reports. Kinds on one line share a colour: they are alike and never appear on one page. */
const TOKENS = [
  ["adaptive", "robust"],
  ["all_stock", "equal_shares"],
  ["all_bank"],
  ["sixty_forty", "sixty_equal"],
  ["static", "robust_static"],
  ["plug_in"],
  ["known_law", "cost_blind", "inverse_volatility"],
  ["parametric_adaptive", "robust_sup", "equal_weights"],
  ["parametric_static", "minimum_variance", "initial_composition"],
  ["own_mix", "policy"],
];

/** Strategies of the user's own have the first colour of the mixes, which are on other pages. */
export const colourOf = (kind) => (kind === "own" ? TOKENS.length + 1 : TOKENS.findIndex((kinds) => kinds.includes(kind)));

/** Constant shares in stocks that have names; the colours of the others lie between those of none and all in stocks. */
const MIXES = { 0: "all_bank", 0.6: "sixty_forty", 1: "all_stock" };
export const colourOfMix = (share) => (share in MIXES ? colourOf(MIXES[share]) : TOKENS.length + Math.min(9, Math.max(1, Math.round(10 * share))));

/** The colours of cautious strategies that learn, by how many confidence levels there are: the main one has the colour that it has alone. */
const LEVELS = { 1: [0], 2: [7, 0], 3: [7, 0, 8] };
export const colourOfLevel = (index, count) => LEVELS[count][index];
