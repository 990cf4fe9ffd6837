//! Compares the reports of a list: sessions with one policy see the same returns, so most reports of one day agree.
//!
//! A report that differs from most of its peers is doubted, even if its return fits the record. Sessions with one
//! policy may follow different returns; if no return has a majority, nothing is doubted.

use std::collections::HashMap;

use futures_util::{StreamExt, stream};
use jiff::civil::Date;

use crate::control::problem::state::LEAST_LEARNED;
use crate::service::callers::keys::Caller;
use crate::service::entries::doubts::{Doubt, DoubtReason, ROUNDING};
use crate::service::entries::report::{Observe, Report};
use crate::service::sessions::Sessions;

/// The fewest reports that must agree before another is doubted.
const FEWEST: usize = 2;
/// Sessions read concurrently.
const AT_A_TIME: usize = 128;

/// The return of a report, with the field that gave it.
struct ReportedReturn {
    report: usize,
    field: String,
    value: f64,
    log_return: f64,
}

/// Key of a group of reports: policy, day and index of the asset.
type Group = (String, Option<Date>, usize);

impl Sessions {
    /// Returns the doubts about each report that its peers in the list raise.
    pub(in crate::service) async fn peer_doubts(&self, caller: &Caller, reports: &[Observe]) -> Vec<Vec<Doubt>> {
        let mut doubts: Vec<Vec<Doubt>> = reports.iter().map(|_| Vec::new()).collect();
        if reports.windows(2).all(|pair| said_of(&pair[0]) == said_of(&pair[1])) {
            return doubts;
        }
        let mut groups: HashMap<Group, Vec<ReportedReturn>> = HashMap::new();
        let read = stream::iter(0..reports.len())
            .map(|index| async move { (index, self.returns(caller, &reports[index]).await) });
        let mut read = std::pin::pin!(read.buffer_unordered(AT_A_TIME));
        while let Some((report, returns)) = read.next().await {
            for (group, (field, value), log_return) in returns.unwrap_or_default() {
                groups.entry(group).or_default().push(ReportedReturn { report, field, value, log_return });
            }
        }
        for (index, doubt) in groups.into_values().flat_map(different) {
            doubts[index].push(doubt);
        }
        doubts
    }

    /// Returns the returns of a report, each with its group and how it was given; `None` if there is nothing to
    /// compare.
    async fn returns(&self, caller: &Caller, observe: &Observe) -> Option<Vec<(Group, (String, f64), f64)>> {
        let (tenant, report) = (&caller.tenant, observe.report());
        let mut held = self.hold(tenant, &observe.session).await;
        let live = held.current(&self.rows(tenant, &observe.session)).await.ok()?;
        let is_coming = observe.period == live.observed + 1;
        let day = report.date.or_else(|| live.next_day().filter(|_| is_coming));
        let group = |asset| (live.current.policy.clone(), day, asset);
        // A period that is already recorded is read as given, whatever was reported since.
        let account = live.standing.account().ok()?;
        match &account.assets {
            None => {
                let log_return = report.log_return(account.price.filter(|_| is_coming)).ok()??;
                let (field, value) = report.given();
                Some(vec![(group(0), (field.to_owned(), value), log_return.max(LEAST_LEARNED))])
            }
            Some(assets) => {
                let seen = assets.read(&report).ok()?;
                let of_asset = |(asset, log_return): (usize, &Option<f64>)| {
                    let (field, value) = report.given_of(&assets.names[asset]);
                    let log_return = (*log_return)?.max(LEAST_LEARNED);
                    Some((group(asset), (field, value.unwrap_or(log_return)), log_return))
                };
                Some(seen.values.iter().enumerate().filter_map(of_asset).collect())
            }
        }
    }
}

/// Returns the parts of a report that concern its return and day.
fn said_of(observe: &Observe) -> Report {
    let all = observe.report();
    let of_wealth = Report { rate: None, flow: None, spent: None, wealth: None, ..all };
    Report { executed_allocation: None, executed_allocations: None, ..of_wealth }
}

/// Returns the reports of a group that differ from most, each with the doubt about it.
fn different(mut returns: Vec<ReportedReturn>) -> Vec<(usize, Doubt)> {
    returns.sort_unstable_by(|one, other| one.log_return.total_cmp(&other.log_return));
    let alike = |from: usize| {
        let near = returns[from..].iter().take_while(|one| one.log_return - returns[from].log_return <= ROUNDING);
        (near.count(), from)
    };
    let Some((count, from)) = (0..returns.len()).map(alike).max_by_key(|(count, from)| (*count, usize::MAX - from))
    else {
        return Vec::new();
    };
    if count < FEWEST || 2 * count <= returns.len() {
        return Vec::new();
    }
    let theirs = returns[from + count / 2].log_return;
    let all = returns.len();
    let others = returns.into_iter().filter(|one| (one.log_return - theirs).abs() > ROUNDING);
    let doubt = |one: ReportedReturn| {
        let [own, theirs] = [one.log_return, theirs].map(|log_return| 100.0 * log_return.exp_m1());
        let sentence = format!(
            "{count} of the {all} reports for this policy and day give {theirs:.2} %, but this one gives {own:.2} %"
        );
        (one.report, Doubt::new(DoubtReason::DiffersFromPeers, one.field, one.value, sentence))
    };
    others.map(doubt).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn different_of(values: &[f64]) -> Vec<usize> {
        let one = |(report, simple_return): (usize, &f64)| ReportedReturn {
            report,
            field: "simple_return".into(),
            value: *simple_return,
            log_return: simple_return.ln_1p(),
        };
        let mut found: Vec<_> =
            different(values.iter().enumerate().map(one).collect()).into_iter().map(|(i, _)| i).collect();
        found.sort_unstable();
        found
    }

    #[test]
    fn what_most_do_not_say_is_doubted() {
        assert_eq!(different_of(&[0.0213, 0.213, 0.0213, 0.0213]), [1]);
        assert_eq!(different_of(&[0.0167, 0.0167, 0.167]), [2]);
        // Rounded to different numbers of digits.
        assert_eq!(different_of(&[0.0167, 0.01672, 0.01668]), [] as [usize; 0]);
        // Nobody knows which of two is right. If all differ, the sessions may not follow one return.
        assert_eq!(different_of(&[0.0213, 0.213]), [] as [usize; 0]);
        assert_eq!(different_of(&[0.01, 0.02, 0.03, 0.04]), [] as [usize; 0]);
        assert_eq!(different_of(&[0.01, 0.01, 0.03, 0.03]), [] as [usize; 0]);
    }
}
