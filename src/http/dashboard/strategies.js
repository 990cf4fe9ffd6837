// One colour and one dash for each strategy, on every page: the tokens `.s0` to `.s19` of the stylesheet.

/** By their kinds in reports, and those of several assets beside the one that they are like; two of one line never stand on a page together. */
const TOKENS = [
  ["adaptive", "robust"],
  ["all_stock", "equal_shares"],
  ["all_bank"],
  ["sixty_forty", "sixty_equal"],
  ["static", "robust_static"],
  ["plug_in"],
  ["known_law", "cost_blind", "inverse_volatility"],
  ["parametric_adaptive", "robust_sup"],
  ["parametric_static", "minimum_variance"],
  ["own_mix"],
];

export const colourOf = (kind) => TOKENS.findIndex((kinds) => kinds.includes(kind));

/** Of a constant share in stocks: those that everybody knows have names, and others lie between the first and the last of them. */
const MIXES = { 0: "all_bank", 0.6: "sixty_forty", 1: "all_stock" };
export const colourOfMix = (share) => (share in MIXES ? colourOf(MIXES[share]) : TOKENS.length + Math.min(9, Math.max(1, Math.round(10 * share))));

/** Of cautious ones that learn and differ by their confidence, by how many there are: the one that most is said of is as where it is the only one. */
const LEVELS = { 1: [0], 2: [7, 0], 3: [7, 0, 8] };
export const colourOfLevel = (index, count) => LEVELS[count][index];
