//! Load, kills, races and memory: real processes, several at a time, with time limits.

use ballast_test_support as support;

mod abuse;
mod answers;
mod connections;
mod interruption;
mod lists;
mod memory;
mod process;
mod renewal_scale;
mod replicas;
mod rolling;
