//! A calibrated radius, in a session and in the simulator.

use crate::support::{App, specification};
use ballast::control::cache::Cache;
use ballast::control::policy::Policy;
use ballast::control::policy::advisor::Advisor;
use ballast::control::request::specification::Specification;
use ballast::control::uncertainty::radius::RadiusEstimator;
use ballast::numerics::law::empirical::EmpiricalDistribution;
use serde_json::json;

#[tokio::test(flavor = "multi_thread")]
async fn a_calibrated_policy_keeps_its_factor_wherever_it_goes() {
    let mut app = App::start().await;
    let mut request = specification(4);
    request["problem"]["radius"] = json!({ "rule": "calibrated", "paths": 200, "scale": 0.3 });
    app.train(&request).await;
    let exported = app.export().await;
    app.open().await;
    let advisor = Advisor::new(Policy::from_json(&exported).unwrap());
    let start = advisor.initial_state(None, None).unwrap();
    request["problem"]["radius"]["rule"] = json!("bridge");
    let problem = serde_json::from_value::<Specification>(request).unwrap().completed().unwrap();
    let bridge = RadiusEstimator::new(&problem, Cache::default());
    let (mut returns, mut factor) = (Vec::new(), None);
    for period in 1..=4 {
        let (_, action) = app.action().await;
        let expected = advisor.walk(start.clone(), &[returns.clone(), vec![0.0]].concat()).last().unwrap();
        assert_eq!(action["allocation"].as_f64(), Some(expected.allocation), "period {period}");
        let radius = action["radius"].as_f64().unwrap();
        assert_eq!(radius, expected.radius);
        // The same at every state, which the bridge knows as well.
        let history: Vec<f64> = problem.problem.history.iter().chain(&returns).copied().collect();
        let found = radius / bridge.radius(&EmpiricalDistribution::new(&history));
        assert!((found / *factor.get_or_insert(found) - 1.0).abs() < 1e-9 && found > 1.0, "{found} {factor:?}");
        returns.push(0.01 * f64::from(period) - 0.02);
        assert_eq!(app.observe(period as usize, *returns.last().unwrap()).await.0, 200);
    }
}
