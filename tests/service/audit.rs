//! Who did what: over either store, over HTTP and with the real binary.

use std::process::Command;

use crate::support::place::Place;
use crate::support::{App, specification};
use ballast::control::policy::content_hash;
use ballast::store::{Actor, AuditFilter, AuditRow, Inspection, OverQuota, Quota, Quotas, Store, StoreError, Tenant};
use serde_json::{Value, json};

const POLICY: &[u8] = b"{}";

fn tenant(name: &str) -> Tenant {
    name.parse().unwrap()
}

fn by(key: &str, at_ms: i64) -> Actor {
    Actor { key: key.into(), roles: "train".into(), at_ms }
}

async fn deeds(store: &Store) -> Vec<AuditRow> {
    store.deeds(&AuditFilter::default(), 1000, None).await.unwrap()
}

const DAY_MS: i64 = 24 * 60 * 60 * 1000;

/// Imports and deletes a policy, so often, each day.
async fn busy(store: &Store, tenant: &Tenant, times: i64) {
    // One of its own, so that tenants meet nowhere but in the audit.
    let (json, id) = (tenant.as_str().as_bytes(), content_hash(tenant.as_str().as_bytes()));
    for day in 0..times {
        let at_ms = day * DAY_MS;
        let store = store.by(by("key_1", at_ms));
        assert!(store.insert_policy(tenant, &id, json, at_ms).await.unwrap());
        store.delete_policy(tenant, &id).await.unwrap();
    }
}

async fn check(place: &Place) -> Result<(), StoreError> {
    damage(place).await.0
}

/// The outcome of a check, and everything that it names as damaged, in order.
async fn damage(place: &Place) -> (Result<(), StoreError>, Vec<String>) {
    let inspection = match place {
        Place::Folder(folder) => Inspection::of_folder(&folder.path().join("data")).await.unwrap(),
        Place::Database(url) => Inspection::of_database(&url.parse().unwrap()).await.unwrap(),
    };
    let mut named = Vec::new();
    let outcome = inspection.run(&mut |line| named.extend(line.strip_prefix("damaged: ").map(str::to_owned))).await;
    named.sort();
    (outcome, named)
}

async fn a_change_and_its_entry_are_one(place: &Place) {
    let (store, north) = (place.open().await, tenant("north"));
    let id = content_hash(POLICY);
    let acting = store.by(by("key_1", 7));
    assert!(acting.insert_policy(&north, &id, POLICY, 7).await.unwrap());
    // What changes nothing is no entry.
    assert!(!acting.insert_policy(&north, &id, POLICY, 8).await.unwrap());
    acting.delete_policy(&tenant("south"), &id).await.unwrap();
    assert!(!acting.delete_session(&north, "nobody").await.unwrap());
    let [entry] = &deeds(&store).await[..] else { panic!("one entry") };
    assert_eq!((&entry.tenant, entry.key.as_str(), entry.roles.as_str()), (&north, "key_1", "train"));
    assert_eq!((entry.deed.as_str(), &entry.object, entry.at_ms), ("policy.import", &id, 7));
    // Those of one tenant at a time from many sides are one chain still.
    let second = place.second(&store).await;
    let names = ["one", "two", "three"].map(tenant);
    tokio::join!(busy(&store, &names[0], 10), busy(&second, &names[1], 10), busy(&second, &names[2], 10));
    let all = deeds(&store).await;
    assert_eq!(all.len(), 61);
    assert!(all.windows(2).all(|pair| pair[0].sequence > pair[1].sequence), "newest first");
    let of_one = AuditFilter { tenant: Some(names[0].clone()), object: None };
    assert_eq!(store.deeds(&of_one, 1000, None).await.unwrap().len(), 20);
    let page = store.deeds(&of_one, 15, None).await.unwrap();
    assert_eq!(store.deeds(&of_one, 15, Some(page[14].sequence)).await.unwrap().len(), 5);
    let of_policy = AuditFilter { tenant: Some(north), object: Some(id) };
    assert_eq!(store.deeds(&of_policy, 15, None).await.unwrap(), std::slice::from_ref(entry));
    second.close().await;
    store.close().await;
    check(place).await.unwrap();
}

async fn what_was_altered_or_removed_is_found(place: &Place) {
    let (store, north) = (place.open().await, tenant("north"));
    busy(&store, &north, 3).await;
    store.close().await;
    check(place).await.unwrap();
    let numbered = |number: i64| format!("WHERE tenant = 'north' AND number = {number}");
    // An entry put back in the place of another, or without its number, is as bad as one that is gone.
    for (damage, mend) in [
        (format!("UPDATE audit SET outcome = 'nothing' {}", numbered(2)), "UPDATE audit SET outcome = 'deleted'"),
        (format!("UPDATE audit SET access_key = 'key_2' {}", numbered(2)), "UPDATE audit SET access_key = 'key_1'"),
        (format!("UPDATE audit SET at_ms = 99 {}", numbered(2)), "UPDATE audit SET at_ms = 0"),
    ] {
        place.tamper(&damage).await;
        let found = check(place).await.unwrap_err().to_string();
        assert_eq!(found, "entry 2 of key_1 in the audit of north is damaged", "{damage}");
        place.tamper(&format!("{mend} {}", numbered(2))).await;
        check(place).await.unwrap();
    }
    place.tamper(&format!("DELETE FROM audit {}", numbered(6))).await;
    assert_eq!(
        check(place).await.unwrap_err().to_string(),
        "entry 6 of key_1 in the audit of north is damaged",
        "the last"
    );
    // All that is damaged is named, each thing once.
    place.tamper(&format!("DELETE FROM audit {}", numbered(3))).await;
    place.tamper(&format!("UPDATE audit SET object = 'x' {}", numbered(5))).await;
    let (outcome, named) = damage(place).await;
    assert_eq!(named, [3, 5, 6].map(|number| format!("entry {number} of key_1 in the audit of north")));
    let message = "entry 3 of key_1 in the audit of north is damaged, and 2 other things are";
    assert_eq!(outcome.unwrap_err().to_string(), message);
}

/// Each of these computes no hash, and leaves no gap between numbers.
async fn an_audit_that_is_shortened_is_found(place: &Place) {
    let store = place.open().await;
    for name in ["tail", "head", "order"] {
        busy(&store, &tenant(name), 2).await;
    }
    assert!(store.by(by("key_1", 0)).insert_policy(&tenant("all"), &content_hash(POLICY), POLICY, 0).await.unwrap());
    store.close().await;
    check(place).await.unwrap();
    let seal_of = |name: &str, number: i64| {
        format!("(SELECT seal FROM audit WHERE tenant = '{name}' AND number = {number}) WHERE tenant = '{name}'")
    };
    place.tamper("DELETE FROM audit WHERE tenant = 'tail' AND number = 4").await;
    place.tamper(&format!("UPDATE audit_chains SET number = 3, end_seal = {}", seal_of("tail", 3))).await;
    place.tamper(&format!("UPDATE audit_chains SET cut_number = 1, cut_seal = {}", seal_of("head", 1))).await;
    place.tamper("DELETE FROM audit WHERE tenant = 'head' AND number = 1").await;
    place.tamper("DELETE FROM audit WHERE tenant = 'all'").await;
    place.tamper("DELETE FROM audit_chains WHERE tenant = 'all'").await;
    let mut expected = vec![
        "the end of key_1 in the audit of head".to_owned(),
        "the end of key_1 in the audit of tail".to_owned(),
        "the number of chains of the audit".to_owned(),
    ];
    if let Place::Folder(_) = place {
        place.tamper("UPDATE audit SET sequence = 1000 WHERE tenant = 'order' AND number = 2").await;
        expected.insert(0, "entry 3 of key_1 in the audit of order".to_owned());
    }
    assert_eq!(damage(place).await.1, expected);
    place.tamper("UPDATE audit_total SET chains = chains - 1").await;
    assert_eq!(damage(place).await.1, expected, "nor is the number of chains lowered unseen");
    // Going on hides nothing of it.
    let store = place.open().await;
    for name in ["tail", "head", "order"] {
        busy(&store, &tenant(name), 1).await;
    }
    store.close().await;
    assert_eq!(damage(place).await.1, expected);
}

async fn a_cut_chain_is_whole_and_says_that_it_was_cut(place: &Place) {
    let store = place.open().await;
    let (north, south) = (tenant("north"), tenant("south"));
    busy(&store, &north, 10).await;
    busy(&store, &south, 2).await;
    let now_ms = 9 * DAY_MS;
    assert_eq!(store.cut_audit(5 * DAY_MS, now_ms).await.unwrap(), 10 + 3, "the newest of south stays");
    let of = async |tenant: &Tenant| {
        let filter = AuditFilter { tenant: Some(tenant.clone()), object: None };
        store.deeds(&filter, 1000, None).await.unwrap()
    };
    let cut = of(&north).await;
    assert_eq!((cut.len(), cut[0].deed.as_str(), cut[0].object.as_str()), (11, "audit.cut", "entries to 10 of key_1"));
    assert!(cut[0].outcome.starts_with("dropped 10 entries; the last had the seal "), "{}", cut[0].outcome);
    assert_eq!(cut[10].at_ms, 5 * DAY_MS);
    // A cut is no reason for another, and a chain is cut at most once a day.
    for before_ms in [5 * DAY_MS, 5 * DAY_MS + 1, 6 * DAY_MS] {
        assert_eq!(store.cut_audit(before_ms, now_ms).await.unwrap(), 0, "before {before_ms}");
    }
    assert_eq!((of(&north).await.len(), of(&south).await.len()), (11, 2));
    busy(&store, &north, 1).await;
    store.close().await;
    check(place).await.unwrap();
    place.tamper("DELETE FROM audit WHERE tenant = 'north' AND chain = 'key_1' AND number = 18").await;
    assert_eq!(check(place).await.unwrap_err().to_string(), "entry 18 of key_1 in the audit of north is damaged");
}

async fn no_key_drives_out_what_it_did(place: &Place) {
    let (store, north) = (place.open().await, tenant("north"));
    let quotas = Quotas { audit_entries: 6, ..Quotas::default() };
    let (json, id) = (b"north".as_slice(), content_hash(b"north"));
    let one = store.clone().with_quotas(quotas).by(by("key_1", 0));
    let other = store.clone().with_quotas(quotas).by(by("key_2", 0));
    for _ in 0..3 {
        assert!(one.insert_policy(&north, &id, json, 0).await.unwrap());
        one.delete_policy(&north, &id).await.unwrap();
    }
    let refused = one.insert_policy(&north, &id, json, 0).await.unwrap_err();
    let over = OverQuota { quota: Quota::AuditEntries, kept: 6, wanted: 1, limit: 6 };
    assert!(matches!(refused, StoreError::OverQuota(found) if found == over), "{refused}");
    assert_eq!(one.policies(&north, 10, None).await.unwrap(), [], "nothing of it is kept");
    // Another key goes on, what there is may be deleted, and everything done is still to be seen.
    assert!(other.insert_policy(&north, &id, json, 0).await.unwrap());
    one.delete_policy(&north, &id).await.unwrap();
    assert_eq!(store.cut_audit(0, 0).await.unwrap(), 0);
    let all = deeds(&store).await;
    assert_eq!(all.iter().filter(|row| row.key == "key_1").count(), 7);
    assert_eq!(all.last().unwrap().number, 1);
    store.close().await;
    check(place).await.unwrap();
}

on_both_engines!(
    a_change_and_its_entry_are_one,
    what_was_altered_or_removed_is_found,
    an_audit_that_is_shortened_is_found,
    a_cut_chain_is_whole_and_says_that_it_was_cut,
    no_key_drives_out_what_it_did,
);

fn entries(page: &Value) -> Vec<[&str; 4]> {
    page["entries"]
        .as_array()
        .unwrap()
        .iter()
        .map(|entry| ["tenant", "key", "action", "object"].map(|field| entry[field].as_str().unwrap_or("-")))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_change_over_http_names_its_key_and_a_refused_one_is_no_entry() {
    let mut app = App::start().await;
    let (north, south, admin) =
        (app.key("north", "train,operate,read").await, app.key("south", "admin").await, app.key("ops", "admin").await);
    app.enter(&admin).await;
    app.hold(&north);
    app.train(&specification(2)).await;
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    let (session, policy) = (app.session.clone(), app.policy.clone());
    let document: Value = serde_json::from_slice(&app.export().await).unwrap();
    let mut slow = specification(400);
    slow["design"] = json!({ "count": 40 });
    let job = app.queue(&slow).await;
    assert_eq!(app.cancel(&job).await, 202);
    app.until(&job, |job| job["state"] == "cancelled").await;
    assert_eq!(app.delete(&format!("/jobs/{job}")).await, 204);

    // A stranger's calls change nothing, and are not in the way of who looks for what was changed.
    app.enter(&south).await;
    assert_eq!(app.delete(&format!("/sessions/{session}")).await, 404);
    assert_eq!(app.get("/audit").await.0, 200);
    assert_eq!(app.post("/policies/import", &document).await.0, 201);
    assert_eq!(app.delete(&format!("/policies/{policy}")).await, 204);
    app.hold(&north);
    assert_eq!(app.get("/audit").await.0, 403);
    assert_eq!(app.delete(&format!("/policies/{policy}")).await, 409);
    assert_eq!(app.delete(&format!("/sessions/{session}")).await, 204);

    app.hold(&admin);
    let (_, keys) = app.get("/audit?tenant=north&limit=1000").await;
    let by_north: Vec<_> = entries(&keys).into_iter().filter(|entry| entry[2] != "key.create").collect();
    let key = by_north[0][1];
    assert!(key.starts_with("key_") && !north.contains(&key[4..]), "{key}");
    let made: Vec<_> = by_north.iter().map(|entry| (entry[1], entry[2])).collect();
    let deeds = ["session.delete", "job.delete", "job.cancel", "job.queue", "session.open", "job.queue"];
    assert_eq!(made, deeds.map(|deed| (key, deed)));
    let (_, of_session) = app.get(&format!("/audit?object={session}")).await;
    assert_eq!(of_session["entries"][0]["outcome"], "deleted, with 1 entries");
    let (_, of_policy) = app.get(&format!("/audit?object={policy}")).await;
    assert_eq!(
        entries(&of_policy).iter().map(|entry| (entry[0], entry[2])).collect::<Vec<_>>(),
        [("south", "policy.delete"), ("south", "policy.import")]
    );
    let (status, problem) = app.get("/audit?tenant=no%20name").await;
    assert_eq!((status.as_u16(), &problem["field"]), (400, &json!("tenant")));
    let (_, page) = app.get("/audit?limit=2").await;
    let (_, next) = app.get(&format!("/audit?limit=2&after={}", page["next"])).await;
    assert!(entries(&next).len() == 2 && next["entries"] != page["entries"], "{page} {next}");

    let ballast = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
        let output =
            command.args(arguments).arg("--data").arg(app.folder()).env_remove("BALLAST_STORE").output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let shown = ballast(&["audit", "--tenant", "north"]);
    let lines: Vec<&str> = shown.lines().skip(1).collect();
    assert_eq!(lines.len(), keys["entries"].as_array().unwrap().len(), "{shown}");
    assert!(lines[0].contains(key) && lines[0].contains("session.delete"), "{shown}");
    // A copy of it shows later whether an entry is the one it was.
    let newest = &keys["entries"][0];
    let end = format!("\t{}\t{}", newest["number"], newest["seal"].as_str().unwrap());
    assert!(lines[0].ends_with(&end) && newest["seal"].as_str().unwrap().len() == 64, "{shown}");

    // Keys are changed on the command line, beside the service.
    ballast(&["keys", "rotate", key]);
    ballast(&["keys", "revoke", key]);
    let (_, of_key) = app.get(&format!("/audit?object={key}")).await;
    let deeds: Vec<_> = entries(&of_key).iter().map(|entry| (entry[0], entry[2])).collect();
    assert_eq!(deeds, [("north", "key.revoke"), ("north", "key.rotate"), ("north", "key.create")]);
    assert!(ballast(&["check"]).contains("audit: "));
}

/// Who reported what is part of the report.
#[tokio::test(flavor = "multi_thread")]
async fn an_observation_is_shown_with_the_key_that_reported_it() {
    let mut app = App::start().await;
    let key = app.key("north", "admin").await;
    app.enter(&key).await;
    app.train(&specification(2)).await;
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    assert_eq!(app.observe(2, 0.02).await.0, 200);
    let (_, page) = app.get(&format!("/audit?object={}", app.session)).await;
    let deeds: Vec<_> = entries(&page).iter().map(|entry| entry[2]).collect();
    assert_eq!(deeds, ["session.observe", "session.observe", "session.open"]);
    let keys: Vec<_> = entries(&page).iter().map(|entry| entry[1]).collect();
    assert!(keys[0].starts_with("key_") && keys.iter().all(|key| *key == keys[0]), "{page}");
    let folder = app.folder().to_owned();
    app.restart_after("UPDATE entries SET access_key = 'key_of_another' WHERE entry = 1").await;
    app.enter(&key).await;
    assert_eq!(app.action().await.0, 500);
    let inspection = Inspection::of_folder(&folder).await.unwrap();
    assert!(inspection.run(&mut |_| {}).await.unwrap_err().to_string().starts_with("entry 1 of session"));
}

/// A correction is in the audit too, and missed there.
#[tokio::test(flavor = "multi_thread")]
async fn a_correction_that_is_gone_is_missed() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    app.open().await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    let correction = json!({ "correction": 1, "period": 1, "log_return": 0.02, "reason": "a slip" });
    let (status, answer) = app.post(&format!("/sessions/{}/corrections", app.session), &correction).await;
    assert_eq!(status, 200, "{answer}");
    let folder = app.folder().to_owned();
    let check = async || Inspection::of_folder(&folder).await.unwrap().run(&mut |_| {}).await;
    check().await.unwrap();
    app.restart_after("DELETE FROM entries WHERE kind = 'correction'").await;
    let message = check().await.unwrap_err().to_string();
    assert_eq!(message, format!("the end of session {} is damaged", app.session));
}
