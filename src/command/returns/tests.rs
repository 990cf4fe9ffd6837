use super::*;

fn read(text: &str) -> Result<Returns, ReturnsError> {
    Returns::parse(text, &Choices::default(), None, None)
}

#[test]
fn the_bundled_file_is_whole() {
    let market = Returns::bundled().unwrap();
    assert_eq!((market.rows.len(), market.frequency, market.periods_per_year), (1109, Some(Frequency::Monthly), 12));
    assert_eq!(market.year("2008").len(), 12);
    let history = market.before("2008-01", 240).unwrap();
    assert_eq!((history[0].date.as_str(), history[239].date.as_str()), ("1988-01", "2007-12"));
    assert_eq!(history[239].risk_free_return, 0.0027);
    assert_eq!(market.year("2008")[9].risky_return, -0.1715);
    let message = market.before("1927-01", 240).unwrap_err().to_string();
    assert_eq!(message, "240 months before 1927-01 are needed: the file has 6");
}

/// Checks that the sentence reports every column that is not read as fractions.
#[test]
fn the_sentence_says_what_was_read() {
    for (text, sentence) in [
        (
            "Date,Close,Adj Close\n2008-02-29,1,98.98\n2008-01-31,1,101\n2007-12-31,1,100\n",
            "2 monthly returns of prices, 2008-01 to 2008-02, as in column Adj Close.\nA year of 12 months has a mean of -5.8 % \
             and a deviation of 7.3 %. The bank pays 0.100 % a month, 1.2 % a year, by --rate. The rows came newest first and \
             are reversed.",
        ),
        (
            "quarter;r\n2008-03-31;1,5\n2008-06-30;-2\n2008-09-30;3,1\n",
            "3 quarterly simple returns in percent, 2008-03 to 2008-09, as in column r.\nA year of 4 quarters has a mean of 3.5 % \
             and a deviation of 5.2 %. The bank pays 0.100 % a quarter, 0.4 % a year, by --rate.",
        ),
    ] {
        assert_eq!(Returns::parse(text, &Choices::default(), Some(0.001), None).unwrap().sentence(), sentence);
    }
}

/// Trades in percent are not taken for fractions: a gain of 60 % would be one of 6,000 %.
#[test]
fn whether_trades_are_percent_is_asked_or_plain() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trades.csv");
    let trades = |text: &str, unit: Option<Unit>| {
        std::fs::write(&file, text).unwrap();
        let choices = Choices { unit, ..Choices::default() };
        ReturnsFile { file: file.clone(), rate: None, periods_per_year: None, choices }.trades()
    };
    let percent = trades("60\n40\n-0.5\n30\n20\n", None).unwrap();
    assert!((percent.log_returns[0] - 0.6_f64.ln_1p()).abs() < 1e-15, "{percent:?}");
    let open = "0.6\n-0.4\n0.5\n0.3\n-0.5\n";
    let question = trades(open, None).unwrap_err().to_string();
    assert!(
        question.starts_with("Are the returns fractions or percent? What is 0.6?\n  --unit fraction"),
        "{question}"
    );
    let fractions = trades(open, Some(Unit::Fraction)).unwrap();
    assert!((fractions.log_returns[0] - 0.6_f64.ln_1p()).abs() < 1e-15, "{fractions:?}");
}

#[test]
fn what_the_file_does_not_say_is_asked_with_the_options_that_say_it() {
    let rows = |gain: &str| format!("day,fund,index\n01/02/2008,{gain},7\n01/03/2008,-0.2,8\n01/04/2008,0.1,6\n");
    let parse = |choices: &Choices| Returns::parse(&rows("0.3"), choices, Some(0.0), None);
    let questions = parse(&Choices::default()).unwrap_err().to_string();
    assert!(
        questions.starts_with("Which column holds the returns or prices?\n  --column fund: fund (0.3; -0.2; 0.1 "),
        "{questions}"
    );
    let column = Choices { columns: vec!["fund".into()], ..Choices::default() };
    let questions = parse(&column).unwrap_err().to_string();
    assert_eq!(
        questions,
        "Which day is 01/02/2008?\n  --day-first true: 1 February 2008. 3 monthly simple returns as fractions, February 2008 to \
         April 2008, as in column fund. Mean 6.67 % and deviation 25.17 % a month, 116.94 % and 87.18 % a year.\n  --day-first \
         false: 2 January 2008. 3 daily simple returns in percent, 2 January 2008 to 4 January 2008, as in column fund. Mean \
         0.07 % and deviation 0.25 % a day, 18.29 % and 3.99 % a year.\nAre the returns fractions or percent? What is \
         0.3?\n  --unit fraction: Fractions: 0.3 is 30.00 %. 3 monthly simple returns as fractions, February 2008 to April \
         2008, as in column fund. Mean 6.67 % and deviation 25.17 % a month, 116.94 % and 87.18 % a year.\n  --unit percent: \
         Percent: 0.3 is 0.30 %. 3 monthly simple returns in percent, February 2008 to April 2008, as in column fund. Mean \
         0.07 % and deviation 0.25 % a month, 0.80 % and 0.87 % a year."
    );
    let answered = Choices { day_first: Some(true), unit: Some(Unit::Percent), ..column };
    assert_eq!(parse(&answered).unwrap().rows[0].risky_return, 0.003);
    let several = Choices { columns: vec!["fund".into(), "index".into()], kind: Some(Kind::Simple), ..answered };
    assert_eq!(parse(&several).unwrap_err().to_string(), "--column is 2 columns: must be one");
}

#[test]
fn a_frequency_that_the_dates_do_not_say_is_an_option() {
    let parse = |text: &str, choices: &Choices, periods| Returns::parse(text, choices, Some(0.0), periods);
    let plain = "return\n0.01\n-0.02\n";
    let error = parse(plain, &Choices::default(), None).unwrap_err().to_string();
    assert!(
        error.starts_with("the file does not say what a period is: give --periods-per-year, such as 12"),
        "{error}"
    );
    let read = parse(plain, &Choices::default(), Some(4)).unwrap();
    let sentence = "2 returns, row 1 to row 2, as in column return.\nA year of 4 quarters has a mean of -2.0 % and";
    assert!(read.sentence().starts_with(sentence), "{}", read.sentence());
    let halves = "date,ret\n2000-06-30,0.04\n2000-12-31,-0.02\n2001-06-30,0.05\n2001-12-31,0.03\n";
    let questions = parse(halves, &Choices::default(), None).unwrap_err().to_string();
    assert!(questions.contains("\n  --gaps true: ") && questions.ends_with(YEAR), "{questions}");
    let gaps = Choices { gaps: Some(true), unit: Some(Unit::Fraction), ..Choices::default() };
    let read = parse(halves, &gaps, Some(2)).unwrap();
    assert!(read.sentence().starts_with("4 returns, 2000-06-30 to 2001-12-31, "), "{}", read.sentence());
    // Without --periods-per-year each answer would be refused.
    for dates in ["week A1,0.01\nweek A2,0.02\nweek A3,-0.02\n", halves] {
        let questions = parse(dates, &Choices::default(), None).unwrap_err().to_string();
        assert!(questions.ends_with(YEAR), "{questions}");
        assert!(!parse(dates, &Choices::default(), Some(12)).unwrap_err().to_string().ends_with(YEAR));
    }
}

const YEAR: &str = "\n  with --periods-per-year, such as 12, as the dates do not say what a period is";

/// Checks that printed options can be typed: they are quoted if a shell would split them.
#[test]
fn an_option_is_printed_as_a_shell_takes_it() {
    let text = "date,S&P 500,Investor's own\n2020-01,0.01,0.02\n2020-02,-0.01,0.01\n2020-03,0.02,-0.03\n";
    let questions = Returns::parse(text, &Choices::default(), Some(0.0), None).unwrap_err().to_string();
    assert!(questions.contains("\n  --column 'S&P 500': "), "{questions}");
    assert!(questions.contains("\n  --column 'Investor'\\''s own': "), "{questions}");
}

#[test]
fn the_bank_is_a_column_or_an_option_and_never_left_out() {
    let file = |header: &str| format!("date,return{header}\n2008-01,0.01,0.002\n2008-02,0.03,0.001\n");
    for name in ["risk_free_return", "RF", "rate", "Risk-free", "risk free rate", "bank return"] {
        let returns = read(&file(&format!(",{name}"))).unwrap();
        let paid: Vec<f64> = returns.rows.iter().map(|row| row.risk_free_return).collect();
        assert_eq!((&paid[..], returns.rate()), (&[0.002, 0.001][..], 0.001));
        let bank = format!("The bank pays 0.100 % a month, 1.2 % a year, by the last row of column {name}.");
        assert!(returns.sentence().ends_with(&bank), "{}", returns.sentence());
    }
    let message = read(&file(",other")).unwrap_err().to_string();
    assert!(message.contains("add a column risk_free_return, rf or rate, or give --rate"), "{message}");
    let returns = Returns::parse(&file(",rf"), &Choices::default(), Some(-0.003), None).unwrap();
    assert!(
        returns.rows.iter().all(|row| row.risk_free_return == -0.003) && returns.sentence().ends_with("by --rate.")
    );
    let percent = read("date,return,rf\n2008-01,0.01,0.2\n2008-02,0.03,2.1\n").unwrap_err().to_string();
    let reason =
        "\nColumn rf is not used: line 3: rf is \"2.1\": must be a fraction a period from -0.5 to 0.5: 0.002 is 0.2 %.";
    assert!(percent.starts_with("the file does not say what the bank pays") && percent.ends_with(reason), "{percent}");
    // The bank's interest before the first return is not needed.
    assert!(read("date,close,rf\n2007-12,100,\n2008-01,101,0.002\n2008-02,102,0.002\n").is_ok());
    let option = Returns::parse(&file(",rf"), &Choices::default(), Some(f64::NAN), None).unwrap_err().to_string();
    assert_eq!(option, "--rate is NaN: must be a fraction a period from -0.5 to 0.5: 0.002 is 0.2 %");
}

/// Alternates +1 % and -1 %: mean 0, and a sample deviation of 0.01 sqrt(4/3) over four of them.
#[test]
fn figures_of_a_year_count_the_periods_of_the_frequency() {
    let file = |dates: [&str; 4]| {
        let row = |(date, index): (&str, usize)| format!("{date},{}\n", [0.01, -0.01][index % 2]);
        let rows: String = dates.into_iter().zip(0..).map(row).collect();
        format!("date,return\n{rows}")
    };
    let trading = ["2008-01-17", "2008-01-18", "2008-01-21", "2008-01-22"];
    let calendar = ["2008-01-18", "2008-01-19", "2008-01-20", "2008-01-21"];
    for (dates, periods_per_year, periods) in [
        (trading, None, 252),
        (calendar, None, 365),
        (trading, Some(260), 260),
        (["2008-01-04", "2008-01-11", "2008-01-18", "2008-01-25"], None, 52),
        (["2008-01", "2008-02", "2008-03", "2008-04"], None, 12),
        (["2008-01", "2008-04", "2008-07", "2008-10"], None, 4),
        (["2005", "2006", "2007", "2008"], None, 1),
    ] {
        let returns = Returns::parse(&file(dates), &Choices::default(), Some(0.001), periods_per_year).unwrap();
        assert_eq!(returns.periods_per_year, periods, "{dates:?}");
        let deviation = (4.0 / 3.0 * periods as f64).sqrt();
        let expected = format!(" has a mean of 0.0 % and a deviation of {deviation:.1} %. ");
        assert!(returns.sentence().replace("-0.0", "0.0").contains(&expected), "{}: {expected}", returns.sentence());
    }
    for periods in [0, 367] {
        let message =
            Returns::parse(&file(trading), &Choices::default(), Some(0.0), Some(periods)).unwrap_err().to_string();
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
            format!("--window is {count} of 1109: must be from 2 to the number of returns in the file")
        );
    }
}

#[test]
fn columns_that_nothing_tells_apart_are_assets_and_a_known_heading_is_one() {
    let parse = |header: &str, columns: &[&str]| {
        let text = format!("date,{header},rf\n2008-01,0.01,0.04,0.002\n2008-02,-0.03,-0.02,0.001\n");
        let columns = columns.iter().map(ToString::to_string).collect();
        AnyReturns::parse(&text, &Choices { columns, ..Choices::default() }, None, None).unwrap()
    };
    let AnyReturns::Several(several) = parse("energy,health", &[]) else { panic!("one asset") };
    let AssetsRecord { assets, rows, bank, dates, periods_per_year, .. } = several.record.clone();
    assert_eq!(
        (&assets[..], &bank[..], periods_per_year),
        (&["energy".into(), "health".into()][..], &[0.002, 0.001][..], 12)
    );
    assert_eq!(
        (&rows[1][..], &dates[..]),
        (&[-0.03_f64, -0.02].map(f64::ln_1p)[..], &["2008-01".into(), "2008-02".into()][..])
    );
    assert!(
        several.sentence.ends_with("Each of the 2 columns is an asset; --column takes one alone."),
        "{}",
        several.sentence
    );
    let one = |any: &AnyReturns| matches!(any, AnyReturns::One(returns) if returns.rows[0].risky_return == 0.04);
    assert!(one(&parse("energy,health", &["health"])) && one(&parse("energy,return", &[])));
    let AnyReturns::Several(turned) = parse("energy,return", &["return", "energy"]) else { panic!("one asset") };
    assert_eq!(turned.record.assets, ["return", "energy"]);
}

#[test]
fn volumes_and_other_prices_of_a_day_are_no_assets() {
    let text = "Date,Open,High,Low,Last,Volume\n2008-01,99,102,98,100,1200\n2008-02,100,103,99,101,900\n2008-03,101,104,97,99,1500\n";
    let found = AnyReturns::parse(text, &Choices::default(), Some(0.001), None).unwrap();
    assert!(matches!(&found, AnyReturns::One(returns) if returns.column == "Last"), "{found:?}");
    let columns = ["Open", "Last"].map(str::to_owned).to_vec();
    let choices = Choices { columns, ..Choices::default() };
    let refused = AnyReturns::parse(text, &choices, Some(0.001), None).unwrap_err().to_string();
    assert!(refused.starts_with("Column Open holds neither returns nor the last price of each period."), "{refused}");
}
