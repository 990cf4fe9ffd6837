//! Minimisation and interpolation, and programmes with linear bounds.

pub mod chebyshev;
pub mod minimise;
pub mod programme;
pub mod quasi_newton;
