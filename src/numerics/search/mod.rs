//! Minimisation and interpolation.

pub mod chebyshev;
pub mod minimise;
pub mod quasi_newton;
