//! Floor 1: nonparametric adaptive robust control (the paper), with one folder for each section.
//!
//! An investor with wealth x has seen returns with empirical law F^. They hold the share a of their wealth in a risky
//! asset through a return z, which is added to the law of the next state. The decision is robust against every law in a
//! set around F^:
//!
//!   V_t(x, F^) = max_a  min_{F in C_t(F^)}  E_F[ V_(t+1)( S(x, a, Z), R(F^, Z) ) ],   V_T the utility of wealth.
//!
//! Folders from the lowest to the highest: `request` (the requests accepted), `problem` (state, dynamics, utility),
//! `uncertainty` (the set C), `assets` (one step with several assets), `surrogate` (the regressions of V and the
//! action), `bellman` (one step), `caution` (the share of the radius that is used), `training` (all of them), `policy`
//! (the document and its advice), `evaluation` (strategies compared).
//!
//! | paper | name | printed as | file | checked by |
//! |---|---|---|---|---|
//! | X, A, S, the loss | `Controlled` | 2 | `control/problem/controlled.rs` | `tests/solver/controlled.rs::the_investor_s_problem_is_solved_alike_by_the_general_solver` |
//! | S | `next` | (2.1) | `control/problem/dynamics.rs` | `src/control/evaluation/account.rs::three_months_agree_with_pencil_and_paper` |
//! | F^, R | `EmpiricalDistribution` | (2.3) | `numerics/law/empirical.rs` | `tests/solver/parametric.rs::the_order_of_returns_and_the_way_they_arrive_change_nothing` |
//! | H | `directional_statistic` | 2.1, after (2.4) | `numerics/bridge.rs` | `src/numerics/bridge.rs::the_statistic_is_the_plain_sum_to_single_precision` |
//! | Q^H(1 - alpha) | `bridge_quantile` | 2.1, after (2.4) | `numerics/bridge.rs` | `tests/solver/control.rs::the_bridge_quantile_agrees_with_a_million_paths` |
//! | radius of C | `RadiusEstimator` | (2.5), (2.7) | `control/uncertainty/radius.rs` | `src/control/uncertainty/radius.rs::every_rule_of_the_sample_size_has_its_formula` |
//! | C | `UncertaintySet` | (2.5) | `control/uncertainty/mod.rs` | `tests/solver/evaluate.rs::a_ball_holds_the_true_law_where_it_is_wide_enough` |
//! | y, G | `next_state` | (2.8) | `control/problem/state.rs` | `tests/service/sessions.rs::a_live_session_equals_the_simulator_bit_for_bit` |
//! | V_T | `utility` | (3.1) | `control/problem/utility.rs` | `src/control/problem/utility.rs::relative_utility_is_an_affine_map_of_the_utility` |
//! | V_t | `BellmanStep` | (3.2) | `control/bellman/mod.rs` | `tests/solver/control.rs::the_last_step_agrees_with_a_direct_solve` |
//! | min over C | `worst_expectation` | (3.3) | `numerics/transport/wasserstein.rs` | `tests/solver/transport.rs::worst_expectation_agrees_with_the_transport_programme` |
//! | V^gamma | `envelope` | (3.4) | `numerics/transport/wasserstein.rs` | `src/numerics/transport/wasserstein.rs::primal_and_dual_meet_on_any_payoff` |
//! | psi* | `WorstCase` | 2.2, (3.2) | `control/policy/worst_case.rs` | `tests/solver/parametric.rs::the_multiplier_is_the_utility_lost_per_unit_of_radius` |
//! | Q^(phi*, psi*) | `World` | 2.2 | `control/policy/futures/mod.rs` | `tests/solver/futures.rs::the_laws_of_another_ball_break_the_identity` |
//! | V_0 under it | `Futures` | 2.3 | `control/policy/futures/report.rs` | `tests/solver/futures.rs::an_investor_is_worth_what_playing_the_worst_laws_brings` |
//! | y^i_t, N | `Design` | 3.1 | `control/surrogate/design.rs` | `tests/solver/control.rs::the_same_seed_gives_the_same_bytes_on_any_number_of_threads_and_through_json` |
//! | y-check | `FeatureSelection` | 3.1 | `control/surrogate/features.rs` | `tests/project/policy_format.rs::another_program_that_follows_the_page_answers_what_the_service_answers` |
//! | k | `weighted_sum` | 3.1 | `numerics/gp/matern.rs` | `src/numerics/gp/matern.rs::the_fast_sum_equals_the_plain_formula` |
//! | V-check | `Surrogate` | 3.1 | `control/surrogate/value_surrogate.rs` | `tests/project/policy_format.rs::another_program_that_follows_the_page_answers_what_the_service_answers` |
//! | phi-check | `policy_target` | 3.1 | `control/surrogate/policy_target.rs` | `src/control/surrogate/policy_target.rs::a_parabola_is_continued_to_its_optimum` |
//! | hyperparameters | `fit` | 3.1 | `numerics/gp/fit.rs` | `tests/solver/gp.rs::a_fit_climbs_to_a_point_where_the_projected_gradient_vanishes` |
//! | steps 1 to 6 | `Training` | 3.1 | `control/training.rs` | `tests/solver/control.rs::whole_horizons_agree_with_nested_grids` |
//! | V-hat_0, N' | `Evaluation` | 3.1 | `control/evaluation/paths.rs` | `tests/solver/evaluate.rs::a_simulated_path_is_the_advisor_s_own` |
//!
//! The interface of the floor, which `store`, `service` and `http` may name (a test reads `src` and checks):
//!
//! - `request`, `error`: a request comes in, and one of its fields may be rejected;
//! - `training`, `progress`, `solved_step`: it is solved step by step, with the progress and the result of each step;
//!   `controlled_training` does so for any controlled problem, and `declared_training` for one declared in formulas;
//!   `controlled_grid` does so for a problem whose states one number describes;
//! - `policy`, `problem`: the document answers in a state;
//! - `posed`, `policy_document`: a problem of either kind, and its policy;
//! - `evaluation`: strategies are compared;
//! - `estimate`, `kept`, `pool`: the cost of work, and the memory and threads that its caller lends.
//!
//! The method itself stays behind this interface: the solution of a step (`bellman`, `uncertainty`, `surrogate`) may
//! change without any change in a higher floor. The crate in `lab` measures the parts of the method one by one, so
//! they are public to it. Everything has one path, the one of its file; only a policy's document is named by its
//! folder.
//!
//! Not from the paper: the floor gain that represents V (`problem::utility`), radius rules other than (2.5) and (2.7),
//! and the parametric frameworks (`bellman::normal`).

pub mod assets;
pub mod bellman;
pub mod cache;
pub mod caution;
pub mod controlled_grid;
pub mod controlled_training;
pub mod declared_training;
pub mod error;
pub mod estimate;
pub mod evaluation;
pub mod policy;
pub mod policy_document;
pub mod pool;
pub mod posed;
pub mod problem;
pub mod progress;
pub mod request;
pub mod sleeve;
pub mod solved_step;
pub mod surrogate;
pub mod training;
pub mod uncertainty;
