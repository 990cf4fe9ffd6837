//! The effect of a report on the state of a session.

use crate::service::entries::record::PeriodNoise;

/// The effect of a report of a period on a state `S`, which it moves as `M` says.
#[derive(Debug, Clone)]
pub struct Transition<S, M> {
    pub seen: PeriodNoise,
    pub moved: M,
    pub standing: S,
}

impl<S, M> Transition<S, M> {
    /// Returns the same effect on other types.
    pub(in crate::service) fn map<T, N>(
        self,
        standing: impl FnOnce(S) -> T,
        moved: impl FnOnce(M) -> N,
    ) -> Transition<T, N> {
        Transition { seen: self.seen, moved: moved(self.moved), standing: standing(self.standing) }
    }
}
