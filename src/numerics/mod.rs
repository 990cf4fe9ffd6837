//! Floor 0: mathematics with no investor in it.

pub mod empirical;
