//! The letter to a client: its figures computed again here, its words, and that no text becomes markup.

use crate::support::values::number;
use crate::support::{App, several_assets, specification};
use reqwest::StatusCode;
use reqwest::header::HeaderMap;
use serde_json::{Value, json};

const RATE: f64 = 0.002;
const COST: f64 = 0.001;
/// Share held through every period.
const HELD: f64 = 0.5;
const START: f64 = 10_000.0;
/// Simple return, last day and money added in each month; the first of them ends a year.
const MONTHS: [(f64, &str, f64); 3] =
    [(0.04, "2025-12-31", 0.0), (-0.1, "2026-01-31", 5000.0), (0.02, "2026-02-28", -300.0)];
const HOSTILE: &str = "<script>alert(\"1\")</script>";

/// Returns a session of one asset with trading costs and dates, after the months.
async fn lived() -> App {
    let mut app = App::start().await;
    let mut request = specification(6);
    for (field, value) in [("rate_per_step", RATE), ("trading_cost", COST), ("periods_per_year", 12.0)] {
        request["problem"][field] = json!(value);
    }
    request["problem"]["radius"]["scale"] = json!(0.05);
    request["problem"]["utility"] = json!({ "kind": "power", "risk_aversion": 3.0 });
    request["name"] = json!("World, monthly");
    app.train(&request).await;
    // A record that pays for what it risks, also after the months.
    let history = [0.06, 0.02, 0.05, 0.03, 0.07, 0.01, 0.04, 0.05];
    app.open_with(json!({ "name": "Clara Client", "wealth": START, "history": history })).await;
    for (period, (simple_return, date, flow)) in (1..).zip(MONTHS) {
        let report = json!({ "simple_return": simple_return, "date": date, "flow": flow, "executed_allocation": HELD, "confirm": true });
        assert_eq!(app.report(period, report).await.0, 200);
    }
    app
}

async fn answer(app: &App, path: &str, body: &Value) -> (StatusCode, HeaderMap, String) {
    let answer = app.client.post(format!("{}{path}", app.url)).json(body).send().await.expect("an answer");
    let (status, headers) = (answer.status(), answer.headers().clone());
    (status, headers, answer.text().await.expect("a body").replace(['\u{a0}', '\u{202f}'], " "))
}

/// Returns the letter of the session, with plain spaces and hyphens.
async fn letter(app: &App, body: Value) -> String {
    let (status, _, text) = answer(app, &format!("/sessions/{}/letter", app.session), &body).await;
    assert_eq!(status, 200, "{text}");
    text.replace('\u{2212}', "-")
}

/// Returns the value of a fact and its note.
fn fact(letter: &str, name: &str) -> (String, String) {
    let rest = letter.split(&format!("<dt>{name}</dt><dd>")).nth(1).unwrap_or_else(|| panic!("{name} in {letter}"));
    let of_fact = rest.split("</div>").next().unwrap();
    let (value, note) = of_fact.split_once("</dd>").unwrap();
    let note = note.trim_start_matches("<dd class=\"note\">").trim_end_matches("</dd>");
    (value.to_owned(), note.to_owned())
}

/// Returns the number that a text begins with.
fn read(text: &str) -> f64 {
    let digits: String = text
        .replace(',', "")
        .chars()
        .take_while(|letter| letter.is_ascii_digit() || ['.', '-'].contains(letter))
        .collect();
    digits.parse().unwrap_or_else(|_| panic!("{text} is no number"))
}

/// Returns the text after `before`, up to the next tag or sentence.
fn after<'a>(letter: &'a str, before: &str) -> &'a str {
    letter.split(before).nth(1).unwrap_or_else(|| panic!("{before} in {letter}"))
}

/// Returns wealth and the share in stocks after the months, with `share` restored before each, from nothing held; and the
/// growth of each month.
fn followed(share: f64) -> (f64, Vec<f64>) {
    let (mut wealth, mut holding, mut growths) = (START, 0.0, Vec::new());
    for (back, _, flow) in MONTHS {
        let growth = (1.0 - COST * f64::abs(share - holding)) * ((1.0 - share) * (1.0 + RATE) + share * (1.0 + back));
        let risky = wealth * (1.0 - COST * f64::abs(share - holding)) * share * (1.0 + back);
        wealth = wealth * growth + flow;
        holding = risky / wealth;
        growths.push(growth);
    }
    (wealth, growths)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_figures_of_a_letter_are_those_of_the_session() {
    let app = lived().await;
    let text = letter(&app, json!({ "currency": "EUR", "date": "2026-03-02" })).await;
    for words in [
        "<title>Letter to Clara Client</title>",
        "<h2>Clara Client</h2><p>2 Mar 2026</p>",
        "Policy: World, monthly. Amounts in EUR.",
        "What to hold in March 2026",
        "Returns are time-weighted",
    ] {
        assert!(text.contains(words), "{words} in {text}");
    }
    // Returns, whatever money came and went.
    let (wealth, growths) = followed(HELD);
    let product = |from: usize| growths[from..].iter().product::<f64>() - 1.0;
    for (name, value) in [("February 2026", product(2)), ("2026 so far", product(1)), ("Since the start", product(0))] {
        let sign = if value > 0.0 { "+" } else { "" };
        assert_eq!(fact(&text, name), (format!("{sign}{:.1} %", 100.0 * value), String::new()));
    }
    let fall = growths[1] - 1.0;
    let expected = (format!("{:.1} %", 100.0 * fall), "from December 2025 to January 2026".to_owned());
    assert_eq!(fact(&text, "Worst fall so far"), expected);
    let moved = ("EUR 4,700.00".to_owned(), "EUR 5,000.00 added, EUR 300.00 withdrawn".to_owned());
    assert_eq!(fact(&text, "Added, less withdrawn"), moved);
    let (shown, note) = fact(&text, "Wealth");
    assert_eq!(note, "at the end of February 2026");
    assert!((read(&shown[4..]) - wealth).abs() < 0.0051, "{shown} for {wealth}");
    // The comparators from the same start.
    for (before, words, share) in [
        ("would have come to EUR ", "all in the bank", 0.0),
        ("all in the bank, EUR ", "at 60/40", 0.6),
        ("at 60/40 and EUR ", "all in stocks.", 1.0),
    ] {
        let rest = after(&text, before);
        let (end, _) = followed(share);
        assert!(rest.contains(words) && (read(rest) - end).abs() < 0.0051, "{words}: {rest:.60} for {end}");
    }
    // The trade, in money.
    let (_, action) = app.action().await;
    let [allocation, holding, trade] = ["allocation", "holding", "trade"].map(|field| number(&action[field]));
    assert!(trade.abs() > 0.0005, "the test needs a trade: {action}");
    let whole = wealth * (1.0 - COST * trade.abs());
    let amount = allocation * whole - holding * wealth;
    let verb = if amount > 0.0 { "Buy" } else { "Sell" };
    let bought = read(after(&text, &format!("<b>{verb} EUR ")));
    assert!((bought - amount.abs()).abs() < 0.0051, "{bought} for {amount}");
    let aim = read(after(&text, "That makes EUR "));
    assert!((aim - allocation * whole).abs() < 0.0051, "{aim}");
    assert!(text.contains(&format!("of stocks, {:.1} % of your wealth", 100.0 * amount.abs() / wealth)), "{text}");
    // The chart ends at the wealth.
    assert_eq!(text.matches("class=\"line s0\" d=").count(), 1);
    assert_eq!(text.matches("<circle").count(), MONTHS.len() + 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_reasons_are_those_of_the_action_and_small_trades_are_left_out() {
    let app = lived().await;
    let path = format!("/sessions/{}/letter", app.session);
    let (status, headers, text) = answer(&app, &format!("{path}?sensitivity=true"), &json!({})).await;
    assert_eq!(status, 200, "{text}");
    let (_, action) = app.get(&format!("/action?session={}&sensitivity=true", app.session)).await;
    let sure = after(&text, "this is worth as much as a sure <b>");
    assert!((read(sure) - number(&action["certainty_equivalent"])).abs() < 0.0051, "{sure:.40}");
    assert!(sure.contains(" at the end of May 2026; all in the bank comes to <b>"), "{text}");
    // The worst month reported is worse than all of the record.
    let worst = MONTHS.iter().map(|(simple_return, ..)| *simple_return).fold(f64::INFINITY, f64::min);
    let held = number(&action["allocation"]);
    let cost = -(held * worst + (1.0 - held) * RATE) * followed(HELD).0;
    let told =
        after(&text, &format!("a month like the worst in the record, \u{2212}{:.1} %, would cost <b>", -100.0 * worst));
    assert!((read(told) - cost).abs() < 0.0051, "{told:.40} for {cost}");
    let sentences = action["sensitivity"]["sentences"].as_array().unwrap();
    let why = after(&text, "<h3>Why</h3>").replace('\u{2212}', "-");
    let named = sentences.iter().filter(|sentence| why.contains(sentence.as_str().unwrap())).count();
    assert_eq!((named, why.matches("<p>").count()), (1, 2), "{why}");
    // Without it there is one reason.
    let (_, _, short) = answer(&app, &path, &json!({})).await;
    assert_eq!(after(&short, "<h3>Why</h3>").matches("<p>").count(), 1);
    assert!(headers["ballast-trades"].to_str().unwrap().starts_with(['B', 'S']), "{headers:?}");
    assert_eq!(headers["content-type"], "text/html; charset=utf-8");
    for smallest in [json!({ "amount": 1e6 }), json!({ "share": 0.99 })] {
        let (_, headers, text) = answer(&app, &path, &json!({ "smallest_trade": smallest })).await;
        assert!(text.contains("<b>Nothing to trade</b>: you hold "), "{text}");
        assert_eq!(headers["ballast-trades"], "Nothing");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_correction_changes_the_letter() {
    let app = lived().await;
    let correction = json!({ "correction": 1, "period": 2, "simple_return": 0.05, "date": "2026-01-31", "flow": 5000.0,
        "executed_allocation": HELD, "reason": "a slip", "confirm": true });
    assert_eq!(app.post(&format!("/sessions/{}/corrections", app.session), &correction).await.0, 200);
    let text = letter(&app, json!({})).await;
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    assert!((read(&fact(&text, "Wealth").0) - number(&session["wealth"])).abs() < 0.0051);
    assert_eq!(fact(&text, "Worst fall so far"), ("None".to_owned(), "never below its highest".to_owned()));
    let (_, before) = followed(HELD);
    let now = [before[0], before[1] + 0.5 * 0.15, before[2]].iter().product::<f64>() - 1.0;
    assert!((read(&fact(&text, "Since the start").0[1..]) - 100.0 * now).abs() < 0.06, "{text}");
}

#[tokio::test(flavor = "multi_thread")]
async fn several_assets_stand_in_a_table_and_their_trades_add_up() {
    let mut app = App::start().await;
    let mut request = several_assets(3);
    request["problem"]["trading_cost"] = json!(COST);
    app.train(&request).await;
    let holdings = json!({ "stocks": 0.5, "bonds": 0.1, "gold": 0.2 });
    app.open_with(json!({ "name": "A fund", "wealth": 200_000.0, "holdings": holdings })).await;
    let returns = json!({ "stocks": 0.02, "bonds": -0.01, "gold": 0.0 });
    let report = json!({ "simple_returns": returns, "executed_allocations": holdings, "confirm": true });
    let (_, observed) = app.report(1, report).await;
    let text = letter(&app, json!({})).await;
    assert!(text.contains("Fund of stocks, bonds, gold."), "{text}");
    let (_, action) = app.action().await;
    let wealth = number(&observed["wealth"]);
    let turnover: f64 = action["trade"].as_object().unwrap().values().map(|trade| number(trade).abs()).sum();
    let mut sums = [0.0, 0.0];
    for name in ["stocks", "bonds", "gold"] {
        let [share, held, trade] = ["allocation", "holdings", "trade"].map(|field| number(&action[field][name]));
        let amount = share * wealth * (1.0 - COST * turnover) - held * wealth;
        let row = after(&text, &format!("<tr><th scope=\"row\">{name}</th>")).split("</tr>").next().unwrap().to_owned();
        if trade.abs() < 0.0005 {
            assert!(row.ends_with("<td class=\"number\">Nothing</td>"), "{row}");
            continue;
        }
        let (side, verb) = if amount > 0.0 { (0, "Buy ") } else { (1, "Sell ") };
        sums[side] += amount.abs();
        assert!((read(after(&row, verb)) - amount.abs()).abs() < 0.51, "{row} for {amount}");
    }
    let [bought, sold] = sums;
    assert!(bought + sold > 0.0, "the test needs trades: {action}");
    let part = format!("in all, {:.1} % of your wealth.", 100.0 * (bought + sold) / wealth);
    assert!(text.contains(&part), "{part} in {text}");
    // The whole of the fund in the assets that it held, from a start that costs nothing to reach.
    let line = after(&text, "All in the assets <b>");
    let held = (0.5 * 1.02 + 0.1 * 0.99 + 0.2) / 0.8;
    let expected = 200_000.0 * (1.0 - COST * 0.2) * held;
    assert!((read(line) - expected).abs() < 0.51, "{line:.20} for {expected}");
    for name in ["Equal weights", "First composition"] {
        assert_eq!(text.matches(name).count(), 1, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_completed_session_ends_with_its_wealth_and_a_new_one_has_no_course() {
    let mut app = App::start().await;
    app.train(&specification(1)).await;
    app.open().await;
    let text = letter(&app, json!({})).await;
    assert!(text.contains("No return is reported yet. The start is 100.00."), "{text}");
    assert!(text.contains(&format!("<h2>Client {}</h2>", &app.session[8..18])), "{text}");
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    let text = letter(&app, json!({})).await;
    let (_, session) = app.get(&format!("/sessions/{}", app.session)).await;
    let ended = read(after(&text, "It ended with <b>"));
    assert!((ended - number(&session["wealth"])).abs() < 0.0051, "{ended}");
    assert!(text.contains("The bank alone would have reached 100.20."), "{text}");
    assert!(!text.contains("<h3>Why</h3>") && text.contains("<h3>Completed</h3>"), "{text}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_policy_that_spends_says_what_to_spend_first() {
    let mut app = App::start().await;
    let mut request = specification(3);
    request["problem"]["spending"] = json!({});
    request["problem"]["utility"] = json!({ "kind": "power", "risk_aversion": 3.0 });
    app.train(&request).await;
    app.open().await;
    let (_, action) = app.action().await;
    let text = letter(&app, json!({})).await;
    let spent = read(after(&text, "<b>Spend "));
    assert!((spent - number(&action["spending"]["amount"])).abs() < 0.0051, "{spent} {action}");
    assert!(
        text.contains(" of the rest in stocks, and ") && text.contains("spent every period, in money of now"),
        "{text}"
    );
    assert_eq!(app.report(1, json!({ "log_return": 0.01, "confirm": true })).await.0, 200);
    let (_, history) = app.get(&format!("/sessions/{}/history", app.session)).await;
    let account = &history["observations"][0]["account"];
    let text = letter(&app, json!({})).await;
    assert!((read(&fact(&text, "Spent").0) - number(&account["spent"])).abs() < 0.0051, "{text}");
    let end = number(&history["observations"][0]["wealth"]) / (100.0 - number(&account["spent"])) - 1.0;
    assert!((read(&fact(&text, "Since the start").0.replace('+', "")) - 100.0 * end).abs() < 0.06, "{text}");
}

#[tokio::test(flavor = "multi_thread")]
async fn no_text_becomes_markup_and_nothing_is_run_or_loaded() {
    let mut app = App::start().await;
    let mut request = several_assets(2);
    request["problem"]["assets"] = json!([HOSTILE, "a & b", "'c'"]);
    request["name"] = json!(HOSTILE);
    app.train(&request).await;
    app.open_with(json!({ "name": HOSTILE })).await;
    let logo = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";
    let firm = json!({ "name": HOSTILE, "closing": HOSTILE, "disclaimer": HOSTILE, "logo": logo });
    let path = format!("/sessions/{}/letter", app.session);
    let (status, headers, text) = answer(&app, &path, &json!({ "firm": firm })).await;
    assert_eq!(status, 200, "{text}");
    assert!(!text.contains("<script") && !text.contains("alert(\""), "{text}");
    assert!(text.matches("&lt;script&gt;").count() >= 8, "{text}");
    assert!(text.contains("a &amp; b") && text.contains("&#39;c&#39;"), "{text}");
    assert!(text.contains(&format!("<img class=\"logo\" src=\"{logo}\" alt=\"Logo of &lt;script&gt;")), "{text}");
    for outside in ["http:", "https:", "url(", "@import", " style=", " onload=", "<link"] {
        assert!(!text.contains(outside), "{outside} in {text}");
    }
    let policy = headers["content-security-policy"].to_str().unwrap();
    assert!(policy.starts_with("default-src 'none'; style-src 'sha256-") && !policy.contains("unsafe"), "{policy}");
    assert!(text.contains(policy.split("; frame-ancestors").next().unwrap()), "{text}");
    assert_eq!(headers["cache-control"], "no-store");
    assert_eq!(headers["referrer-policy"], "no-referrer");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_field_out_of_its_range_is_named_and_another_problem_has_no_letter() {
    let mut app = App::start().await;
    app.train(&specification(2)).await;
    app.open().await;
    let path = format!("/sessions/{}/letter", app.session);
    let large = format!("data:image/png;base64,{}", "A".repeat(273_072));
    for (body, field) in [
        (json!({ "firm": { "name": "n".repeat(81) } }), "firm.name"),
        (json!({ "firm": { "name": "two\nlines" } }), "firm.name"),
        (json!({ "firm": { "closing": "n".repeat(201) } }), "firm.closing"),
        (json!({ "firm": { "disclaimer": "n".repeat(601) } }), "firm.disclaimer"),
        (json!({ "firm": { "logo": "data:image/png;base64,PHN2Zz4=" } }), "firm.logo"),
        (json!({ "firm": { "logo": "data:image/svg+xml;base64,PHN2Zz4=" } }), "firm.logo"),
        (json!({ "firm": { "logo": large } }), "firm.logo"),
        (json!({ "firm": { "motto": "" } }), "firm.motto"),
        (json!({ "currency": "eur" }), "currency"),
        (json!({ "currency": "EURO" }), "currency"),
        (json!({ "smallest_trade": { "amount": -1.0 } }), "smallest_trade.amount"),
        (json!({ "smallest_trade": { "share": 1.5 } }), "smallest_trade.share"),
        (json!({ "date": "2026-02-30" }), "date"),
        (json!({ "colour": 1 }), "colour"),
    ] {
        let (status, problem) = app.post(&path, &body).await;
        assert_eq!((status.as_u16(), &problem["field"]), (422, &json!(field)), "{problem}");
    }
    let (status, problem) = app.post(&format!("{path}?sensitivity=yes"), &json!({})).await;
    assert_eq!((status.as_u16(), &problem["field"]), (400, &json!("sensitivity")), "{problem}");
    assert_eq!(app.post("/sessions/42/letter", &json!({})).await.0, 404);

    let stock: Value = serde_json::from_str(include_str!("../../examples/problems/stock.json")).unwrap();
    let mut declared = stock;
    (declared["problem"]["horizon"], declared["design"]) = (json!(2), json!({ "count": 10 }));
    app.train(&declared).await;
    app.open().await;
    let (status, problem) = app.post(&format!("/sessions/{}/letter", app.session), &json!({})).await;
    assert_eq!((status.as_u16(), &problem["field"]), (422, &json!("session")), "{problem}");
}

/// The command writes a file for each session that is not completed, and goes on after one that is refused.
#[tokio::test(flavor = "multi_thread")]
async fn the_command_writes_a_letter_for_each_client() {
    let mut app = App::start().await;
    app.train(&specification(1)).await;
    app.open_with(json!({ "name": "Completed" })).await;
    assert_eq!(app.observe(1, 0.01).await.0, 200);
    let mut sessions = Vec::new();
    for name in ["Bea", "Ada"] {
        app.open_with(json!({ "name": name })).await;
        sessions.push(app.session.clone());
    }
    let key = app.key("default", "read").await;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(at("key.txt"), format!("{key}\n")).unwrap();
    std::fs::write(at("firm.json"), json!({ "name": "The firm" }).to_string()).unwrap();
    app.enter(&key).await;
    let url = app.url.clone();
    let run = |more: Vec<String>| {
        let files = [("--key-file", "key.txt"), ("--firm", "firm.json"), ("--out", "letters")];
        let files = files.into_iter().flat_map(|(option, name)| [option.to_owned(), at(name)]);
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ballast"));
        command.args(["letters", "--url", &url, "--currency", "EUR"]).args(files).args(more);
        tokio::task::block_in_place(|| command.output().unwrap())
    };
    let output = run(Vec::new());
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let (lines, errors) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{errors}");
    let heads: Vec<&str> = lines.lines().map(|line| line.split("  ").take(2).last().unwrap()).collect();
    assert_eq!(heads, ["Ada", "Bea"], "{lines}");
    let letter = std::fs::read_to_string(at(&format!("letters/{}.html", sessions[0]))).unwrap();
    assert!(letter.contains("<h2>Bea</h2>") && letter.contains("The firm") && letter.contains("Amounts in EUR."));
    assert_eq!(std::fs::read_dir(at("letters")).unwrap().count(), 2);
    let unknown = format!("session_{}", "0".repeat(32));
    let some = |session: &str| ["--session".to_owned(), session.to_owned()];
    let output = run([some(&unknown), some(&sessions[1])].concat());
    let (lines, errors) = (text(&output.stdout), text(&output.stderr));
    assert!(!output.status.success() && lines.starts_with(&sessions[1]), "{lines}{errors}");
    assert!(errors.contains(&format!("no letter to {unknown}: there is no session")), "{errors}");
    assert!(errors.contains("1 of 2 letters could not be written"), "{errors}");
}
