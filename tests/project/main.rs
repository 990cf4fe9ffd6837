//! The documents of the project, those built into it, and the texts that it prints.

use ballast_test_support as support;

mod advise_file;
mod architecture;
mod dashboard;
mod demo;
mod dependencies;
mod docs;
mod guide;
mod monitoring;
mod openapi;
mod paper_map;
mod policy_format;
mod solve_file;
mod threat_model;
mod upgrade;
