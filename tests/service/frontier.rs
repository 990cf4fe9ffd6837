//! The cost of more or less caution on records like the one at hand: `POST /frontier` and the library behind it.

use crate::support::App;
use crate::support::values::replaced;
use ballast::control::cache::Cache;
use ballast::control::evaluation::frontier::Frontier;
use ballast::control::evaluation::frontier::report::FrontierReport;
use ballast::control::progress::Watch;
use ballast::control::request::frontier::FrontierRequest;
use ballast::control::request::specification::ProblemSpecification;
use ballast::service::advice::advise::Advise;
use rand::{RngExt, SeedableRng};
use serde_json::{Value, json};

const RATE: f64 = 0.002;
const SCALES: [f64; 4] = [0.0, 0.25, 0.5, 1.0];

fn history(count: usize) -> Vec<f64> {
    (0..count).map(|k| 0.006 + 0.08 * ((k * 7919 % 101) as f64 / 50.0 - 1.0)).collect()
}

fn problem(history: &[f64]) -> Value {
    json!({ "history": history, "rate_per_step": RATE, "periods_per_year": 12.0,
        "utility": { "kind": "power", "risk_aversion": 3.0 }, "radius": { "rule": "root_n", "kappa": 0.02 } })
}

fn report(request: &Value) -> FrontierReport {
    let question = serde_json::from_value::<FrontierRequest>(request.clone()).unwrap().question().unwrap();
    Frontier::new(question, Cache::default()).run(&Watch::unwatched()).unwrap()
}

/// The advice of `POST /advise` at this multiple of the radius.
fn advised(history: &[f64], scale: f64) -> f64 {
    let mut problem = problem(history);
    problem["horizon"] = json!(1);
    problem["radius"]["kappa"] = json!(0.02 * scale);
    let problem = serde_json::from_value::<ProblemSpecification>(problem).unwrap();
    let question = Advise { problem, wealth: None, holding: None, seed: 1, sensitivity: false };
    question.answer().unwrap().advice.allocation
}

/// `ln CE` over the bank under the law of `atoms`, from the definition.
fn worth(atoms: &[f64], share: f64) -> f64 {
    let utility = |z: &f64| (1.0 + share * (z.exp() / (1.0 + RATE) - 1.0)).powi(-2);
    -0.5 * (atoms.iter().map(utility).sum::<f64>() / atoms.len() as f64).ln()
}

#[test]
fn losses_on_blocks_agree_with_brute_force() {
    let (history, block, draws) = (history(36), 3, 1000);
    let request =
        json!({ "problem": problem(&history), "scales": SCALES, "resamples": draws, "block": block, "seed": 7 });
    let found = report(&request);
    let blocks = &found.resampled[1];
    let best = (0..=100_000).map(|k| worth(&history, f64::from(k) / 100_000.0)).fold(0.0, f64::max);
    assert!((worth(&history, blocks.best[0]) - best).abs() < 1e-9, "{blocks:?}");
    // Records of its own, advised by the one-asset solver.
    let mut generator = rand_chacha::ChaCha8Rng::seed_from_u64(99);
    let mut lost = vec![Vec::new(); SCALES.len()];
    let mut average = [0.0; SCALES.len()];
    for _ in 0..draws {
        let starts: Vec<usize> = (0..36 / block).map(|_| generator.random_range(0..36)).collect();
        let record: Vec<f64> = starts
            .iter()
            .flat_map(|start| (0..block).map(move |k| (start + k) % 36))
            .map(|date| history[date])
            .collect();
        for ((lost, average), scale) in lost.iter_mut().zip(&mut average).zip(SCALES) {
            let allocation = advised(&record, scale);
            lost.push(12e4 * (best - worth(&history, allocation)));
            *average += allocation / f64::from(draws);
        }
    }
    for ((point, lost), average) in blocks.points.iter().zip(lost).zip(average) {
        let count = lost.len() as f64;
        let mean = lost.iter().sum::<f64>() / count;
        let deviation = (lost.iter().map(|lost| (lost - mean).powi(2)).sum::<f64>() / count).sqrt();
        // Two independent means; the 90 % interval of one reaches 1.645 standard errors. Four of the difference's.
        let tolerance = 4.0 * 2.0_f64.sqrt() * (point.lost.high - point.lost.low) / (2.0 * 1.645);
        assert!((point.lost.value - mean).abs() < tolerance, "{point:?} {mean} {tolerance}");
        assert!((point.deviation.value / deviation - 1.0).abs() < 0.15, "{point:?} {deviation}");
        let beyond = 12e4 * (best - worth(&history, average)) - mean;
        assert!((point.beyond_own_mix.value - beyond).abs() < tolerance, "{point:?} {beyond} {tolerance}");
        assert!(point.beyond_own_mix.value < 1e-9, "{point:?}");
    }
    let lost: Vec<f64> = blocks.points.iter().map(|point| point.lost.value).collect();
    assert!(
        lost.windows(2).any(|pair| (pair[0] - pair[1]).abs() > 1.0),
        "scales that lose alike show nothing: {lost:?}"
    );
}

/// Sixteen seeds: the deviation of the figure over them beside the standard error that each interval tells, and no interval reaches
/// above 0.
#[test]
fn intervals_beyond_the_own_mix_are_as_wide_as_seeds_differ() {
    let history = history(60);
    let scales = [0.0, 0.5];
    let found: Vec<FrontierReport> = (1..=16)
        .map(|seed| report(&json!({ "problem": problem(&history), "scales": scales, "resamples": 100, "seed": seed })))
        .collect();
    for index in 0..scales.len() {
        let beyond = |report: &FrontierReport| report.resampled[0].points[index].beyond_own_mix;
        let values: Vec<f64> = found.iter().map(|report| beyond(report).value).collect();
        let mean = values.iter().sum::<f64>() / 16.0;
        let deviation = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 15.0).sqrt();
        // The lower end, which nothing cuts off: 1.66 standard errors of 100 records.
        let implied = found.iter().map(|report| (beyond(report).value - beyond(report).low) / 1.66).sum::<f64>() / 16.0;
        // A deviation of sixteen errs by a fifth.
        assert!((0.45..1.7).contains(&(deviation / implied)), "{index}: {deviation} {implied}");
        assert!(found.iter().all(|report| beyond(report).high <= 0.0));
    }
}

#[test]
fn at_the_record_itself_it_advises_as_advise_does() {
    let history = history(60);
    let found = report(&json!({ "problem": problem(&history), "scales": SCALES, "resamples": 20 }));
    for (own, scale) in found.own.iter().zip(SCALES) {
        assert!((own[0] - advised(&history, scale)).abs() < 1e-3, "{scale}: {own:?}");
    }
    assert!(found.per_year && found.sentences.len() == 6, "{:?}", found.sentences);
    let simple: Vec<f64> = history.iter().map(|value| value.exp() - 1.0).collect();
    let mean = simple.iter().sum::<f64>() / 60.0;
    let error = (simple.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / 59.0 / 60.0).sqrt();
    assert!((found.evidence - (mean - RATE) / error).abs() < 1e-9, "{}", found.evidence);
    let without = &found.resampled[2];
    assert!(without.best[0] < 1e-6 && without.points[3].lost.value < without.points[0].lost.value, "{without:?}");
    assert_eq!(found.resampled[1].points.iter().filter(|point| point.beyond_least.is_none()).count(), 1);
}

#[test]
fn columns_that_are_one_asset_lose_what_it_loses() {
    let history = history(40);
    let rows: Vec<[f64; 2]> = history.iter().map(|&value| [value, value]).collect();
    let mut several = problem(&history);
    several["assets"] = json!(["one", "same"]);
    several["history"] = json!(rows);
    let of = |problem: Value| report(&json!({ "problem": problem, "resamples": 40, "block": 2 })).resampled[1].clone();
    let (one, same) = (of(problem(&history)), of(several));
    for (one, same) in one.points.iter().zip(&same.points) {
        // Allocations are found to 1e-4 or so, where what they are worth is flat: a hundredth of a basis point a month.
        assert!((one.lost.value - same.lost.value).abs() < 0.12, "{one:?} {same:?}");
    }
}

/// Columns of a file that nothing tells apart are an asset each, and those that are named are.
#[test]
fn the_command_asks_of_the_columns_of_a_file_what_the_service_is_asked() {
    const FILE: &str = "data/us_industries_monthly.csv";
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let frontier = |arguments: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ballast"));
        command.current_dir(folder).args(["frontier", FILE, "--window", "60", "--scales", "0,0.5"]).args(arguments);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let file = std::fs::read_to_string(folder.join(FILE)).unwrap();
    let lines: Vec<Vec<&str>> = file.lines().map(|line| line.split(',').collect()).collect();
    let place = |name: &str| lines[0].iter().position(|column| *column == name).unwrap();
    let value = |line: &[&str], name: &str| line[place(name)].parse::<f64>().unwrap();
    let two = |line: &Vec<&str>| ["energy", "health"].map(|name| value(line, name).ln_1p());
    let rows: Vec<[f64; 2]> = lines[lines.len() - 60..].iter().map(two).collect();
    let rate = value(lines.last().unwrap(), "risk_free_return");
    let problem = json!({ "assets": ["energy", "health"], "history": rows, "rate_per_step": rate,
        "periods_per_year": 12.0, "utility": { "kind": "power", "risk_aversion": 3.0 },
        "radius": { "rule": "bridge", "alpha": 0.1 } });
    let found = frontier(&["--column", "energy", "--column", "health", "--json"]);
    let expected = report(&json!({ "problem": problem, "scales": [0.0, 0.5] }));
    assert_eq!(serde_json::from_str::<Value>(&found).unwrap(), serde_json::to_value(&expected).unwrap());
    assert_eq!(expected.request.resamples, Some(60));
    let output = frontier(&["--resamples", "20"]);
    assert!(
        output.contains("Each of the 12 columns is an asset; --column takes one alone. The last 60 periods are used"),
        "{output}"
    );
    assert!(output.ends_with(&format!("{}\n", expected.sentences.last().unwrap())), "{output}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frontier_is_a_job_whose_report_is_the_library_s() {
    let app = App::start().await;
    let mut problem = problem(&history(30));
    problem["utility"] = json!({ "kind": "exponential", "risk_aversion_relative": 3.0 });
    let request = json!({ "problem": problem, "scales": [0.0, 0.5], "resamples": 30, "seed": 3 });
    let (status, job) = app.post("/frontier", &request).await;
    assert_eq!(status.as_u16(), 202, "{job}");
    assert_eq!(job["kind"], "frontier");
    let id = job["job"].as_str().unwrap().to_owned();
    let ended = app.until(&id, |job| job["finished_ms"].is_i64()).await;
    assert_eq!(ended["state"], "succeeded", "{ended}");
    let (_, found) = app.get(ended["report"].as_str().unwrap()).await;
    assert_eq!(found, serde_json::to_value(report(&request)).unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_tried_is_refused_by_name() {
    let app = App::start().await;
    let whole = json!({ "problem": problem(&history(30)) });
    let cases = [
        ("/problem/framework", json!("plug_in"), "problem.framework"),
        ("/problem/horizon", json!(2), "problem.horizon"),
        ("/problem/trading_cost", json!(0.01), "problem.trading_cost"),
        ("/problem/learning", json!({ "kind": "decay", "half_life": 20.0 }), "problem.learning"),
        ("/problem/caution", json!("cautious"), "problem.caution"),
        ("/problem/caution", json!({ "scale": 0.3 }), "problem.caution"),
        ("/problem/contributions", json!(1.0), "problem.contributions"),
        ("/problem/history", json!(history(11)), "problem.history"),
        ("/scales", json!([]), "scales"),
        ("/scales", json!([0.5, 0.5]), "scales[1]"),
        ("/scales", json!([11.0]), "scales[0]"),
        ("/resamples", json!(5), "resamples"),
        ("/block", json!(16), "block"),
        ("/problem/history", json!([0.1, "x"]), "problem.history[1]"),
        ("/problem/utility", json!({ "kind": "log", "more": 1 }), "problem.utility.more"),
        ("/problem/history", json!(history(5001)), "problem.history"),
        ("/more", json!(1), "more"),
    ];
    for (pointer, value, field) in cases {
        let request = replaced(whole.clone(), pointer, value);
        let (status, problem) = app.post("/frontier", &request).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{pointer}: {problem}");
    }
}
