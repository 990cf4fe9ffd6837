// One colour and one dash a strategy, on every page: which of the tokens of the stylesheet, `.s0` to `.s19`, is whose.

/** By the names that reports give them, and those of several assets beside the one that they are like; two of one line never stand on a page together. */
const TOKENS = [
  ["adaptive", "robust scaled_one"],
  ["all-stock", "1/N"],
  ["all-bank"],
  ["60/40", "60 % 1/N"],
  ["static", "static scaled_one"],
  ["plug_in", "plug-in"],
  ["known_law", "cost-blind", "inverse volatility"],
  ["parametric_adaptive", "robust sup"],
  ["parametric_static", "minimum variance"],
  ["constant"],
];

export const colourOf = (strategy) => TOKENS.findIndex((names) => names.includes(strategy));

/** Of a constant share in stocks: those that everybody knows have names, and others lie between the first and the last of them. */
const MIXES = { 0: "all-bank", 0.6: "60/40", 1: "all-stock" };
export const colourOfMix = (share) => (share in MIXES ? colourOf(MIXES[share]) : TOKENS.length + Math.min(9, Math.max(1, Math.round(10 * share))));

/** Of cautious ones that learn and differ by their confidence, by how many there are: the one that most is said of is as where it is the only one. */
const LEVELS = { 1: [0], 2: [7, 0], 3: [7, 0, 8] };
export const colourOfLevel = (index, count) => LEVELS[count][index];
