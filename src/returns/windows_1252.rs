//! Windows-1252, the encoding in which spreadsheets in Western Europe save text.

/// The characters of the bytes from 0x80 to 0x9f; five of them have none.
const HIGH: [Option<char>; 32] = [
    Some('\u{20ac}'),
    None,
    Some('\u{201a}'),
    Some('\u{192}'),
    Some('\u{201e}'),
    Some('\u{2026}'),
    Some('\u{2020}'),
    Some('\u{2021}'),
    Some('\u{2c6}'),
    Some('\u{2030}'),
    Some('\u{160}'),
    Some('\u{2039}'),
    Some('\u{152}'),
    None,
    Some('\u{17d}'),
    None,
    None,
    Some('\u{2018}'),
    Some('\u{2019}'),
    Some('\u{201c}'),
    Some('\u{201d}'),
    Some('\u{2022}'),
    Some('\u{2013}'),
    Some('\u{2014}'),
    Some('\u{2dc}'),
    Some('\u{2122}'),
    Some('\u{161}'),
    Some('\u{203a}'),
    Some('\u{153}'),
    None,
    Some('\u{17e}'),
    Some('\u{178}'),
];

/// Decodes `bytes`; `None` if they are no text.
pub fn decoded(bytes: &[u8]) -> Option<String> {
    let letter = |byte: &u8| match byte {
        0 => None,
        0x80..=0x9f => HIGH[usize::from(byte - 0x80)],
        other => Some(char::from(*other)),
    };
    bytes.iter().map(letter).collect()
}
