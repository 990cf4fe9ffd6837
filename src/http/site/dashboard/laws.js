// Laws of one shape: a weighted sample of returns, shifted to any mean and scaled to any standard deviation.
//
// A shifted and scaled shape keeps the order of its atoms and its standardised moments, so both are computed once for
// all laws drawn from it. Each law then needs a search and, for a new standard deviation, one pass.

/** Returns the share of a return's weight that is left one return later. */
export const retention = (learning) => (learning.kind === "decay" ? 0.5 ** (1 / learning.half_life) : 1);

/** Returns the effective sample size of `count` returns. */
export function effectiveSize(learning, count) {
  if (learning.kind !== "decay") return count;
  const half = Math.LN2 / (2 * learning.half_life);
  return Math.tanh(count * half) / Math.tanh(half);
}

/** Returns the share that `count` returns seen have in the centre of the ball. */
export const shareSeen = ({ kind, weight } = {}, count) => (kind === "mixed" ? count / (count + weight) : 1);

/** Atoms of mean 0 and variance 1, largest first, with the sums that all laws of this shape share. The returns are given oldest first. */
export class Shape {
  constructor(returns, kept = 1) {
    const weighted = returns.map((atom, index) => ({ atom, weight: kept ** (returns.length - 1 - index) }));
    const total = weighted.reduce((sum, { weight }) => sum + weight, 0);
    const average = (of) => weighted.reduce((sum, { atom, weight }) => sum + weight * of(atom), 0) / total;
    this.mean = average((atom) => atom);
    this.deviation = Math.sqrt(average((atom) => (atom - this.mean) ** 2));
    weighted.sort((left, right) => right.atom - left.atom);
    this.atoms = Float64Array.from(weighted, ({ atom }) => (atom - this.mean) / (this.deviation || 1));
    this.masses = Float64Array.from(weighted, ({ weight }) => weight / total);
    this.above = cumulated(this.masses);
    this.sums = cumulated(this.atoms, this.masses);
    this.known = new Map();
  }

  /** Returns the mean of a power of the standardised atoms. */
  moment(order) {
    if (!this.known.has(order)) {
      this.known.set(
        order,
        this.atoms.reduce((sum, atom, index) => sum + this.masses[index] * atom ** order, 0),
      );
    }
    return this.known.get(order);
  }

  /** Returns the law of this shape with a mean and a standard deviation. */
  law(mean = this.mean, deviation = this.deviation) {
    if (this.stretched?.deviation !== deviation) this.stretched = new Stretched(this, deviation);
    return new Law(this, this.stretched, mean);
  }
}

/** A shape at one standard deviation: sums of its growths and of their squares, from the smallest up. */
class Stretched {
  constructor(shape, deviation) {
    this.deviation = deviation;
    const growths = shape.atoms.map((atom) => Math.exp(deviation * atom)).reverse();
    const masses = shape.masses.toReversed();
    this.sums = cumulated(growths, masses);
    this.squares = cumulated(
      growths.map((growth) => growth * growth),
      masses,
    );
  }
}

function cumulated(values, masses) {
  const sums = new Float64Array(values.length + 1);
  for (let k = 0; k < values.length; k++) sums[k + 1] = sums[k] + values[k] * (masses?.[k] ?? 1);
  return sums;
}

class Law {
  constructor(shape, stretched, mean) {
    Object.assign(this, { shape, stretched, mean, deviation: stretched.deviation });
  }

  get variance() {
    return this.deviation ** 2;
  }

  standardised(order) {
    return this.shape.moment(order);
  }

  /** Returns the mean of a power of the atoms, by the binomial theorem. */
  raw(order) {
    let [sum, choose] = [0, 1];
    for (let k = 0; k <= order; k++) {
      sum += choose * this.mean ** (order - k) * this.deviation ** k * (k === 0 ? 1 : this.shape.moment(k));
      choose = (choose * (order - k)) / (k + 1);
    }
    return sum;
  }

  /** Returns the mean and variance of e^Z / (1 + r) under the law of the ball with the least mean: atoms above a cut are moved onto it. */
  worst(radius, rate) {
    const n = this.shape.atoms.length;
    const used = this.moved(radius);
    const mass = this.shape.above[used];
    const cut = this.mean + (this.deviation * this.shape.sums[used] - radius) / mass;
    const [growth, moved] = [Math.exp(this.mean) / (1 + rate), Math.exp(cut) / (1 + rate)];
    const mean = growth * this.stretched.sums[n - used] + mass * moved;
    const square = growth * growth * this.stretched.squares[n - used] + mass * moved * moved;
    return { mean, variance: Math.max(0, square - mean * mean) };
  }

  /** Returns how many of the largest atoms are cut: the fewest whose average, lowered by the radius, is not below the next. */
  moved(radius) {
    const { atoms, above, sums } = this.shape;
    const n = atoms.length;
    let [low, high] = [1, n];
    while (low < high) {
      const used = (low + high) >> 1;
      const enough = this.deviation * sums[used] - radius >= above[used] * this.deviation * atoms[used];
      if (enough) high = used;
      else low = used + 1;
    }
    return low;
  }
}
