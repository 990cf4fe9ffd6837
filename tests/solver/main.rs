//! The mathematics: every solver, law and surrogate against something independent of it.

use ballast_test_support as support;

mod accuracy;
mod assets;
mod bellman;
mod beyond;
mod calibration;
mod caution;
mod centre;
mod conditional;
mod contributions;
mod control;
mod controlled;
mod costs;
mod declared;
mod declared_accuracy;
mod declared_comparison;
mod declared_policy;
mod declared_walk;
mod design;
mod evaluate;
mod exchangeability;
mod futures;
mod gp;
mod hostile_declarations;
mod learning;
mod means;
mod parametric;
mod sensitivity;
mod streams;
mod surrogate;
mod templates;
mod transport;
mod walk_forward;
