//! The body of `POST /observe`, on a live session of a real store: refused, or a state that is a state.
#![no_main]

use std::sync::{Arc, LazyLock, Mutex};

use ballast::control::policy::Policy;
use ballast::http::gate::decode;
use ballast::service::Service;
use ballast::service::callers::allowance::{Allowance, HeavyPermit, Limits};
use ballast::service::entries::answer::Observed;
use ballast::service::process::clock::Clock;
use ballast::service::process::config::Config;
use ballast::service::callers::keys::Caller;
use ballast::store::labels::Relabel;
use ballast::service::entries::report::Observe;
use ballast::service::sessions::SessionStart;
use ballast::service::process::shutdown::Shutdown;
use libfuzzer_sys::fuzz_target;
use tokio::runtime::Runtime;

/// As a call of its own has it.
fn turn() -> Arc<HeavyPermit> {
    Arc::new(HeavyPermit::new(Arc::new(Allowance::new(&Limits::default()))))
}

struct Live {
    runtime: Runtime,
    service: Arc<Service>,
    caller: Arc<Caller>,
    policy: String,
    /// The session and its coming period.
    session: Mutex<(String, usize)>,
}

static LIVE: LazyLock<Live> = LazyLock::new(|| {
    let runtime = Runtime::new().expect("a runtime");
    let folder = tempfile::tempdir().expect("a folder").keep();
    let document = Policy::from_json(include_bytes!("../corpus/policy/two_steps.json")).expect("a policy");
    let (service, caller, policy) = runtime.block_on(async {
        let service = Service::start(&Config::new(folder), Clock::system(), Shutdown::new()).await.expect("a service");
        let Ok(caller) = service.keys.admit(None) else { panic!("a service without keys asks for one") };
        let policy = service.policies.import(&caller, document).await.expect("imported");
        (service, caller, policy)
    });
    let session = Mutex::new((open(&runtime, &service, &caller, &policy), 1));
    Live { runtime, service, caller, policy, session }
});

fn open(runtime: &Runtime, service: &Service, caller: &Caller, policy: &str) -> String {
    let start = SessionStart {
        policy: policy.to_owned(),
        history: None,
        wealth: None,
        holding: None,
        holdings: None,
        renew: None,
        rolling: false,
        labels: Relabel::default(),
    };
    let opened = runtime.block_on(service.sessions.open(caller, start, None));
    opened.expect("a session").row.session.clone()
}

fuzz_target!(|body: &[u8]| {
    let Ok(mut report) = decode::json::<Observe>(body) else { return };
    let live = &*LIVE;
    let mut session = live.session.lock().expect("nothing panicked");
    // Otherwise nearly every report would be of another session.
    (report.session, report.period) = session.clone();
    let observe = |report: &Observe| {
        live.runtime.block_on(live.service.sessions.observe(&live.caller.tenant, report, &turn()))
    };
    let Ok(answer) = observe(&report) else { return };
    let observed: Observed = serde_json::from_str(&answer).expect("an answer as it is stored");
    assert!(observed.wealth.is_finite() && observed.wealth > 0.0, "{observed:?}");
    assert!((0.0..=1.0).contains(&observed.executed_allocation), "{observed:?}");
    assert!(observed.uncertainty.radius.is_finite() && observed.uncertainty.radius >= 0.0, "{observed:?}");
    assert_eq!(observe(&report).expect("told again"), answer);
    *session = match observed.completed {
        true => (open(&live.runtime, &live.service, &live.caller, &live.policy), 1),
        false => (observed.session, observed.period + 1),
    };
});
