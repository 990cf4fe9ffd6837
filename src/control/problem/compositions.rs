//! The compositions that limits allow: the shares theta of the assets within the risky holdings, with the sum 1.
//!
//!   low_i <= theta_i <= high_i,   least_g <= sum_(i in g) theta_i <= most_g,   sum_i |theta_i - held_i| <= turnover.
//!
//! A turnover counts from the composition that is held, if anything is. Its limit is written with
//! `w_i >= |theta_i - held_i|`. All bounds are linear in (theta, w), so their multiples by a total t >= 0 are the
//! allocations allowed, a cone.

use crate::numerics::search::programme::{LinearBound, ProgrammeSolution, QuadraticProgramme};

/// A composition breaks a limit if it is off by more.
const KEPT: f64 = 5e-10;
/// A smaller share of a vertex is rounding.
const LEAST_SHARE: f64 = 1e-7;
/// A least and a greatest sum that are closer are one number.
const LEAST_WIDTH: f64 = 1e-10;
/// Room that the limit on turnover leaves beyond the least that is needed to keep the other limits.
const LEAST_TURNOVER: f64 = 1e-9;
/// Holdings whose sum is below this have no composition.
const LEAST_TOTAL: f64 = 1e-6;

/// The compositions allowed.
#[derive(Debug, Clone, PartialEq)]
pub struct CompositionSet {
    /// The least and the greatest share of each asset.
    ranges: Vec<[f64; 2]>,
    groups: Vec<GroupRange>,
    turnover: Option<Turnover>,
}

/// The least and the greatest sum of the shares of a group.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupRange {
    /// The assets of the group, ascending.
    pub members: Vec<usize>,
    /// The least sum.
    pub least: f64,
    /// The greatest sum.
    pub most: f64,
}

#[derive(Debug, Clone, PartialEq)]
struct Turnover {
    held: Vec<f64>,
    most: f64,
}

/// The greatest value of a linear function, and a composition that has it.
#[derive(Debug, Clone, PartialEq)]
pub struct GreatestSlope {
    /// At least the greatest value, and that value up to rounding.
    pub bound: f64,
    /// The composition.
    pub composition: Vec<f64>,
}

impl CompositionSet {
    /// Builds the set of these ranges and groups.
    pub fn new(ranges: Vec<[f64; 2]>, groups: Vec<GroupRange>) -> Self {
        CompositionSet { ranges, groups, turnover: None }
    }

    /// Limits the turnover from `holdings`, which are shares of wealth. If no composition is near enough, those that need
    /// the least turnover are allowed. If nothing is held, so is every composition of the set.
    #[must_use]
    pub fn within_turnover(self, holdings: &[f64], most: f64) -> Self {
        let total: f64 = holdings.iter().sum();
        if total < LEAST_TOTAL {
            return self;
        }
        let held: Vec<f64> = holdings.iter().map(|share| share / total).collect();
        let free = CompositionSet { turnover: Some(Turnover { held: held.clone(), most: 2.0 }), ..self };
        let size = free.ranges.len();
        let linear = (0..2 * size).map(|index| if index < size { 0.0 } else { 1.0 }).collect();
        let (_, solution) = free.solve(Vec::new(), linear);
        let needed: f64 = solution.point[..size].iter().zip(&held).map(|(share, held)| (share - held).abs()).sum();
        let needed = if needed < LEAST_TURNOVER { 0.0 } else { needed };
        let most = if needed > most { needed + LEAST_TURNOVER } else { most };
        CompositionSet { turnover: Some(Turnover { held, most }), ..free }
    }

    /// Returns the number of assets.
    pub fn assets(&self) -> usize {
        self.ranges.len()
    }

    /// Returns true if an asset is in every composition, or in the one held.
    fn needs(&self, asset: usize) -> bool {
        self.ranges[asset][0] > 0.0 || self.turnover.as_ref().is_some_and(|turnover| turnover.held[asset] > 0.0)
    }

    /// Restricts the set to compositions of some assets, which include those needed.
    #[must_use]
    pub fn among(&self, assets: &[usize]) -> Self {
        let members = |group: &GroupRange| {
            (0..assets.len()).filter(|place| group.members.binary_search(&assets[*place]).is_ok()).collect()
        };
        let group = |group: &GroupRange| GroupRange { members: members(group), ..*group };
        CompositionSet {
            ranges: assets.iter().map(|&asset| self.ranges[asset]).collect(),
            groups: self.groups.iter().map(group).collect(),
            turnover: self.turnover.as_ref().map(|turnover| Turnover {
                held: assets.iter().map(|&asset| turnover.held[asset]).collect(),
                most: turnover.most,
            }),
        }
    }

    /// Returns the bounds of (theta, w), the least and the greatest sum of each asset and group first, w being there with a limit on turnover alone. `given_way` is added to every
    /// limit that the user set.
    fn bounds(&self, given_way: f64) -> Vec<LinearBound> {
        let size = self.ranges.len();
        let sum = |members: &[usize], sign: f64| members.iter().map(|&index| (index, sign)).collect();
        let mut bounds = Vec::new();
        for (index, [low, high]) in self.ranges.iter().enumerate() {
            let way = if *low > 0.0 { given_way } else { 0.0 };
            bounds.push(LinearBound { terms: vec![(index, -1.0)], limit: way - low });
            bounds.push(LinearBound { terms: vec![(index, 1.0)], limit: high + given_way });
        }
        for GroupRange { members, least, most } in &self.groups {
            bounds.push(LinearBound { terms: sum(members, -1.0), limit: given_way - least });
            bounds.push(LinearBound { terms: sum(members, 1.0), limit: most + given_way });
        }
        if let Some(Turnover { held, most }) = &self.turnover {
            for (index, held) in held.iter().enumerate() {
                for sign in [1.0, -1.0] {
                    let terms = vec![(index, sign), (size + index, -1.0)];
                    bounds.push(LinearBound { terms, limit: sign * held });
                }
            }
            let moved: Vec<usize> = (size..2 * size).collect();
            bounds.push(LinearBound { terms: sum(&moved, 1.0), limit: most + given_way });
        }
        bounds
    }

    /// Returns the number of unknowns w: one for each asset if turnover is limited.
    pub fn moves(&self) -> usize {
        self.turnover.as_ref().map_or(0, |turnover| turnover.held.len())
    }

    /// Returns the bounds of the allocations `t theta` and the moves `t w` as directions whose scalar product with them
    /// is at least 0: first the entries of the shares, then those of the moves. Bounds that follow from shares of at
    /// least 0 are left out. Every limit gives way by `given_way`, so the cone has an interior.
    pub fn cone(&self, given_way: f64) -> Vec<Vec<f64>> {
        let size = self.ranges.len();
        let direction = |bound: LinearBound| {
            let mut direction = vec![bound.limit; size];
            direction.resize(size + self.moves(), 0.0);
            bound.terms.iter().for_each(|(index, coefficient)| direction[*index] -= coefficient);
            direction
        };
        let is_needed = |bound: &LinearBound| match bound.terms.last() {
            Some((index, _)) if *index >= size => true,
            Some((_, coefficient)) if *coefficient < 0.0 => bound.limit < 0.0,
            Some(_) => bound.limit < 1.0,
            None => false,
        };
        self.bounds(given_way).into_iter().filter(is_needed).map(direction).collect()
    }

    /// Returns the moves w of an allocation, with what the turnover leaves spread evenly, `given_way` included.
    pub fn moves_of(&self, shares: &[f64], given_way: f64) -> Vec<f64> {
        let Some(Turnover { held, most }) = &self.turnover else { return Vec::new() };
        let total: f64 = shares.iter().sum();
        let moved: Vec<f64> = shares.iter().zip(held).map(|(share, held)| (share - total * held).abs()).collect();
        let room = total * (most + given_way) - moved.iter().sum::<f64>();
        moved.iter().map(|moved| moved + 0.5 * room / held.len() as f64).collect()
    }

    /// Returns by how much a composition is beyond the limit that it breaks most; at most 0 if it keeps all.
    pub fn excess(&self, composition: &[f64]) -> f64 {
        let mut unknowns = composition.to_vec();
        if let Some(Turnover { held, .. }) = &self.turnover {
            unknowns.extend(composition.iter().zip(held).map(|(share, held)| (share - held).abs()));
        }
        self.bounds(0.0).iter().map(|bound| bound.at(&unknowns) - bound.limit).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns true if a composition keeps the limits, up to rounding.
    pub fn keeps(&self, composition: &[f64]) -> bool {
        self.excess(composition) <= KEPT
    }

    /// Returns the composition itself if it keeps the limits, and otherwise the nearest one that does, by the sum of
    /// squared differences.
    pub fn nearest(&self, composition: Vec<f64>) -> Vec<f64> {
        if self.keeps(&composition) {
            return composition;
        }
        let size = composition.len();
        let unit =
            |index: usize| (0..size).map(move |other| if other == index { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
        let identity: Vec<Vec<f64>> = (0..size).map(unit).collect();
        self.least_quadratic(&identity, composition.iter().map(|share| -share).collect())
    }

    /// Returns the composition of least variance. `covariance` is symmetric and positive semidefinite.
    pub fn least_variance(&self, covariance: &[Vec<f64>]) -> Vec<f64> {
        self.least_quadratic(covariance, vec![0.0; covariance.len()])
    }

    fn least_quadratic(&self, quadratic: &[Vec<f64>], mut linear: Vec<f64>) -> Vec<f64> {
        let (size, whole) = (quadratic.len(), quadratic.len() + self.moves());
        let mut matrix = vec![0.0; whole * whole];
        for (row, of) in matrix.chunks_exact_mut(whole).zip(quadratic) {
            row[..size].copy_from_slice(of);
        }
        linear.resize(whole, 0.0);
        let (_, solution) = self.solve(matrix, linear);
        self.composition(solution)
    }

    /// Returns the greatest value of `slopes . theta`, and the composition theta that reaches it.
    pub fn greatest(&self, slopes: &[f64]) -> GreatestSlope {
        let mut linear: Vec<f64> = slopes.iter().map(|slope| -slope).collect();
        linear.resize(slopes.len() + self.moves(), 0.0);
        let intervals = vec![[0.0, 1.0]; slopes.len()].into_iter().chain(vec![[0.0, 2.0]; self.moves()]);
        let (programme, solution) = self.solve(Vec::new(), linear);
        let bound = -programme.least(&solution, &intervals.collect::<Vec<_>>());
        GreatestSlope { bound, composition: self.composition(solution) }
    }

    /// Returns the least and the greatest sum of these assets' shares.
    pub fn range_of(&self, members: &[usize]) -> [f64; 2] {
        let slopes = |sign: f64| -> Vec<f64> {
            (0..self.assets()).map(|asset| if members.contains(&asset) { sign } else { 0.0 }).collect()
        };
        [-self.greatest(&slopes(-1.0)).bound, self.greatest(&slopes(1.0)).bound]
    }

    /// Returns a composition well inside the limits: near the analytic centre, at which the search for no objective ends.
    pub fn centre(&self) -> Vec<f64> {
        let (_, solution) = self.solve(Vec::new(), vec![0.0; self.assets() + self.moves()]);
        self.composition(solution)
    }

    /// Returns `assets` with those that are needed and those of the composition of the greatest `slopes`, ascending. So
    /// there is a composition among them.
    pub fn supporting(&self, mut assets: Vec<usize>, slopes: &[f64]) -> Vec<usize> {
        assets.extend((0..self.assets()).filter(|asset| self.needs(*asset)));
        assets.extend(Self::support(&self.greatest(slopes).composition));
        assets.sort_unstable();
        assets.dedup();
        assets
    }

    /// Returns the assets that a vertex holds.
    pub fn support(composition: &[f64]) -> Vec<usize> {
        (0..composition.len()).filter(|asset| composition[*asset] > LEAST_SHARE).collect()
    }

    fn solve(&self, quadratic: Vec<f64>, linear: Vec<f64>) -> (QuadraticProgramme, ProgrammeSolution) {
        let mut equations =
            vec![LinearBound { terms: (0..self.assets()).map(|asset| (asset, 1.0)).collect(), limit: 1.0 }];
        let (mut bounds, mut rest) = (Vec::new(), self.bounds(0.0).into_iter());
        for _ in 0..self.assets() + self.groups.len() {
            let (Some(least), Some(most)) = (rest.next(), rest.next()) else { break };
            let is_one = least.limit + most.limit < LEAST_WIDTH;
            if is_one {
                equations.push(most.clone());
            }
            // Beside an equation they are wide: the search needs bounds of every unknown, and an interior.
            let wider = if is_one { 1.0 } else { 0.0 };
            bounds
                .extend([least, most].map(|LinearBound { terms, limit }| LinearBound { terms, limit: limit + wider }));
        }
        bounds.extend(rest);
        let programme = QuadraticProgramme { quadratic, linear, bounds, equations };
        let solution = programme.solve();
        (programme, solution)
    }

    fn composition(&self, solution: ProgrammeSolution) -> Vec<f64> {
        let mut composition = solution.point;
        composition.truncate(self.assets());
        composition.iter_mut().for_each(|share| *share = share.max(0.0));
        composition
    }
}
