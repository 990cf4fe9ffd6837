//! Loops compiled once for each instruction set, of which the processor's best is taken at run time.

/// Moved into a dispatched closure, see [`dispatched`].
pub(crate) struct Once;

/// Runs an expression compiled for the instruction set at hand, through `pulp`.
///
/// A closure that borrows alone would be called through a shim that the compiler is free not to inline, and then its body
/// falls back to the baseline instruction set: a twelfth of the speed, where it fuses. A closure that consumes something
/// has no shim.
macro_rules! dispatched {
    ($body:expr) => {{
        let once = $crate::numerics::dispatch::Once;
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                let _consumed = once;
                $body
            },
        )
    }};
}

pub(crate) use dispatched;
