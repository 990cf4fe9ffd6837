//! Connections are encrypted, and each side knows whom it speaks to.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use crate::support::certificates::{Authority, Certificate};
use crate::support::patience::until;
use crate::support::postgres::Cluster;
use crate::support::process::{self, Process};
use ballast::store::Store;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, RootCertStore, SupportedProtocolVersion};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;

fn write(folder: &Path, certificate: &Certificate) {
    std::fs::write(folder.join("cert.pem"), &certificate.pem).unwrap();
    std::fs::write(folder.join("key.pem"), &certificate.key).unwrap();
}

fn with_certificate(command: &mut Command, folder: &Path) {
    command.arg("--data").arg(folder.join("data"));
    command.arg("--tls-cert").arg(folder.join("cert.pem")).arg("--tls-key").arg(folder.join("key.pem"));
}

/// A service encrypted by a certificate for its address; its process, its address and its folder.
fn serve(authority: &Authority) -> (Process, String, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &authority.certificate("127.0.0.1"));
    let (child, url) = process::serve(|command| with_certificate(command, folder.path()));
    let address = url.strip_prefix("https://").expect("an encrypted address").to_owned();
    (Process(child), address, folder)
}

/// Asks `path` of whom an authority vouches for; the answer, and the certificate that was shown.
async fn ask(
    address: &str,
    path: &str,
    authority: &str,
    versions: &[&'static SupportedProtocolVersion],
) -> std::io::Result<(String, Vec<u8>)> {
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_slice(authority.as_bytes()).unwrap()).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ClientConfig::builder_with_provider(provider).with_protocol_versions(versions).unwrap();
    let config = builder.with_root_certificates(roots).with_no_client_auth();
    let stream = TcpStream::connect(address).await?;
    let name = ServerName::try_from("127.0.0.1").unwrap();
    let mut stream = TlsConnector::from(Arc::new(config)).connect(name, stream).await?;
    let shown = stream.get_ref().1.peer_certificates().unwrap()[0].to_vec();
    let request = format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await?;
    Ok((answer, shown))
}

#[tokio::test(flavor = "multi_thread")]
async fn callers_are_answered_over_tls_1_2_and_1_3_and_in_the_clear_not_at_all() {
    let authority = Authority::new();
    let (_process, address, folder) = serve(&authority);
    for version in [&rustls::version::TLS12, &rustls::version::TLS13] {
        let (answer, _) = ask(&address, "/readyz", &authority.pem, &[version]).await.unwrap();
        assert!(answer.starts_with("HTTP/1.1 200") && answer.ends_with("ok"), "{answer}");
    }
    assert!(ask(&address, "/readyz", &Authority::new().pem, rustls::ALL_VERSIONS).await.is_err(), "a stranger vouches");
    let mut plain = TcpStream::connect(&address).await.unwrap();
    plain.write_all(b"GET /readyz HTTP/1.1\r\nHost: localhost\r\n\r\n").await.unwrap();
    let mut received = Vec::new();
    let _ = plain.read_to_end(&mut received).await;
    assert!(!String::from_utf8_lossy(&received).contains("HTTP/1.1"), "answered in the clear");
    // A hello of TLS 1.1, from its record to its one cipher: refused by an alert (21), and by nothing else.
    let hello = [&[22, 3, 1, 0, 47, 1, 0, 0, 43, 3, 2][..], &[7; 32], &[0, 0, 2, 0, 47, 1, 0, 0, 0]].concat();
    let mut old = TcpStream::connect(&address).await.unwrap();
    old.write_all(&hello).await.unwrap();
    let mut received = Vec::new();
    let _ = old.read_to_end(&mut received).await;
    assert!(received.first().is_none_or(|kind| *kind == 21), "{received:?}");

    let health = |more: &[&str]| {
        let check = Command::new(env!("CARGO_BIN_EXE_ballast")).arg("healthcheck").args(more).output().unwrap();
        (check.status.success(), String::from_utf8_lossy(&check.stderr).into_owned())
    };
    let file = folder.path().join("cert.pem").to_str().unwrap().to_owned();
    assert_eq!(health(&["--listen", &address, "--tls-cert", &file]), (true, String::new()));
    assert_eq!(health(&["--url", &format!("https://{address}")]), (true, String::new()));
    assert!(!health(&["--listen", &address]).0, "asked in the clear");
}

/// The answer and the certificate it came under.
type Shown = (String, Vec<u8>);

#[tokio::test(flavor = "multi_thread")]
async fn a_new_certificate_counts_without_a_restart_and_a_bad_one_does_not() {
    let authority = Authority::new();
    let (_process, address, folder) = serve(&authority);
    let shown = async || ask(&address, "/metrics", &authority.pem, rustls::ALL_VERSIONS).await.unwrap();
    // Who is shown once the files have been looked at and refused, as the count of refusals says.
    let after_a_refusal = async |what: &str, change: &dyn Fn()| {
        let before = refusals(&shown().await);
        change();
        until(what, async || Some(shown().await).filter(|now| refusals(now) > before)).await.1
    };
    let first = shown().await.1;
    let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let bad = after_a_refusal("a bad certificate to be noticed", &|| put("cert.pem", "no certificate")).await;
    assert_eq!(bad, first);
    let own = authority.certificate("127.0.0.1");
    let without_key =
        after_a_refusal("a certificate without its key to be noticed", &|| put("cert.pem", &own.pem)).await;
    assert_eq!(without_key, first, "a certificate without its key is in force");
    put("key.pem", &own.key);
    let new_certificate = async || Some(shown().await.1).filter(|shown| *shown != first);
    let second = until("the new certificate to be served", new_certificate).await;
    assert_eq!(second, CertificateDer::from_pem_slice(own.pem.as_bytes()).unwrap().to_vec());
    let key = folder.path().join("key.pem");
    let gone = after_a_refusal("a key to be missed", &|| std::fs::remove_file(&key).unwrap()).await;
    assert_eq!(gone, second);
}

/// Certificates that were looked at and refused.
fn refusals((metrics, _): &Shown) -> u64 {
    let count = r#"ballast_certificate_loads_total{outcome="refused"} "#;
    metrics.lines().find_map(|line| line.strip_prefix(count)).map_or(0, |number| number.parse().unwrap())
}

#[test]
fn a_certificate_that_cannot_serve_refuses_the_start() {
    let authority = Authority::new();
    let (one, other) = (authority.certificate("127.0.0.1"), authority.certificate("127.0.0.1"));
    let folder = tempfile::tempdir().unwrap();
    let complaint = |prepare: &dyn Fn(&Path)| {
        write(folder.path(), &one);
        prepare(folder.path());
        let mut command = Command::new(env!("CARGO_BIN_EXE_ballast"));
        command.args(["serve", "--listen", "127.0.0.1:0"]);
        with_certificate(&mut command, folder.path());
        let output = command.env("RUST_LOG", "warn").output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let put = |name: &'static str, text: String| move |folder: &Path| std::fs::write(folder.join(name), &text).unwrap();
    for (what, prepare, expected) in [
        (
            "an absent certificate",
            &(|folder: &Path| std::fs::remove_file(folder.join("cert.pem")).unwrap()) as &dyn Fn(&Path),
            "cert.pem",
        ),
        ("an empty certificate", &put("cert.pem", String::new()), "holds no certificate"),
        ("a certificate that is a key", &put("cert.pem", one.key.clone()), "holds no certificate"),
        ("a key that is none", &put("key.pem", "x".into()), "holds no private key"),
        ("another's key", &put("key.pem", other.key.clone()), "do not form a usable pair"),
    ] {
        let complaint = complaint(prepare);
        assert!(
            complaint.contains("cannot encrypt connections") && complaint.contains(expected),
            "{what}: {complaint}"
        );
    }
    let alone = Command::new(env!("CARGO_BIN_EXE_ballast")).args(["serve", "--tls-cert", "cert.pem"]).output().unwrap();
    assert!(!alone.status.success() && String::from_utf8_lossy(&alone.stderr).contains("--tls-key"), "{alone:?}");
}

/// Over a real server that takes encrypted connections alone: every mode that checks more than the one before.
#[tokio::test(flavor = "multi_thread")]
async fn a_database_is_asked_over_tls_and_its_certificate_is_judged() {
    let folder = tempfile::tempdir().unwrap();
    let (authority, stranger) = (Authority::new(), Authority::new());
    let own = authority.certificate("127.0.0.1");
    let Some(cluster) = Cluster::encrypted(&own.pem, &own.key) else { return };
    let root = |name: &str, pem: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, pem).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (known, unknown) = (root("known.pem", &authority.pem), root("unknown.pem", &stranger.pem));
    let absent = folder.path().join("absent.pem").to_str().unwrap().to_owned();
    let connected = async |host: &str, query: String| {
        let url = format!("{}?{query}", cluster.own_database().replace("127.0.0.1", host));
        match Store::connect(&url.parse().unwrap()).await {
            Ok(store) => {
                store.close().await;
                Ok(())
            }
            Err(error) => {
                let first: &dyn std::error::Error = &error;
                let causes = std::iter::successors(Some(first), |cause| cause.source());
                Err(causes.map(ToString::to_string).collect::<Vec<_>>().join(": "))
            }
        }
    };
    for query in ["sslmode=require".into(), format!("sslmode=verify-full&sslrootcert={known}"), "sslmode=prefer".into()]
    {
        assert_eq!(connected("127.0.0.1", query.clone()).await, Ok(()), "{query}");
    }
    let named = |mode: &str, root: &str| format!("sslmode={mode}&sslrootcert={root}");
    for (host, query) in [
        ("127.0.0.1", "sslmode=disable".to_owned()),
        ("127.0.0.1", named("verify-full", &unknown)),
        ("127.0.0.1", named("verify-ca", &unknown)),
        ("127.0.0.1", named("verify-full", &absent)),
        // The certificate is for the address and not for the name.
        ("localhost", named("verify-full", &known)),
    ] {
        let refused = connected(host, query.clone()).await;
        println!("{host}?{query}: {refused:?}");
        assert!(refused.is_err(), "{host}?{query}");
    }
    assert_eq!(connected("localhost", named("verify-ca", &known)).await, Ok(()));
}
