//! How long tests wait, and the promised times that they check. On a busy machine `BALLAST_TEST_PATIENCE` multiplies
//! all of them.

use std::time::{Duration, Instant};

/// The interval between two checks.
const POLL: Duration = Duration::from_millis(10);

/// Returns `usual` times the factor from the environment.
pub fn within(usual: Duration) -> Duration {
    let granted = std::env::var("BALLAST_TEST_PATIENCE").ok();
    usual.mul_f64(granted.map_or(1.0, |factor| factor.parse().expect("BALLAST_TEST_PATIENCE is a factor")))
}

/// Returns the longest time that any wait may take.
pub fn patience() -> Duration {
    within(Duration::from_secs(60))
}

/// Polls `reached` until it returns a value.
pub async fn until<T>(what: &str, mut reached: impl AsyncFnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + patience();
    loop {
        if let Some(reached) = reached().await {
            return reached;
        }
        assert!(Instant::now() < deadline, "still waiting for {what}");
        tokio::time::sleep(POLL).await;
    }
}

/// Asserts that a request sent at `started` took no longer than `promised`.
pub fn assert_within(promised: Duration, started: Instant, what: &str) {
    let elapsed = started.elapsed();
    assert!(elapsed < within(promised), "{what} took {elapsed:?}, but {promised:?} is promised");
}
