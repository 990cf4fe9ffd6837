//! A comparison of strategies in this process, with its progress on the screen: a bar on a terminal, a line per stage
//! elsewhere.

use std::error::Error;
use std::io::{IsTerminal, stderr};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use ballast::control::error::TrainError;
use ballast::control::evaluation::paths::{Evaluation, Follower, Outcomes};
use ballast::control::evaluation::report::{Costs, EvaluationReport};
use ballast::control::pool::TrainingPool;
use ballast::control::progress::{Phase, StepProgress, Watch};
use indicatif::{ProgressBar, ProgressStyle};

/// Number of positions of the bar.
const TICKS: u64 = 1000;

/// The worker threads, and the screen that shows their progress.
pub struct ComparisonRun {
    pool: TrainingPool,
    stop: AtomicBool,
    bar: Option<ProgressBar>,
    /// The stage last announced if there is no terminal.
    announced: Mutex<String>,
    started: Instant,
}

impl ComparisonRun {
    /// Starts threads on every core, because this process serves no clients.
    ///
    /// # Errors
    /// The system gives no more threads.
    pub fn new() -> Result<Self, ballast::control::pool::PoolError> {
        let bar = stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(TICKS);
            if let Ok(style) = ProgressStyle::with_template("  [{bar:32}] {percent:>3} %  {msg}") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar
        });
        Ok(ComparisonRun {
            pool: TrainingPool::new(std::thread::available_parallelism().map_or(1, usize::from))?,
            stop: AtomicBool::new(false),
            bar,
            announced: Mutex::default(),
            started: Instant::now(),
        })
    }

    pub fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Runs `work` on the threads, showing its progress under `stage`.
    pub fn run<R: Send>(&self, stage: &str, horizon: usize, work: impl FnOnce(&Watch) -> R + Send) -> R {
        let progress = |progress| self.show(stage, horizon, progress);
        self.pool.install(|| work(&Watch { stop: &self.stop, progress: &progress }))
    }

    fn show(&self, stage: &str, horizon: usize, progress: StepProgress) {
        let share = progress.done as f64 / progress.total.max(1) as f64;
        let share = match progress.phase {
            Phase::Simulating => share,
            // Steps are solved from the last to the first.
            Phase::Solving | Phase::Fitting => ((horizon - 1 - progress.step) as f64 + share) / horizon as f64,
        };
        match &self.bar {
            Some(bar) => {
                bar.set_position((share * TICKS as f64) as u64);
                bar.set_message(stage.to_owned());
            }
            None => self.announce(stage),
        }
    }

    fn announce(&self, stage: &str) {
        let Ok(mut announced) = self.announced.lock() else { return };
        if *announced != stage {
            eprintln!("  {:>6.1} s  {stage}", self.seconds());
            stage.clone_into(&mut announced);
        }
    }

    /// Removes the bar from the screen.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// Trains every framework of the comparison that is trained once.
    ///
    /// # Errors
    /// As the trainings.
    pub fn train(&self, evaluation: &Evaluation) -> Result<Vec<Follower>, TrainError> {
        let horizon = evaluation.request.problem.horizon;
        let frameworks = evaluation.request.frameworks.iter();
        let follower = |framework: &ballast::control::request::framework::Framework| {
            let stage = format!("training {}", framework.name());
            self.run(&stage, horizon, |watch| evaluation.follower(*framework, watch))
        };
        frameworks.map(follower).collect()
    }

    /// Simulates a comparison and reports it.
    ///
    /// # Errors
    /// As the trainings of frameworks frozen at a history; a policy has no name.
    pub fn compare(
        &self,
        stage: &str,
        evaluation: &Evaluation,
        followers: &[Follower],
        training_seconds: f64,
    ) -> Result<(Outcomes, EvaluationReport), Box<dyn Error>> {
        let started = Instant::now();
        let clock = || started.elapsed().as_secs_f64();
        let (outcomes, report) = self.run(stage, evaluation.request.problem.horizon, |watch| {
            let outcomes = evaluation.simulate(followers, watch, &clock)?;
            let costs = Costs::new(training_seconds, clock(), &outcomes);
            let report = EvaluationReport::new(evaluation, followers, &outcomes, costs);
            Ok::<_, TrainError>((outcomes, report))
        })?;
        Ok((outcomes, report?))
    }
}
