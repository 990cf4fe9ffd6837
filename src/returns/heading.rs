//! The meaning of a column's heading, read from its words alone, in any case and in the languages of vendors' files.

/// Headings of the risky asset that are tried before those in `PRICES`, the best first: headings that include dividends
/// come before those that may not. Programs write these headings, so no question is asked about them.
const HEADINGS: [&str; 14] = [
    "return",
    "returns",
    "riskyreturn",
    "marketreturn",
    "simplereturn",
    "totalreturn",
    "ret",
    "rendite",
    "rendement",
    "adjclose",
    "adjustedclose",
    "close",
    "closelast",
    "price",
];
/// Words in a heading of returns.
const RETURNS: [&str; 15] = [
    "ret",
    "return",
    "returns",
    "perf",
    "performance",
    "gain",
    "gains",
    "change",
    "chg",
    "pct",
    "percent",
    "yield",
    "rendite",
    "rendement",
    "wertentwicklung",
];
/// Words in a heading of prices. Each may also be the whole heading; the best come first.
const PRICES: [&str; 11] = [
    "nav",
    "kurs",
    "schlusskurs",
    "cours",
    "cloture",
    "cl\u{f4}ture",
    "dernier",
    "zamkniecie",
    "zamkni\u{119}cie",
    "settle",
    "last",
];
const LEVELS: [&str; 4] = ["level", "index", "value", "adj"];
/// Words in a heading of gains since the start of a record.
const CUMULATED: [&str; 10] = [
    "cum",
    "cumul",
    "cumulative",
    "cumulated",
    "cumret",
    "cumreturn",
    "cumreturns",
    "compsum",
    "kumuliert",
    "kumulierte",
];
/// Words in a heading of gains over a span other than the row's own.
const OTHER_SPAN: [&str; 9] =
    ["ytd", "qtd", "mtd", "trailing", "rolling", "annualized", "annualised", "inception", "itd"];
/// Words in a heading of gains in excess of the bank's.
const EXCESS: [&str; 7] = ["excess", "xret", "exret", "rmrf", "mktrf", "xsret", "active"];
/// Currencies that a heading may add to its name.
const CURRENCIES: [&str; 14] =
    ["usd", "eur", "gbp", "gbx", "chf", "jpy", "cad", "aud", "pln", "sek", "nok", "dkk", "usdt", "btc"];
/// Headings of prices other than the last one of the day, and of payments that are listed with them.
const OTHER_PRICES: [&str; 49] = [
    "open",
    "opening",
    "openprice",
    "openingprice",
    "dayopen",
    "erster",
    "eroeffnung",
    "er\u{f6}ffnung",
    "er\u{f6}ffnungskurs",
    "ouverture",
    "apertura",
    "otwarcie",
    "high",
    "highprice",
    "dayhigh",
    "hoch",
    "hoechst",
    "h\u{f6}chst",
    "h\u{f6}chstkurs",
    "tageshoch",
    "haut",
    "plushaut",
    "alto",
    "maximo",
    "m\u{e1}ximo",
    "max",
    "najwyzszy",
    "najwy\u{17c}szy",
    "low",
    "lowprice",
    "daylow",
    "tief",
    "tiefst",
    "tiefstkurs",
    "tagestief",
    "bas",
    "plusbas",
    "bajo",
    "minimo",
    "m\u{ed}nimo",
    "min",
    "najnizszy",
    "najni\u{17c}szy",
    "dividend",
    "dividends",
    "dividende",
    "stocksplits",
    "splits",
    "capitalgains",
];
/// Headings of counts of shares or trades, or of the money traded.
const COUNTS: [&str; 34] = [
    "vol",
    "umsatz",
    "stuck",
    "stueck",
    "st\u{fc}ck",
    "st\u{fc}cke",
    "shares",
    "sharestraded",
    "sharesoutstanding",
    "numberofshares",
    "noofshares",
    "quantity",
    "qty",
    "menge",
    "anzahl",
    "anzahlst\u{fc}ck",
    "nombre",
    "nombredetitres",
    "titres",
    "trades",
    "tradecount",
    "nooftrades",
    "numberoftrades",
    "transactions",
    "turnover",
    "openinterest",
    "openint",
    "liczba",
    "obrot",
    "obr\u{f3}t",
    "obroty",
    "ilosc",
    "count",
    "totalvolume",
];
const VOLUMES: [&str; 6] = ["volume", "volumes", "volumen", "wolumen", "volumefrom", "volumeto"];
/// Research factors: the gain of one portfolio over another.
const FACTORS: [&str; 6] = ["smb", "hml", "rmw", "cma", "umd", "wml"];

/// The span of the gains under a heading, if it is not the time since the row before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GainSpan {
    SinceStart,
    Other,
}

/// The meaning of a heading.
pub struct ColumnHeading {
    pub is_log: bool,
    pub is_return: bool,
    pub is_price: bool,
    pub is_level: bool,
    pub span: Option<GainSpan>,
    pub is_excess: bool,
}

fn words(name: &str) -> Vec<String> {
    let lower = name.to_lowercase();
    let words = lower.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_owned).collect()
}

/// Returns a heading without what vendors add to it: `4. close`, `PX_LAST` and `Close (EUR)` become `close`, `last` and
/// `close`.
pub fn core(name: &str) -> String {
    let mut words = words(name);
    if words.len() > 1 && words[0].bytes().all(|byte| byte.is_ascii_digit()) {
        words.remove(0);
    }
    if words.len() > 1 {
        words.retain(|word| word != "px" && !CURRENCIES.contains(&word.as_str()));
    }
    words.concat()
}

/// Returns the headings of the risky asset, the best first.
pub fn headings() -> impl Iterator<Item = &'static str> {
    HEADINGS.into_iter().chain(PRICES)
}

/// Returns the reason why a column with this heading holds neither returns nor prices of an asset, as the end of a
/// sentence.
pub fn aside(name: &str) -> Option<&'static str> {
    let core = core(name);
    let is = |headings: &[&str]| headings.contains(&core.as_str());
    if is(&COUNTS) || words(name).iter().any(|word| VOLUMES.contains(&word.as_str())) {
        Some("holds the traded volume")
    } else if is(&OTHER_PRICES) {
        Some("holds neither returns nor the last price of each period")
    } else if is(&FACTORS) {
        Some("holds the gain of one portfolio over another")
    } else {
        None
    }
}

/// Returns true for a horizon such as 1Y, 12m or 3yr.
fn is_horizon(word: &str) -> bool {
    let unit = word.trim_start_matches(|letter: char| letter.is_ascii_digit());
    unit.len() < word.len() && ["y", "yr", "m", "mo"].contains(&unit)
}

impl ColumnHeading {
    pub fn of(name: &str) -> Self {
        let (lower, words) = (name.to_lowercase(), words(name));
        let has = |listed: &[&str]| words.iter().any(|word| listed.contains(&word.as_str()));
        let is_return = name.contains('%') || has(&RETURNS);
        let is_span =
            has(&OTHER_SPAN) || (words.iter().any(|word| is_horizon(word)) && (is_return || words.len() == 1));
        let is_beyond_bank = words.len() > 1 && words.last().is_some_and(|word| word == "rf");
        ColumnHeading {
            is_log: words.iter().any(|word| ["log", "ln"].contains(&word.as_str()) || word.starts_with("logret")),
            is_return,
            is_price: !is_return && (["price", "close"].iter().any(|word| lower.contains(word)) || has(&PRICES)),
            is_level: LEVELS.iter().any(|word| lower.contains(word)),
            span: if has(&CUMULATED) { Some(GainSpan::SinceStart) } else { is_span.then_some(GainSpan::Other) },
            is_excess: is_beyond_bank || has(&EXCESS),
        }
    }
}
