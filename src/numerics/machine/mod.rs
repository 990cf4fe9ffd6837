//! Tools that concern the processor and not mathematics: vector loops, random streams, digits, interruption.

pub mod digits;
pub(crate) mod dispatch;
pub mod elementary;
pub mod interruption;
pub mod streams;
