//! Data as comma-separated values, RFC 4180 with line feeds.

use std::fmt::Display;

use csv::{ByteRecord, Writer, WriterBuilder};

/// A CSV file that is being written. Numbers are written in the shortest form that reads back as the same number.
#[derive(Debug)]
pub struct Csv(Writer<Vec<u8>>);

impl Csv {
    pub fn new(header: &[&str]) -> Self {
        let mut csv = Csv(WriterBuilder::new().flexible(true).from_writer(Vec::new()));
        csv.row(header);
        csv
    }

    pub fn row<T: Display>(&mut self, fields: impl IntoIterator<Item = T>) {
        let fields: ByteRecord = fields.into_iter().map(|field| field.to_string().into_bytes()).collect();
        // Writing to memory cannot fail.
        let _ = self.0.write_byte_record(&fields);
    }

    pub fn into_text(self) -> String {
        String::from_utf8(self.0.into_inner().unwrap_or_default()).unwrap_or_default()
    }
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
