//! How long tests wait, and how soon what they wait for is promised: on a machine that does much else, all of it may take
//! `BALLAST_TEST_PATIENCE` times as long.

use std::time::{Duration, Instant};

/// Between two looks at a level.
const POLL: Duration = Duration::from_millis(10);

/// `usual`, times what the environment grants.
pub fn within(usual: Duration) -> Duration {
    let granted = std::env::var("BALLAST_TEST_PATIENCE").ok();
    usual.mul_f64(granted.map_or(1.0, |factor| factor.parse().expect("BALLAST_TEST_PATIENCE is a factor")))
}

/// Nothing that is waited for takes longer.
pub fn patience() -> Duration {
    within(Duration::from_secs(60))
}

/// Waits for `reached`, a level that is asked for again and again.
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

/// Asserts that what was asked at `asked` took no longer than `promised`.
pub fn assert_within(promised: Duration, asked: Instant, what: &str) {
    let taken = asked.elapsed();
    assert!(taken < within(promised), "{what} took {taken:?}, where {promised:?} is promised");
}
