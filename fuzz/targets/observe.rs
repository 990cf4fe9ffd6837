//! The body of `POST /observe`, on a live session of a real store: refused, or a state that is a state.
#![no_main]

use std::sync::{Arc, LazyLock, Mutex};

use ballast::control::policy::Policy;
use ballast::http::decode;
use ballast::service::Service;
use ballast::service::allowance::{Allowance, HeavyTurn, Limits};
use ballast::service::clock::Clock;
use ballast::service::config::Config;
use ballast::service::observation::Observe;
use ballast::service::shutdown::Shutdown;
use ballast::store::Tenant;
use libfuzzer_sys::fuzz_target;
use tokio::runtime::Runtime;

/// As a call of its own has it.
fn turn() -> Arc<HeavyTurn> {
    Arc::new(HeavyTurn::new(Arc::new(Allowance::new(&Limits::default()))))
}

struct Live {
    runtime: Runtime,
    service: Arc<Service>,
    policy: String,
    /// The session and its coming period.
    session: Mutex<(String, usize)>,
}

static LIVE: LazyLock<Live> = LazyLock::new(|| {
    let runtime = Runtime::new().expect("a runtime");
    let folder = tempfile::tempdir().expect("a folder").keep();
    let document = Policy::from_json(include_bytes!("../corpus/policy/two_steps.json")).expect("a policy");
    let (service, policy) = runtime.block_on(async {
        let service = Service::start(&Config::new(folder), Clock::system(), Shutdown::new()).await.expect("a service");
        let policy = service.policies.import(&Tenant::default(), document).await.expect("imported");
        (service, policy)
    });
    let session = Mutex::new((open(&runtime, &service, &policy), 1));
    Live { runtime, service, policy, session }
});

fn open(runtime: &Runtime, service: &Service, policy: &str) -> String {
    let opened = runtime.block_on(service.sessions.open(&Tenant::default(), policy, None, None));
    opened.expect("a session").row.session.clone()
}

fuzz_target!(|body: &[u8]| {
    let Ok(mut report) = decode::json::<Observe>(body) else { return };
    let live = &*LIVE;
    let mut session = live.session.lock().expect("nothing panicked");
    // Otherwise nearly every report would be of another session.
    (report.session, report.period) = session.clone();
    let observed = live.runtime.block_on(live.service.sessions.observe(&Tenant::default(), report.clone(), &turn()));
    let Ok(observed) = observed else { return };
    assert!(observed.wealth.is_finite() && observed.wealth > 0.0, "{observed:?}");
    assert!((0.0..=1.0).contains(&observed.executed_allocation), "{observed:?}");
    assert!(observed.uncertainty.radius.is_finite() && observed.uncertainty.radius >= 0.0, "{observed:?}");
    let again = live.runtime.block_on(live.service.sessions.observe(&Tenant::default(), report, &turn()));
    assert_eq!(again.expect("told again"), observed);
    *session = match observed.completed {
        true => (open(&live.runtime, &live.service, &live.policy), 1),
        false => (observed.session, observed.period + 1),
    };
});
