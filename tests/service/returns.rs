//! The one reader of returns: a table of files, good and bad, read by the library and by `POST /returns` alike, and records
//! written in every form that a spreadsheet or a program has.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::support::App;
use ballast::returns::{Choices, Kind, Reading, Record, decoded, read};
use serde_json::{Value, json};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/returns")
}

fn text(file: &str) -> String {
    decoded(&std::fs::read(folder().join(file)).unwrap()).unwrap()
}

/// `tests/data/returns/table.json`: a file, what is said of it, and what must be answered.
fn table() -> Vec<Value> {
    serde_json::from_str(&std::fs::read_to_string(folder().join("table.json")).unwrap()).unwrap()
}

fn close(found: &Value, percent: &Value, of: impl Fn(f64) -> f64) -> bool {
    let numbers =
        |list: &Value| list.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect::<Vec<_>>();
    let (found, percent) = (numbers(found), numbers(percent));
    found.len() == percent.len()
        && found.iter().zip(percent).all(|(found, percent)| (100.0 * of(*found) - percent).abs() < 1e-9)
}

/// The part of the service's answer that a row compares.
fn check_record(row: &Value, found: &Value) {
    let sentence = found["sentence"].as_str().unwrap();
    assert!(sentence.starts_with(row["says"].as_str().unwrap()), "{row}\n{sentence}");
    let others = row["others"].as_array().cloned().unwrap_or_default();
    let series = found["series"].as_array().unwrap();
    assert_eq!(series.len(), 1 + others.len(), "{row}");
    for (series, expected) in series.iter().zip([row["percent"].clone()].iter().chain(&others)) {
        assert!(close(&series["log_returns"], expected, f64::exp_m1), "{row}\n{series}");
    }
    let ends = found["dates"].as_array().map(|dates| [dates[0].clone(), dates[dates.len() - 1].clone()]);
    assert_eq!(ends, row["first"].is_string().then(|| [row["first"].clone(), row["last"].clone()]), "{row}");
    assert_eq!(found["rate"].is_object(), row["rates"].is_array(), "{row}");
    if row["rates"].is_array() {
        assert!(close(&found["rate"]["rates"], &row["rates"], |rate| rate), "{row}\n{}", found["rate"]);
    }
}

fn check_questions(row: &Value, found: &Value) {
    let questions = found["questions"].as_array().unwrap();
    let asks: Vec<&Value> = questions.iter().map(|question| &question["asks"]).collect();
    assert_eq!(json!(asks), row["asks"], "{row}");
    assert_eq!(questions[0]["question"], row["question"]);
    let options: Vec<&Value> = questions.iter().flat_map(|question| question["options"].as_array().unwrap()).collect();
    let expected = row["options"].as_array().unwrap();
    assert_eq!(options.len(), expected.len(), "{row}");
    for (option, expected) in options.into_iter().zip(expected) {
        let sentence = &option["sentence"];
        let starts = |start: &str| sentence.as_str().is_some_and(|sentence| sentence.starts_with(start));
        assert!(expected.as_str().map_or(sentence.is_null(), starts), "{row}\n{option}");
    }
    // An answer settles its question.
    for question in questions {
        for option in question["options"].as_array().unwrap() {
            let choices: Choices = serde_json::from_value(option["choices"].clone()).unwrap();
            let Reading::Asked { questions, .. } = read(&text(row["file"].as_str().unwrap()), &choices) else {
                continue;
            };
            assert!(questions.iter().all(|other| other.asks != question["asks"]), "{row} {option}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_file_of_the_table_is_answered_as_it_must_be_by_library_and_service() {
    let app = App::start().await;
    let rows = table();
    let named: BTreeSet<&str> = rows.iter().map(|row| row["file"].as_str().unwrap()).collect();
    let files = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let files: BTreeSet<String> = files.filter(|name| name != "table.json").collect();
    assert!(files.len() >= 70 && files.iter().map(String::as_str).eq(named), "{files:?}");
    for row in rows {
        let text = text(row["file"].as_str().unwrap());
        let choices = if row["choices"].is_object() { row["choices"].clone() } else { json!({}) };
        let found = serde_json::to_value(read(&text, &serde_json::from_value(choices.clone()).unwrap())).unwrap();
        assert_eq!(found["outcome"], row["outcome"], "{row}\n{found}");
        match row["outcome"].as_str().unwrap() {
            "read" => check_record(&row, &found),
            "asked" => check_questions(&row, &found),
            _ => {
                assert_eq!(found["sentence"], row["says"]);
                let place = &found["place"];
                let place = json!([place["line"], place["column"], place["value"]]);
                assert_eq!(
                    if row["place"].is_null() { json!([null, null, null]) } else { row["place"].clone() },
                    place
                );
            }
        }
        let (status, answered) = app.post("/returns", &json!({ "text": text, "choices": choices })).await;
        assert_eq!((status.as_u16(), answered), (200, found), "{row}");
    }
    for (body, field) in [
        (json!({ "choices": {} }), "text"),
        (json!({ "text": "1 2", "choices": { "unit": "per mille" } }), "choices.unit"),
        (json!({ "text": "1 2", "choices": { "colour": 3 } }), "choices.colour"),
        (json!({ "text": "1 2", "kind": "log" }), "kind"),
    ] {
        let (status, problem) = app.post("/returns", &body).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{problem}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_text_beyond_all_bounds_is_refused_and_one_within_is_read_in_time() {
    let app = App::configured(|config| config.body_limit_bytes = 64 << 20).await;
    let many: String = (0..190_000).map(|row| format!("{}\n", 0.01 * f64::from(row % 7 - 3))).collect();
    let refusals = [
        ("0.01\n".repeat(1_000_000), "The text has 1000000 lines: it must have at most 200000."),
        ("0.01,".repeat(1_500_000), "The text has 1500000 cells: it must have at most 1000000."),
        ("1".repeat(8_000_001), "The text has 8000001 bytes: it must have at most 8000000."),
    ];
    for (text, sentence) in refusals {
        let (status, answered) = app.post("/returns", &json!({ "text": text })).await;
        assert_eq!((status.as_u16(), &answered["sentence"]), (200, &json!(sentence)));
    }
    let started = Instant::now();
    for text in [many, "a,".repeat(499_999), "\"".repeat(5_900_000), "1 ".repeat(499_999), "1/2/2020;".repeat(199_999)]
    {
        let (status, _) = app.post("/returns", &json!({ "text": text })).await;
        assert_eq!(status, 200);
    }
    assert!(started.elapsed() < Duration::from_secs(60), "{:?}", started.elapsed());
    let (status, problem) = app.post("/returns", &json!({ "text": "1".repeat(12_000_000) })).await;
    assert_eq!((status.as_u16(), &problem["field"]), (413, &json!("body")));
}

/// `tests/data/inputs/table.json`: files as vendors and programs write them, what is chosen of each, and how its answer begins.
/// Every question has an answer that leads to a record.
#[test]
fn every_file_of_a_vendor_is_read_asked_about_or_refused_as_it_must_be() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/inputs");
    let rows: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(folder.join("table.json")).unwrap()).unwrap();
    let named: BTreeSet<String> = rows.iter().map(|row| row["file"].as_str().unwrap().to_owned()).collect();
    let files = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let files: BTreeSet<String> = files.filter(|name| name != "table.json").collect();
    let odd: Vec<&String> = files.symmetric_difference(&named).collect();
    assert!(files.len() >= 30 && odd.is_empty(), "{odd:?}");
    let mut wrong = Vec::new();
    for row in rows {
        let bytes = std::fs::read(folder.join(row["file"].as_str().unwrap())).unwrap();
        let choices = if row["choices"].is_object() { row["choices"].clone() } else { json!({}) };
        let reading = match decoded(&bytes) {
            Ok(text) => read(&text, &serde_json::from_value(choices).unwrap()),
            Err(sentence) => Reading::Refused { sentence, place: None },
        };
        let (outcome, says) = match &reading {
            Reading::Read(record) => ("read", record.sentence.clone()),
            Reading::Asked { questions, .. } => ("asked", questions[0].question.clone()),
            Reading::Refused { sentence, .. } => ("refused", sentence.clone()),
        };
        let contains = row["contains"].as_str().unwrap_or_default();
        let periods = match &reading {
            Reading::Read(record) => json!(record.periods_per_year),
            _ => Value::Null,
        };
        let is_right = row["outcome"] == outcome
            && says.starts_with(row["says"].as_str().unwrap())
            && says.contains(contains)
            && (row["periods"].is_null() || row["periods"] == periods);
        if !is_right {
            wrong.push(format!("{row}\n{outcome}: {says} {periods}"));
        }
        if let Reading::Asked { questions, .. } = reading {
            for question in questions {
                assert!(question.options.iter().any(|option| option.sentence.is_some()), "{row}\n{question:?}");
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// Months of US stocks, in a run without dates.
fn months(of: impl Fn(f64) -> f64, count: usize) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/us_market_monthly.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let cell = |line: &str| format!("{:.5}", of(line.split(',').nth(1).unwrap().parse().unwrap()));
    let cells: Vec<String> = text.lines().skip(1).map(cell).collect();
    cells.windows(count).step_by(count / 3).map(|window| window.join(" ")).collect()
}

/// The average of few numbers says little about their unit. Few runs of stocks as fractions are asked about, and most of a calm fund in
/// percent (0.05 % a month, give or take 0.04 %) most.
#[test]
fn short_runs_are_asked_about_where_they_may_be_percent_and_seldom_elsewhere() {
    for (count, most_of_stocks, fewest_of_calm) in [(4, 0.09, 0.5), (6, 0.08, 0.7), (12, 0.03, 0.85), (24, 0.02, 0.9)] {
        let share_asked = |texts: Vec<String>| {
            let choices = Choices::from(Kind::Simple);
            let is_average = |text: &&String| match read(text, &choices) {
                Reading::Asked { questions, .. } => {
                    questions[0].asks == "unit" && questions[0].question.contains("they average")
                }
                _ => false,
            };
            texts.iter().filter(is_average).count() as f64 / texts.len() as f64
        };
        let (stocks, calm) =
            (share_asked(months(|back| back, count)), share_asked(months(|back| 0.05 + 0.8 * back, count)));
        assert!(stocks < most_of_stocks && calm > fewest_of_calm, "{count}: {stocks} {calm}");
    }
}

/// A generator of its own, so that a failure can be repeated.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0) / 4_294_967_296.0
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() * count as f64) as usize
    }

    fn one<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }
}

fn date(form: usize, month: i32, day: i32) -> String {
    const NAMES: [&str; 12] = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
    let (year, m, d) = (month / 12, month % 12 + 1, day);
    match form {
        0 => format!("{year}-{m:02}"),
        1 => format!("{year}-{m:02}-{d:02}"),
        2 => format!("{year}{m:02}{d:02}"),
        3 => format!("{year}{m:02}"),
        4 => format!("{d}.{m}.{year}"),
        5 => format!("{d:02}/{m:02}/{year}"),
        6 => format!("{m}/{d}/{year}"),
        7 => format!("{} {year}", NAMES[m as usize - 1]),
        8 => format!("{}-{:02}", NAMES[m as usize - 1], year % 100),
        _ => format!("{year}-{m:02}-{d:02} 00:00:00"),
    }
}

fn with_thousands(number: &str, apart: &str) -> String {
    let whole = number.find(['.', ',']).unwrap_or(number.len());
    let (whole, rest) = number.split_at(whole);
    let split = whole.len().saturating_sub(3);
    if split == 0 { number.into() } else { format!("{}{apart}{}{rest}", &whole[..split], &whole[split..]) }
}

/// A record of monthly returns and one way of writing it down.
fn written(seed: u32) -> (String, Vec<f64>) {
    let mut random = Random(seed);
    let count = 6 + random.below(35);
    let size = random.one(&[0.006, 0.01, 0.04, 0.08]);
    let mut gain = || ((random.next() + random.next() + random.next() - 1.4) * size * 1e5).round() / 1e5;
    let returns: Vec<f64> = (0..count).map(|_| gain()).collect();
    let (start, day) = (12 * (1990 + random.below(26) as i32) + random.below(12) as i32, random.one(&[1, 15, 28]));
    let (kind, decimal, form) = (random.below(4), random.one(&[".", ","]), random.below(10));
    let mut price = 20.0 + random.below(980) as f64;
    let cells: Vec<String> = returns
        .iter()
        .map(|value| {
            price *= 1.0 + value;
            let plain = match kind {
                0 => format!("{value:.5}"),
                1 => format!("{:.3}", 100.0 * value),
                2 => format!("{:.3}%", 100.0 * value),
                _ => format!("{price:.4}"),
            };
            let marked = plain.replace('.', decimal);
            if kind == 3 { with_thousands(&marked, if decimal == "," { "." } else { "," }) } else { marked }
        })
        .collect();
    let dated = random.next() < 0.7;
    let separator = if decimal == "," { random.one(&[";", "\t"]) } else { random.one(&[",", ";", "\t"]) };
    let mut rows: Vec<String> = Vec::new();
    for (month, cell) in (start..).zip(cells) {
        let quoted = if cell.contains(separator) || random.next() < 0.1 { format!("\"{cell}\"") } else { cell };
        rows.push(if dated { format!("{}{separator}{quoted}", date(form, month, day)) } else { quoted });
    }
    if dated && random.next() < 0.5 {
        rows.reverse();
    }
    if random.next() < 0.5 {
        rows.insert(0, if dated { format!("date{separator}fund") } else { "fund".into() });
    }
    (rows.join(random.one(&["\n", "\r\n"])), if kind == 3 { returns[1..].to_vec() } else { returns })
}

#[test]
fn records_are_read_as_they_were_written_or_asked_about() {
    let (mut records, mut questioned) = (0, 0);
    for seed in 1..=4000 {
        let (text, truth) = written(seed);
        match read(&text, &Choices::default()) {
            Reading::Read(Record { series, sentence, .. }) => {
                let found = &series[0].simple_returns;
                let near = found.len() == truth.len() && found.iter().zip(&truth).all(|(a, b)| (a - b).abs() < 2e-5);
                assert!(near, "seed {seed}: {sentence}\n{text}");
                records += 1;
            }
            Reading::Asked { .. } => questioned += 1,
            Reading::Refused { sentence, .. } => panic!("seed {seed}: {sentence}\n{text}"),
        }
    }
    assert!(records > 2000 && questioned > 0, "{records} {questioned}");
}

/// A word that says there is no number leaves out the last row with a remark; everywhere else, and any other word, stops.
#[test]
fn a_cell_out_of_place_is_never_passed_over() {
    for seed in 1..=500 {
        let (text, truth) = written(seed);
        let mut random = Random(seed + 1_000_000);
        let mut rows: Vec<String> = text.lines().map(str::to_owned).collect();
        let at = 1 + random.below(rows.len() - 1);
        let start = rows[at].rfind([';', ',', '\t']).filter(|_| !rows[at].ends_with('"')).map_or(0, |last| last + 1);
        rows[at].truncate(start);
        let word = random.one(&["NA", "n/a", "#N/A", "x", "-", "null"]);
        rows[at].push_str(word);
        let found = read(&rows.join("\n"), &Choices::default());
        let Reading::Read(record) = &found else { continue };
        let is_told = record.remarks.iter().any(|remark| remark == "Left out 1 blank row before or after the numbers.");
        let is_at_an_end = at == rows.len() - 1 || at == 1;
        // The row was one quoted cell: without a date it stands below the table.
        let is_below =
            record.remarks.iter().any(|remark| remark.starts_with(&format!("Line {} after the table", at + 1)));
        let is_right = is_below || (word != "x" && is_told && is_at_an_end);
        assert!(is_right, "seed {seed}: {found:?}\n{}", rows.join("\n"));
        assert_eq!(record.count + 1, truth.len(), "seed {seed}");
    }
}

/// Records of every kind under a heading that says nothing, with one cell that cannot be: the others mean what they did, so
/// nothing is read of them in another kind or unit.
#[test]
fn one_impossible_cell_never_changes_what_the_others_are() {
    let (mut refused, mut questioned) = (0, 0);
    for seed in 1..=1000 {
        let mut random = Random(seed + 5_000_000);
        let count = 6 + random.below(60);
        let size = random.one(&[0.006, 0.01, 0.04, 0.08]);
        let mut price = random.one(&[1.3, 9.0, 30.0, 250.0, 4000.0]);
        let kind = random.one(&["price", "fraction", "percent"]);
        let mut cells: Vec<String> = (0..count)
            .map(|_| {
                let gain = (random.next() + random.next() + random.next() - 1.45) * size;
                price *= 1.0 + gain;
                match kind {
                    "price" => format!("{price:.3}"),
                    "fraction" => format!("{gain:.5}"),
                    _ => format!("{:.4}", 100.0 * gain),
                }
            })
            .collect();
        let text = |cells: &[String]| {
            let row = |(month, cell): (i32, &String)| format!("{},{cell}\n", date(0, 12 * 2001 + month, 1));
            (0..).zip(cells).map(row).fold("month,fund\n".to_owned(), |text, row| text + &row)
        };
        let whole = read(&text(&cells), &Choices::default());
        let at = random.below(count);
        let odd: &[&str] = match kind {
            "price" => &["0", "-37.63", "-1", "0.00"],
            "fraction" => &["-1", "-1.99", "-66.0", "-100"],
            _ => &["-100", "-150", "-999"],
        };
        odd.iter().for_each(|odd| {
            (*odd).clone_into(&mut cells[at]);
            match (read(&text(&cells), &Choices::default()), &whole) {
                (Reading::Refused { place: Some(place), .. }, _) => {
                    assert_eq!((place.line, place.value.as_str()), (at + 2, *odd), "seed {seed}");
                    refused += 1;
                }
                (Reading::Asked { .. }, _) => questioned += 1,
                (Reading::Refused { sentence, .. }, _) => panic!("seed {seed}: {sentence}"),
                (Reading::Read(record), whole) => {
                    panic!("seed {seed}: {odd} in {kind}: {}\nwithout: {whole:?}", record.sentence)
                }
            }
        });
    }
    assert!(refused > 1500 && questioned < refused / 2, "{refused} {questioned}");
}

/// Texts of the most lines whose rows look like dates of many forms, or like none, are answered in time.
#[test]
fn hostile_tables_are_answered_in_time() {
    let forms =
        ["2020-01-02", "01/02/20", "Jan 2020", "2020 Q1", "20200102", "2020.1", "1580428800", "2020", "Mai 2020"];
    let row = |index: usize| format!("{},{},{}\n", forms[index % 9], forms[index / 9 % 9], index % 13);
    let mixed: String = (0..190_000).map(row).collect();
    let words: String = (0..190_000).map(|_| "Northern,Lights,fund\n").collect::<String>() + "2020-01,1,2\n";
    let footers = "2020-01,1\n2020-02,2\n2020-03,-1\n".to_owned() + &"Total 2020,5\n".repeat(190_000);
    let headings = "a,b\n".repeat(190_000) + "2020-01,0.1\n2020-02,0.2\n2020-03,-0.1\n";
    let started = Instant::now();
    for text in [mixed, words, footers, headings] {
        read(&text, &Choices::default());
    }
    assert!(started.elapsed() < Duration::from_secs(30), "{:?}", started.elapsed());
}

#[test]
fn any_text_gets_an_answer() {
    const PIECES: [&str; 22] = [
        "1", "0.5", "-2", ",", ";", "\t", " ", "\n", "\"", "%", "2020-01", "20200101", "a", "#", ".", "-", "1,234",
        "\u{2212}", "e5", "\u{feff}", "1e999", "\u{e9}",
    ];
    let mut outcomes = BTreeSet::new();
    for seed in 1..=20_000 {
        let mut random = Random(seed);
        let text: String = (0..random.below(31)).map(|_| random.one(&PIECES)).collect();
        let found = serde_json::to_value(read(&text, &Choices::default())).unwrap();
        outcomes.insert(found["outcome"].as_str().unwrap().to_owned());
    }
    assert_eq!(outcomes.len(), 3, "{outcomes:?}");
}

/// Records as they are in fractions are read without a question: the bundled ones, and stocks and bonds day by day.
#[test]
fn ordinary_records_are_not_asked_about() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let of = |file: &str| std::fs::read_to_string(data.join(file)).unwrap();
    let industries = of("us_industries_monthly.csv");
    let header: Vec<&str> = industries.lines().next().unwrap().split(',').skip(1).collect();
    let names: Vec<&str> = header.iter().copied().filter(|name| *name != "risk_free_return").collect();
    assert_eq!(names.len(), 12, "{names:?}");
    let mut texts = vec![(of("us_market_monthly.csv"), Choices::default())];
    for name in &names {
        texts.push((industries.clone(), Choices { columns: vec![(*name).to_owned()], ..Choices::default() }));
    }
    let all = names.iter().map(|name| (*name).to_owned()).collect();
    texts.push((industries.clone(), Choices { columns: all, ..Choices::default() }));
    let mut random = Random(7);
    // Of a day: the mean and the deviation of stocks, single stocks, bonds and short bonds.
    for (mean, deviation) in [(0.0004, 0.011), (0.0006, 0.03), (0.0002, 0.003), (0.0001, 0.0007)] {
        for count in [60, 250, 5000] {
            let normal = |random: &mut Random| (0..12).map(|_| random.next()).sum::<f64>() - 6.0;
            let returns = (0..count).map(|_| mean + deviation * normal(&mut random));
            let text: String = returns.map(|value| format!("{value:.6}\n")).collect();
            texts.push((text, Choices::default()));
        }
    }
    for (text, choices) in texts {
        let found = read(&text, &choices);
        let Reading::Read(record) = found else { panic!("{choices:?}: {found:?}") };
        assert!(record.sentence.contains("as fractions"), "{}", record.sentence);
    }
}

/// Every column needs a mean and a deviation of its own.
#[test]
fn a_column_of_a_single_return_is_refused_by_name() {
    let old: Vec<String> = (0..24).map(|month| format!("{:.2}", 100.0 + f64::from(month % 5))).collect();
    let rows = |from: usize| -> String {
        let row = |(month, price): (usize, &String)| {
            let young = if month < from { "" } else { "50.1" };
            format!("{}-{:02}-28,{price},{young}\n", 2010 + month / 12, 1 + month % 12)
        };
        old.iter().enumerate().map(row).collect()
    };
    let choices = Choices {
        columns: vec!["old".into(), "young".into()],
        kind: Some(Kind::Price),
        unequal: Some(true),
        ..Choices::default()
    };
    for from in [22, 23] {
        let Reading::Refused { sentence, .. } = read(&format!("date,old,young\n{}", rows(from)), &choices) else {
            panic!("{from}")
        };
        assert_eq!(sentence, "Column young needs at least two returns, or three prices.");
    }
}

/// An asset that begins twenty months later is asked about: the older rows are left out, or it keeps its own beginning. In
/// either order of the rows, and as returns or as prices, the same returns are read.
#[test]
fn a_column_that_begins_later_is_asked_about() {
    let level = |month: usize, asset: f64| 100.0 + (asset * month as f64).sin() * 4.0;
    for (is_price, is_turned) in [(true, false), (true, true), (false, false), (false, true)] {
        let cell = |month: usize, asset: f64| match is_price {
            true => format!("{:.4}", level(month, asset)),
            false => format!("{:.6}", level(month + 1, asset) / level(month, asset) - 1.0),
        };
        let row = |month: usize| {
            let young = if month < 20 { String::new() } else { cell(month, 0.7) };
            format!("{}-{:02}-28,{},{young}", 2010 + month / 12, 1 + month % 12, cell(month, 1.3))
        };
        let mut rows: Vec<String> = (0..60).map(row).collect();
        if is_turned {
            rows.reverse();
        }
        let text = format!("date,old,young\n{}\n", rows.join("\n"));
        let chosen = Choices { columns: vec!["old".into(), "young".into()], ..Choices::default() };
        let Reading::Asked { questions, .. } = read(&text, &chosen) else { panic!("{text}") };
        assert_eq!(questions.iter().map(|one| one.asks).collect::<Vec<&str>>(), ["unequal"]);
        assert!(questions[0].question.contains("Column young has its oldest number in line"), "{questions:?}");
        let with = |unequal: bool| match read(&text, &Choices { unequal: Some(unequal), ..chosen.clone() }) {
            Reading::Read(record) => record,
            other => panic!("{other:?}"),
        };
        let (common, whole, lost) = (with(false), with(true), usize::from(is_price));
        let lengths = |record: &Record| record.series.iter().map(|one| one.log_returns.len()).collect::<Vec<usize>>();
        assert_eq!((lengths(&common), lengths(&whole)), (vec![40 - lost; 2], vec![60 - lost, 40 - lost]));
        assert_eq!(whole.series.iter().map(|one| one.missing).collect::<Vec<usize>>(), [0, 20]);
        assert_eq!(whole.series[1].log_returns, common.series[1].log_returns);
        assert_eq!(whole.series[0].log_returns[20..], common.series[0].log_returns);
        assert_eq!(whole.dates.unwrap().len(), 60 - lost);
    }
}
