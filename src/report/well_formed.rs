//! A small check that markup is well-formed XML, written apart from what it checks.

/// The names of all elements in order of their opening tags, or what is wrong.
pub fn check(text: &str) -> Result<Vec<String>, String> {
    let (mut open, mut seen): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    let mut rest = text;
    while let Some(start) = rest.find('<') {
        plain(&rest[..start])?;
        let end = rest[start..].find('>').ok_or("a tag does not end")? + start;
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop().as_deref() != Some(name) {
                return Err(format!("</{name}> closes what is not open"));
            }
            continue;
        }
        let closed = tag.ends_with('/');
        let tag = tag.trim_end_matches('/');
        let (name, mut attributes) = tag.split_once(' ').unwrap_or((tag, ""));
        if name.is_empty() || !name.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
            return Err(format!("<{tag}> has no name"));
        }
        while !attributes.is_empty() {
            let (_, value) = attributes.split_once("=\"").ok_or(format!("<{tag}>: {attributes}"))?;
            let (value, after) = value.split_once('"').ok_or(format!("<{tag}>: a value does not end"))?;
            plain(value)?;
            attributes = after.trim_start();
        }
        seen.push(name.into());
        if !closed {
            open.push(name.into());
        }
    }
    plain(rest)?;
    if open.is_empty() && rest.trim().is_empty() {
        Ok(seen)
    } else {
        Err(format!("{open:?} left open, {rest:?} left over"))
    }
}

/// Text between tags: no bare ampersand, no letter XML forbids.
fn plain(text: &str) -> Result<(), String> {
    for piece in text.split('&').skip(1) {
        let entity = piece.split(';').next().unwrap_or("");
        if !["amp", "lt", "gt", "quot", "#39"].contains(&entity) {
            return Err(format!("a bare & before {piece:?}"));
        }
    }
    match text.chars().find(|letter| letter.is_control() && *letter != '\n' && *letter != '\t') {
        Some(letter) => Err(format!("control character {letter:?}")),
        None => Ok(()),
    }
}

#[test]
fn the_check_finds_what_is_wrong() {
    assert_eq!(check("<a x=\"1\"><b/>t</a>").unwrap(), ["a", "b"]);
    for wrong in ["<a>", "<a></b>", "<a x=1></a>", "<a>&</a>", "<a>\u{1}</a>", "<a></a>b", "<a x=\"1></a>"] {
        assert!(check(wrong).is_err(), "{wrong}");
    }
}
