// Laws of one shape: a sample of returns moved to any mean and stretched to any standard deviation.
//
// A shape moved and stretched keeps the order of its atoms and its standardised moments, so both are found once, however
// many laws are drawn from it; what is left for a law is a search and, for a new standard deviation, one pass.

/** Atoms of mean 0 and variance 1, largest first, with what all laws of this shape have in common. */
export class Shape {
  constructor(atoms) {
    const n = atoms.length;
    this.mean = atoms.reduce((sum, atom) => sum + atom, 0) / n;
    this.deviation = Math.sqrt(atoms.reduce((sum, atom) => sum + (atom - this.mean) ** 2, 0) / n);
    this.atoms = Float64Array.from(atoms, (atom) => (atom - this.mean) / (this.deviation || 1))
      .sort()
      .reverse();
    this.sums = cumulated(this.atoms);
    this.known = new Map();
  }

  /** The mean of the powers of the standardised atoms. */
  moment(order) {
    if (!this.known.has(order)) {
      this.known.set(order, this.atoms.reduce((sum, atom) => sum + atom ** order, 0) / this.atoms.length);
    }
    return this.known.get(order);
  }

  /** The law of this shape with a mean and a standard deviation. */
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
    this.sums = cumulated(growths);
    this.squares = cumulated(growths.map((growth) => growth * growth));
  }
}

function cumulated(values) {
  const sums = new Float64Array(values.length + 1);
  for (let k = 0; k < values.length; k++) sums[k + 1] = sums[k] + values[k];
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

  /** The mean of a power of the atoms, by the binomial theorem. */
  raw(order) {
    let [sum, choose] = [0, 1];
    for (let k = 0; k <= order; k++) {
      sum += choose * this.mean ** (order - k) * this.deviation ** k * (k === 0 ? 1 : this.shape.moment(k));
      choose = (choose * (order - k)) / (k + 1);
    }
    return sum;
  }

  /** Mean and variance of e^Z / (1 + r) under the law of the ball with the least mean: atoms above a cut are moved onto it. */
  worst(radius, rate) {
    const n = this.shape.atoms.length;
    const used = this.moved(radius);
    const cut = this.mean + (this.deviation * this.shape.sums[used] - n * radius) / used;
    const [growth, moved] = [Math.exp(this.mean) / (1 + rate), Math.exp(cut) / (1 + rate)];
    const mean = (growth * this.stretched.sums[n - used] + used * moved) / n;
    const square = (growth * growth * this.stretched.squares[n - used] + used * moved * moved) / n;
    return { mean, variance: Math.max(0, square - mean * mean) };
  }

  /** How many of the largest atoms the cut takes: the fewest whose average, lowered by the radius, is not below the next. */
  moved(radius) {
    const { atoms, sums } = this.shape;
    const n = atoms.length;
    let [low, high] = [1, n];
    while (low < high) {
      const used = (low + high) >> 1;
      const enough = this.deviation * sums[used] - n * radius >= used * this.deviation * atoms[used];
      if (enough) high = used;
      else low = used + 1;
    }
    return low;
  }
}
