//! Loops that are compiled once for each instruction set; the best one for the processor is chosen at run time.

/// A value that is moved into a dispatched closure, see [`dispatched`].
pub(crate) struct Once;

/// Runs an expression compiled for the instruction set at hand, through `pulp`.
///
/// A closure that only borrows would be called through a shim, which the compiler may choose not to inline. Its body
/// then falls back to the baseline instruction set, at a twelfth of the speed if it uses fused operations. A closure
/// that consumes a value has no shim.
macro_rules! dispatched {
    ($body:expr) => {{
        let once = $crate::numerics::machine::dispatch::Once;
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
