//! Names of months in English, German, French and Spanish files.

/// Names without accents and capitals, with every spelling.
const NAMES: [&[&str]; 12] = [
    &["january", "januar", "janner", "janvier", "enero"],
    &["february", "februar", "fevrier", "febrero"],
    &["march", "marz", "maerz", "mrz", "mars", "marzo"],
    &["april", "avril", "abril"],
    &["may", "mai", "mayo"],
    &["june", "juni", "juin", "junio"],
    &["july", "juli", "juillet", "julio"],
    &["august", "aout", "agosto"],
    &["september", "septembre", "septiembre", "setiembre"],
    &["october", "oktober", "octobre", "octubre"],
    &["november", "novembre", "noviembre"],
    &["december", "dezember", "decembre", "diciembre"],
];
const SHORTEST: usize = 3;
const LONGEST: usize = 10;

fn without_accent(letter: char) -> char {
    match letter {
        '\u{e4}' | '\u{e0}' | '\u{e1}' => 'a',
        '\u{e9}' | '\u{e8}' => 'e',
        '\u{fb}' => 'u',
        other => other,
    }
}

/// Returns the month from 1 that `word` names by at least three letters, or `None` if it names none or could name two.
pub fn month(word: &str) -> Option<i16> {
    let count = word.chars().take(LONGEST + 1).count();
    if !(SHORTEST..=LONGEST).contains(&count) {
        return None;
    }
    let plain: String = word.to_lowercase().chars().map(without_accent).collect();
    let mut found = (1..).zip(NAMES).filter(|(_, names)| names.iter().any(|name| name.starts_with(&plain)));
    let (month, _) = found.next()?;
    found.next().is_none().then_some(month)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn months_of_four_languages_are_known_and_a_word_that_could_be_two_is_not() {
        for (word, expected) in [
            ("M\u{e4}r", Some(3)),
            ("M\u{c4}RZ", Some(3)),
            ("Mai", Some(5)),
            ("Okt", Some(10)),
            ("Dez", Some(12)),
            ("f\u{e9}vr", Some(2)),
            ("ao\u{fb}t", Some(8)),
            ("juil", Some(7)),
            ("jui", None),
            ("ene", Some(1)),
            ("dic", Some(12)),
            ("sept", Some(9)),
            ("set", Some(9)),
            ("ma", None),
            ("total", None),
        ] {
            assert_eq!(month(word), expected, "{word}");
        }
    }
}
