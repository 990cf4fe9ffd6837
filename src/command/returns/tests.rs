use super::*;

fn read(text: &str) -> Result<Returns, ReturnsError> {
    Returns::parse(text, None, None)
}

/// The bank pays nothing.
fn without_bank(text: &str) -> Result<Returns, ReturnsError> {
    Returns::parse(text, Some(0.0), None)
}

#[test]
fn the_bundled_file_is_whole() {
    let market = Returns::bundled().unwrap();
    assert_eq!((market.rows.len(), market.frequency, market.periods_per_year), (1109, Frequency::Monthly, 12));
    assert_eq!(market.year("2008").len(), 12);
    let history = market.before("2008-01", 240).unwrap();
    assert_eq!((history[0].date.as_str(), history[239].date.as_str()), ("1988-01", "2007-12"));
    assert_eq!(history[239].risk_free_return, 0.0027);
    assert_eq!(market.year("2008")[9].risky_return, -0.1715);
    let message = market.before("1927-01", 240).unwrap_err().to_string();
    assert_eq!(message, "240 months before 1927-01 are wanted: the file holds 6");
}

/// Files that mean the same three returns of the year 2008, +1 %, -2 % and +3 %, at one frequency or another: the text, then
/// the frequency, the first and last date and the column as they are to be told.
const GOOD: [(&str, &str, &str); 18] = [
    ("date,return\n2008-01,0.01\n2008-02,-0.02\n2008-03,0.03\n", "monthly", "2008-01 to 2008-03, as in column return"),
    (
        "Month;Market_Return\n2008-01-31; 0.01\n2008-02-29; -0.02\n2008-03-31; 0.03",
        "monthly",
        "2008-01 to 2008-03, as in column Market_Return",
    ),
    (
        "\u{feff}DATE\tRisky Return\r\n2008/01\t0.01\r\n2008/02\t-.02\r\n2008/03\t3e-2\r\n",
        "monthly",
        "2008-01 to 2008-03, as in column Risky Return",
    ),
    (
        "open,ret,\"timestamp\"\n7,\"0.01\",2008-01-31T00:00:00\n7,-0.02,2008-02-29T00:00:00\n7,+0.03,2008-03-31T00:00:00\n",
        "monthly",
        "2008-01 to 2008-03, as in column ret",
    ),
    // The last days on which exchanges were open, as some programs write them.
    (
        "Date,Close,Adj Close\n2007-12-31 00:00:00-05:00,1,100\n2008-01-31 00:00:00-05:00,1,101\n2008-02-29 00:00:00-05:00,1,98.98\n2008-03-31 00:00:00-04:00,9,101.9494\n",
        "monthly",
        "2008-01 to 2008-03, of prices in column Adj Close",
    ),
    (
        "date,price\n2007-12-31Z,100\n2008-01-31Z,101\n2008-02-29Z,98.98\n2008-03-31Z,101.9494\n",
        "monthly",
        "2008-01 to 2008-03, of prices in column price",
    ),
    (
        "price,return,date\n1,0.01,2008-01\n1,-0.02,2008-02\n1,0.03,2008-03\n",
        "monthly",
        "2008-01 to 2008-03, as in column return",
    ),
    // Thursday, Friday, and a Tuesday after a Monday's holiday.
    (
        "date,close/last\n2008-01-16,100\n2008-01-17,101\n2008-01-18,98.98\n2008-01-22,101.9494\n",
        "daily",
        "2008-01-17 to 2008-01-22, of prices in column close/last",
    ),
    (
        "day,return\n2008-01-21,0.01\n2008-01-22,-0.02\n2008-01-23,0.03\n",
        "daily",
        "2008-01-21 to 2008-01-23, as in column return",
    ),
    // An exchange rests for the longest of holidays.
    (
        "date,return\n2008-09-29,0.01\n2008-09-30,-0.02\n2008-10-12,0.03\n",
        "daily",
        "2008-09-29 to 2008-10-12, as in column return",
    ),
    // Saturday and Sunday among the days: a market that never closes.
    (
        "date,return\n2008-01-19,0.01\n2008-01-20,-0.02\n2008-01-21,0.03\n",
        "daily",
        "2008-01-19 to 2008-01-21, as in column return",
    ),
    // Fridays, and the Thursday before Good Friday.
    (
        "week,returns\n2008-03-14,0.01\n2008-03-20,-0.02\n2008-03-28,0.03\n",
        "weekly",
        "2008-03-14 to 2008-03-28, as in column returns",
    ),
    (
        "quarter,simple_return\n2008-03-31,0.01\n2008-06-30,-0.02\n2008-09-30,0.03\n",
        "quarterly",
        "2008-03 to 2008-09, as in column simple_return",
    ),
    (
        "date,total return\n2008-01,0.01\n2008-04,-0.02\n2008-07,0.03\n",
        "quarterly",
        "2008-01 to 2008-07, as in column total return",
    ),
    ("year,return\n2006,0.01\n2007,-0.02\n2008,0.03\n", "yearly", "2006 to 2008, as in column return"),
    (
        "date,NAV\n2005-12-30,100\n2006-12-29,101\n2007-12-31,98.98\n2008-12-31,101.9494\n",
        "yearly",
        "2006 to 2008, of prices in column NAV",
    ),
    // Blank lines are none, and columns that nothing is known of do not count.
    (
        "note,date,return\n?,2008-01,0.01\n\n%,2008-02,-0.02\n\"a,b\",2008-03,0.03\n\n",
        "monthly",
        "2008-01 to 2008-03, as in column return",
    ),
    (
        "date,Adjusted_Close\n20071231,100\n20080131,101\n20080229,98.98\n20080331,101.9494\n",
        "monthly",
        "2008-01 to 2008-03, of prices in column Adjusted_Close",
    ),
];

#[test]
fn the_same_returns_are_read_from_many_files() {
    for (text, adjective, said) in GOOD {
        let returns = without_bank(text).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(returns.rows.len(), 3, "{text}");
        for (row, expected) in returns.rows.iter().zip([0.01, -0.02, 0.03]) {
            // Prices are of six decimals.
            assert!((row.risky_return - expected).abs() < 1e-12, "{row:?} of {text}");
            assert_eq!(row.risk_free_return, 0.0);
        }
        let sentence = returns.sentence();
        assert!(sentence.starts_with(&format!("3 {adjective} returns, {said}.\n")), "{sentence} of {text}");
    }
}

/// Texts, and all that is said of them.
const BAD: [(&str, &str); 34] = [
    ("", "line 1: the header is \"\": must name a column of dates: date, month or another length of time"),
    ("a,b\n", "line 1: the header is \"a,b\": must name a column of dates: date, month or another length of time"),
    (
        "date,open\n",
        "line 1: the header is \"date,open\": must name a column of returns (return, risky_return, market_return) or of prices (adj close, close, price)",
    ),
    ("date,return\n", "the file holds 0 returns: must hold at least 2"),
    ("date,close\n2008-01,100\n2008-02,101\n", "the file holds 1 returns: must hold at least 2"),
    (
        "date,return\n2008-01",
        "line 2: \"2008-01\" has 1 fields: must have 2, as the header (a decimal comma parts a number in two)",
    ),
    (
        "date,return\n2008-01,0,01\n",
        "line 2: \"2008-01,0,01\" has 3 fields: must have 2, as the header (a decimal comma parts a number in two)",
    ),
    (
        "date;return\n2008-01;0,01\n",
        "line 2: return is \"0,01\": must be a number with a decimal point and no comma, as 0.012 or 1234.5",
    ),
    (
        "date,close\n2008-01,\"1,234.5\"\n",
        "line 2: close is \"1,234.5\": must be a number with a decimal point and no comma, as 0.012 or 1234.5",
    ),
    (
        "date,return\n2008-01,1.2 %\n",
        "line 2: return is \"1.2 %\": must be a fraction without a percent sign: 1.2 % is 0.012",
    ),
    (
        "date,return\n2008-01,0.01\n2008-02,-1.2\n",
        "line 3: return is \"-1.2\": must be a fraction from -0.99 to 1: 0.012 is 1.2 % (of an asset that gained more, give prices)",
    ),
    (
        "date,return\n2008-01,1.01\n",
        "line 2: return is \"1.01\": must be a fraction from -0.99 to 1: 0.012 is 1.2 % (of an asset that gained more, give prices)",
    ),
    ("date,return\n2008-01,nan\n", "line 2: return is \"nan\": must be a number"),
    ("date,return\n2008-01,\n", "line 2: return is \"\": must be a number"),
    ("date,Close\n2008-01,null\n", "line 2: Close is \"null\": must be a number"),
    ("date,Close\n2008-01,0\n", "line 2: Close is \"0\": must be above 0"),
    ("date,Close\n2008-01,10\n2008-02,inf\n", "line 3: Close is \"inf\": must be a number"),
    (
        "date,Close\n2008-01,10\n2008-02,1001\n",
        "line 3: Close is \"1001\": must be between a hundredth and a hundred times 10, the price before",
    ),
    (
        "date,return\n2008-13,0.1\n",
        "line 2: date is \"2008-13\": must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008",
    ),
    (
        "date,return\n2008-02-30,0.1\n",
        "line 2: date is \"2008-02-30\": must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008",
    ),
    (
        "date,return\n01/31/2008,0.1\n",
        "line 2: date is \"01/31/2008\": must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008",
    ),
    (
        "date,return\n31.01.2008,0.1\n",
        "line 2: date is \"31.01.2008\": must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008",
    ),
    (
        "date,return\nJan-20,0.1\n",
        "line 2: date is \"Jan-20\": must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008",
    ),
    (
        "month,return\n1,0.1\n",
        "line 2: month is \"1\": must be a date with the year first, as 2008-01-31, 2008/01/31, 2008-01 or 2008",
    ),
    (
        "date,return\n2008-01,0.1\n2008-01,0.2\n",
        "line 3: date is \"2008-01\": must be later than 2008-01, the row before: rows go from the oldest to the newest, one a date",
    ),
    (
        "date,return\n2008-02-29,0.1\n2008-01-31,0.2\n",
        "line 3: date is \"2008-01-31\": must be later than 2008-02-29, the row before: rows go from the oldest to the newest, one a date",
    ),
    (
        "date,return\n2008-01-02T09:30,0.1\n2008-01-02T09:31,0.2\n",
        "line 3: date is \"2008-01-02T09:31\": must be later than 2008-01-02T09:30, the row before: rows go from the oldest to the newest, one a date",
    ),
    (
        "date,return\n2008-01,0\n2008-03,0\n",
        "line 3: date is \"2008-03\": is 60 days after 2008-01, the row before, where rows must be daily, weekly, monthly, quarterly or yearly",
    ),
    (
        "date,return\n2008-01,0\n2008-02,0\n2008-04,0\n2008-05,0\n",
        "line 4: date is \"2008-04\": must be the month after 2008-02: it is 60 days later, and the rows are monthly",
    ),
    (
        "date,return\n2008-01-31,0\n2008-02-29,0\n2008-03-31,0\n2008-04-01,0\n2008-05-30,0\n",
        "line 5: date is \"2008-04-01\": must be the month after 2008-03-31: it is 1 day later, and the rows are monthly",
    ),
    (
        "date,return\n2008-01-02,0\n2008-01-03,0\n2008-01-16,0\n2008-01-17,0\n",
        "line 4: date is \"2008-01-16\": must be the day after 2008-01-03, but for weekends and holidays: it is 13 days later, and the rows are daily",
    ),
    (
        "date,return\n2008-01-04,0\n2008-01-11,0\n2008-01-12,0\n2008-01-18,0\n",
        "line 4: date is \"2008-01-12\": must be the week after 2008-01-11: it is 1 day later, and the rows are weekly",
    ),
    (
        "date,return\n2008-01,0\n2008-04,0\n2008-07,0\n2008-11,0\n",
        "line 5: date is \"2008-11\": must be the quarter after 2008-07: it is 123 days later, and the rows are quarterly",
    ),
    (
        "date,return\n2008-01,0.9\n2008-02,-0.9\n2008-03,0.9\n",
        "the standard deviation of column return is 1.04 a period: must be at most 0.5, since returns are fractions (0.012 is 1.2 %); divide returns in per cent by 100, and name a column of prices price",
    ),
];

#[test]
fn a_bad_file_is_refused_by_line_column_value_and_rule() {
    for (text, expected) in BAD {
        let found = without_bank(text).map_or_else(|error| error.to_string(), |returns| returns.sentence());
        assert_eq!(found, expected, "{text}");
    }
}

#[test]
fn the_bank_is_a_column_or_an_option_and_never_left_out() {
    let file = |header: &str| format!("date,return{header}\n2008-01,0.01,0.002\n2008-02,0.03,0.001\n");
    for name in ["risk_free_return", "RF", "rate", "Risk-free", "risk free rate", "bank return"] {
        let returns = read(&file(&format!(",{name}"))).unwrap();
        let paid: Vec<f64> = returns.rows.iter().map(|row| row.risk_free_return).collect();
        assert_eq!((&paid[..], returns.rate()), (&[0.002, 0.001][..], 0.001));
        let said = format!("The bank pays 0.100 % a month, 1.2 % a year, by the last row of column {name}.");
        assert!(returns.sentence().ends_with(&said), "{}", returns.sentence());
    }
    let message = read(&file(",other")).unwrap_err().to_string();
    assert!(message.contains("must have a column risk_free_return, rf or rate, or --rate must be given"), "{message}");
    let said = Returns::parse(&file(",rf"), Some(-0.003), None).unwrap();
    assert!(said.rows.iter().all(|row| row.risk_free_return == -0.003) && said.sentence().ends_with("by --rate."));
    let percent = read("date,return,rf\n2008-01,0.01,0.2\n2008-02,0.03,2.1\n").unwrap_err().to_string();
    assert_eq!(percent, "line 3: rf is \"2.1\": must be a fraction a period from -0.5 to 0.5: 0.002 is 0.2 %");
    // What the bank paid before the first return is not asked.
    assert!(read("date,close,rf\n2007-12,100,\n2008-01,101,0.002\n2008-02,102,0.002\n").is_ok());
    let option = Returns::parse(&file(",rf"), Some(f64::NAN), None).unwrap_err().to_string();
    assert_eq!(option, "--rate is NaN: must be a fraction a period from -0.5 to 0.5: 0.002 is 0.2 %");
}

/// +1 % and -1 % by turns: mean 0, and a sample deviation of 0.01 sqrt(4/3) over four of them.
#[test]
fn figures_of_a_year_count_the_periods_of_the_frequency() {
    let file = |dates: [&str; 4]| {
        let row = |(date, index): (&str, usize)| format!("{date},{}\n", [0.01, -0.01][index % 2]);
        let rows: String = dates.into_iter().zip(0..).map(row).collect();
        format!("date,return\n{rows}")
    };
    let trading = ["2008-01-17", "2008-01-18", "2008-01-21", "2008-01-22"];
    let calendar = ["2008-01-18", "2008-01-19", "2008-01-20", "2008-01-21"];
    for (dates, said, periods) in [
        (trading, None, 252),
        (calendar, None, 365),
        (trading, Some(260), 260),
        (["2008-01-04", "2008-01-11", "2008-01-18", "2008-01-25"], None, 52),
        (["2008-01", "2008-02", "2008-03", "2008-04"], None, 12),
        (["2008-01", "2008-04", "2008-07", "2008-10"], None, 4),
        (["2005", "2006", "2007", "2008"], None, 1),
    ] {
        let returns = Returns::parse(&file(dates), Some(0.001), said).unwrap();
        assert_eq!(returns.periods_per_year, periods, "{dates:?}");
        let deviation = (4.0 / 3.0 * periods as f64).sqrt();
        let expected = format!(" has a mean of 0.0 % and a deviation of {deviation:.1} %. ");
        assert!(returns.sentence().replace("-0.0", "0.0").contains(&expected), "{}: {expected}", returns.sentence());
    }
    for periods in [0, 367] {
        let message = Returns::parse(&file(trading), Some(0.0), Some(periods)).unwrap_err().to_string();
        assert_eq!(message, format!("--periods-per-year is {periods}: must be 1 to 366"));
    }
}

#[test]
fn a_window_is_the_last_returns() {
    let market = Returns::bundled().unwrap();
    let last = market.clone().last(3).unwrap();
    assert_eq!(last.rows, market.rows[1106..]);
    assert!(last.sentence().starts_with("3 monthly returns, 2018-09 to 2018-11, "), "{}", last.sentence());
    for count in [0, 1, 1110] {
        let message = market.clone().last(count).unwrap_err().to_string();
        assert_eq!(
            message,
            format!("--window is {count} of 1109: must be at most the returns of the file, and 2 or more")
        );
    }
}
