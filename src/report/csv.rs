//! Data as comma-separated values, RFC 4180 with line feeds.

use std::fmt::Display;

/// A file in the making; numbers are written in the shortest form that reads back as the same.
#[derive(Debug, Clone, PartialEq)]
pub struct Csv {
    text: String,
}

impl Csv {
    pub fn new(header: &[&str]) -> Self {
        let mut csv = Csv { text: String::new() };
        csv.row(header);
        csv
    }

    pub fn row<T: Display>(&mut self, fields: impl IntoIterator<Item = T>) {
        let fields: Vec<String> = fields.into_iter().map(|field| quoted(field.to_string())).collect();
        self.text.push_str(&fields.join(","));
        self.text.push('\n');
    }

    pub fn into_text(self) -> String {
        self.text
    }
}

fn quoted(field: String) -> String {
    if field.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_quoted_where_they_must_be_and_numbers_read_back() {
        let mut csv = Csv::new(&["name", "say \"so\""]);
        csv.row([&"a,b" as &dyn Display, &(0.1 + 0.2)]);
        let text = csv.into_text();
        assert_eq!(text, "name,\"say \"\"so\"\"\"\n\"a,b\",0.30000000000000004\n");
        assert_eq!(text.trim_end().rsplit(',').next().unwrap().parse(), Ok(0.1 + 0.2));
    }
}
