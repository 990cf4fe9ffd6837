//! The growth-optimal shares of the record alone, without a limit on their sum.

/// Steps of the search along one share, and the relative width at which it ends.
const STEPS: usize = 200;
const WIDTH: f64 = 1e-14;
/// Rounds over all shares, and the relative move at which they end.
const ROUNDS: usize = 2000;
const MOVE: f64 = 1e-10;
/// Shares that sum to more than this are unlimited in practice.
const MOST: f64 = 1e4;

/// Returns the shares f of the strategies, each at least 0, of the fastest growth:
///
///   max over f >= 0 of  sum_j p_j ln( bank + sum_i f_i x_ji )
///
/// `excess[i][j]` is x_ji, the simple return of strategy i at date j less the bank's, `masses` are p_j, and `bank` is
/// 1 + r. What exceeds the whole capital is borrowed at the bank's rate. `None` if growth has no maximum, as without a
/// loss against the bank, or if none is found. The maximum along one share after another is the maximum, because the
/// objective is smooth and concave and each share has its own bound. Cost: some Newton steps of O(n) for a share and
/// round; one round for one strategy, some hundreds if strategies are almost equal. Source: Kelly (1956).
/// Checked by: `tests/solver/sleeve.rs::the_kelly_share_of_a_bet_has_its_closed_form` and
/// `several_kelly_shares_meet_the_conditions_of_their_maximum`.
pub fn kelly(excess: &[Vec<f64>], masses: &[f64], bank: f64) -> Option<Vec<f64>> {
    let mut shares = vec![0.0; excess.len()];
    let mut wealth = vec![bank; masses.len()];
    for _ in 0..ROUNDS {
        let mut moved: f64 = 0.0;
        for (share, returns) in shares.iter_mut().zip(excess) {
            let by = best_move(&wealth, returns, masses, -*share)?;
            // A share at its bound is exactly 0.
            *share = if by == -*share { 0.0 } else { *share + by };
            wealth.iter_mut().zip(returns).for_each(|(wealth, x)| *wealth += by * x);
            moved = moved.max(by.abs());
        }
        let total: f64 = shares.iter().sum();
        if total > MOST {
            return None;
        }
        if excess.len() == 1 || moved <= MOVE * (1.0 + total) {
            return Some(shares);
        }
    }
    None
}

/// Returns the move d >= `lowest`, which is at most 0, that maximises `sum p ln(wealth + d x)`; wealth is positive.
/// `None` if more is always better.
fn best_move(wealth: &[f64], returns: &[f64], masses: &[f64], lowest: f64) -> Option<f64> {
    // Wealth stays positive between the two.
    let (mut low, mut high) = (lowest, f64::INFINITY);
    for (wealth, x) in wealth.iter().zip(returns) {
        if *x < 0.0 {
            high = high.min(wealth / -x);
        } else if *x > 0.0 {
            low = low.max(-wealth / x);
        }
    }
    let slopes = |d: f64| {
        let terms = wealth.iter().zip(returns).zip(masses);
        terms.fold((0.0, 0.0), |(slope, bend), ((wealth, x), mass)| {
            let rate = x / (wealth + d * x);
            (slope + mass * rate, bend - mass * rate * rate)
        })
    };
    if low == lowest && slopes(lowest).0 <= 0.0 {
        return Some(lowest);
    }
    if high == f64::INFINITY {
        return None;
    }
    let mut at = 0.0_f64.clamp(low, high);
    for _ in 0..STEPS {
        let (slope, bend) = slopes(at);
        if slope > 0.0 {
            low = at
        } else {
            high = at
        }
        let newton = at - slope / bend;
        let next = if newton > low && newton < high { newton } else { f64::midpoint(low, high) };
        if (next - at).abs() <= WIDTH * next.abs() {
            return Some(next);
        }
        at = next;
    }
    Some(at)
}

/// Returns the growth of the shares a period: e to the mean log of the growth factor, less 1. It is -1 if some date
/// leaves nothing.
pub fn growth(shares: &[f64], excess: &[Vec<f64>], masses: &[f64], bank: f64) -> f64 {
    let log = |(date, mass): (usize, &f64)| {
        let wealth = bank + shares.iter().zip(excess).map(|(share, returns)| share * returns[date]).sum::<f64>();
        mass * wealth.max(0.0).ln()
    };
    masses.iter().enumerate().map(log).sum::<f64>().exp_m1()
}
