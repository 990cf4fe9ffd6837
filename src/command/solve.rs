//! `ballast solve`: the first advice of a problem declared in formulas. No server runs.

use std::error::Error;
use std::fs;
use std::path::PathBuf;

use ballast::control::cache::Cache;
use ballast::control::declared_training::DeclaredTraining;
use ballast::control::policy::declared::{Decided, NoiseMove};
use ballast::control::problem::actions::FINE_ACTIONS;
use ballast::control::progress::{StepProgress, Watch};
use ballast::control::request::completion::DEFAULT_COUNT;
use ballast::control::request::declared::DeclaredSpecification;
use clap::Args;

use super::progress::Parts;

/// Moves of the worst law that are shown.
const SHOWN: usize = 8;

#[derive(Debug, Clone, Args)]
pub struct SolveArgs {
    /// JSON file of the declaration; docs/declared.md describes it
    problem: PathBuf,
    /// Print the advice as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &SolveArgs) -> Result<(), Box<dyn Error>> {
    let file = arguments.problem.display();
    let text = fs::read_to_string(&arguments.problem).map_err(|error| format!("{file}: {error}"))?;
    let declared: DeclaredSpecification = serde_json::from_str(&text).map_err(|error| format!("{file}: {error}"))?;
    for warning in DeclaredTraining::with(&declared, Cache::default())?.warnings() {
        eprintln!("warning: {}", warning.message);
    }
    let steps = declared.problem.horizon.saturating_sub(1);
    let of_step = declared.design.count.unwrap_or(DEFAULT_COUNT);
    let states = Parts::new(steps.saturating_mul(of_step), "states");
    // The steps are solved from the last to the second.
    let progress = |at: StepProgress| states.reached(steps.saturating_sub(at.step) * of_step + at.done);
    let decided = Decided::first(&declared, &Watch { progress: &progress, ..Watch::unwatched() });
    states.finish();
    let first = decided?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&first)?);
    } else {
        print!("{}", describe(&declared, &first));
    }
    Ok(())
}

fn describe(declared: &DeclaredSpecification, first: &Decided) -> String {
    let problem = &declared.problem;
    let noise = &problem.noise.name;
    let mut lines: Vec<String> =
        first.actions.iter().map(|(name, value)| format!("{name}: {}", number(*value))).collect();
    let about = match first.value_error {
        Some(error) if error > 0.0 => {
            let digits = 10_f64.powi(1 - error.log10().floor() as i32);
            format!(", to about {} in the root mean square", (error * digits).round() / digits)
        }
        _ => String::new(),
    };
    lines.push(format!("worth over {} periods: {}{about}", problem.horizon, number(first.value)));
    lines.push(match first.radius > 0.0 {
        true => format!(
            "against every law of {noise} within {} of the {} seen",
            number(first.radius),
            problem.history.len()
        ),
        false => format!("under the law of the {} seen", problem.history.len()),
    });
    if !first.several_peaks.is_empty() {
        let named = first.several_peaks.join(" and ");
        let tried = FINE_ACTIONS + 1;
        lines.push(format!("the worth has several peaks along {named}: {tried} even values were tried first"));
    }
    if first.untrained_share > 0.0 {
        let share = 100.0 * first.untrained_share;
        lines.push(format!(
            "{share:.0} % of the outcomes lie beyond the states that were solved: their worth is a guess"
        ));
    }
    let mut moved: Vec<&NoiseMove> = first.worst_law.iter().filter(|moved| moved.from != moved.to).collect();
    moved.sort_by(|left, right| right.share.total_cmp(&left.share));
    if !moved.is_empty() {
        lines.push(format!("the worst law of the first {noise} moves"));
        let shown = |moved: &&&NoiseMove| {
            format!("  {:>5.1} %  from {} to {}", 100.0 * moved.share, number(moved.from), number(moved.to))
        };
        lines.extend(moved.iter().take(SHOWN).map(|moved| shown(&moved)));
        if moved.len() > SHOWN {
            lines.push(format!("  and {} smaller parts", moved.len() - SHOWN));
        }
    }
    lines.join("\n") + "\n"
}

/// Shows six digits, and no zeros at their end.
fn number(value: f64) -> String {
    let whole = value.abs().max(1.0).log10().floor() as usize;
    let scale = 10_f64.powi(5_usize.saturating_sub(whole) as i32);
    // No zero has a sign.
    ((value * scale).round() / scale + 0.0).to_string()
}
