//! The rule for text that people write: names, notes, tags, reasons.

use std::ops::RangeInclusive;

use crate::control::error::FieldError;

/// Checks that a text has an allowed number of letters, and no control characters except those in `accepted`. Those that
/// end a line or turn the direction of the letters around them would show another text than the one recorded.
///
/// # Errors
/// It has too few or too many letters, or a control character, which is reported with its position.
pub fn check_text(
    field: &str,
    text: &str,
    lengths: RangeInclusive<usize>,
    accepted: &[char],
) -> Result<(), FieldError> {
    let letters = text.chars().count();
    if !lengths.contains(&letters) {
        let rule = format!("must have {} to {} letters", lengths.start(), lengths.end());
        return Err(FieldError::new(field, format!("{letters} letters"), rule));
    }
    let control = text.chars().zip(1..).find(|(letter, _)| is_control(*letter) && !accepted.contains(letter));
    let Some((control, place)) = control else { return Ok(()) };
    let rule = format!(
        "must have no control character, but letter {place} is U+{:04X}: remove it or replace it with a space",
        u32::from(control)
    );
    Err(FieldError::new(field, format!("{text:?}"), rule))
}

/// Returns true for a control character, or one that ends a line or turns the direction of text (Unicode's bidirectional
/// algorithm, UAX 9, section 2).
fn is_control(letter: char) -> bool {
    letter.is_control() || matches!(letter, '\u{2028}'..='\u{202E}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_control_character_is_named_with_its_place() {
        assert_eq!(check_text("name", "Été 2008, \u{1F600}", 1..=100, &[]), Ok(()));
        assert_eq!(check_text("notes", "one\ntwo", 0..=100, &['\n']), Ok(()));
        for (text, named) in [
            ("a\u{7}b", "letter 2 is U+0007"),
            ("one\ntwo", "letter 4 is U+000A"),
            ("\u{85}", "U+0085"),
            ("\u{202e}live", "letter 1 is U+202E"),
            ("a\u{2028}b", "letter 2 is U+2028"),
        ] {
            let refused = check_text("name", text, 1..=100, &[]).unwrap_err().to_string();
            assert!(refused.contains(named) && refused.contains("remove it"), "{refused}");
        }
        let refused = check_text("name", "", 1..=100, &[]).unwrap_err().to_string();
        assert!(refused.contains("must have 1 to 100 letters"), "{refused}");
    }
}
