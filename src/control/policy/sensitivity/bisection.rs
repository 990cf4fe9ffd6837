//! Bisections of an interval and of a count.

/// Resolution of reported returns and shifts, in log-return.
const RESOLUTION: f64 = 1e-6;

/// Returns the least count, of at most `most`, that is enough, if 0 is not; `None` if `most` is not enough. A smaller one
/// does not count if a larger one between is not enough.
pub fn least_count(most: usize, is_enough: impl Fn(usize) -> bool) -> Option<usize> {
    if !is_enough(most) {
        return None;
    }
    let (mut too_few, mut enough) = (0, most);
    while enough - too_few > 1 {
        let between = usize::midpoint(too_few, enough);
        if is_enough(between) { enough = between } else { too_few = between }
    }
    Some(enough)
}

/// Bisects an interval, of which only the upper end is above, down to the resolution; the result has the same property.
pub fn parted([mut below, mut above]: [f64; 2], is_above: impl Fn(f64) -> bool) -> [f64; 2] {
    while above - below > RESOLUTION {
        let between = f64::midpoint(below, above);
        if is_above(between) { above = between } else { below = between }
    }
    [below, above]
}
