//! Random stories, each over an empty store of either engine; a failing story is shrunk.

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, TestCaseError, TestRunner};
use tokio::runtime::Runtime;

use super::place::Place;
use super::postgres;

/// Runs `cases` stories, each in a folder of its own.
pub fn over_folders<S: Strategy>(
    cases: u32,
    stories: &S,
    tell: impl AsyncFn(&Place, &S::Value) -> Result<(), TestCaseError>,
) {
    run(&Runtime::new().unwrap(), cases, stories, Place::folder, tell);
}

/// Runs `cases` stories in one database, whose `tables` are emptied before each; none if there is no PostgreSQL.
pub fn over_a_database<S: Strategy>(
    tables: &str,
    cases: u32,
    stories: &S,
    tell: impl AsyncFn(&Place, &S::Value) -> Result<(), TestCaseError>,
) {
    let runtime = Runtime::new().unwrap();
    let Some(url) = runtime.block_on(postgres::database()) else { return };
    let emptied = || {
        runtime.block_on(async {
            let place = Place::Database(url.clone());
            place.open().await.close().await;
            postgres::execute(&url, &format!("TRUNCATE {tables}")).await;
            place
        })
    };
    run(&runtime, cases, stories, emptied, tell);
}

fn run<S: Strategy>(
    runtime: &Runtime,
    cases: u32,
    stories: &S,
    place: impl Fn() -> Place,
    tell: impl AsyncFn(&Place, &S::Value) -> Result<(), TestCaseError>,
) {
    let mut runner = TestRunner::new(Config { cases, failure_persistence: None, ..Config::default() });
    let outcome = runner.run(stories, |story| runtime.block_on(tell(&place(), &story)));
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
}
