//! Memory by the fields that cause it.

/// Bytes by the field of the request that causes them.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    parts: Vec<Demand>,
}

#[derive(Debug, Clone, PartialEq)]
struct Demand {
    field: &'static str,
    value: usize,
    bytes: usize,
}

impl Footprint {
    /// Builds the footprint of one field, whose value `value` causes so many bytes.
    pub fn of(field: &'static str, value: usize, bytes: usize) -> Self {
        Footprint { parts: vec![Demand { field, value, bytes }] }
    }

    pub(super) fn and(mut self, field: &'static str, value: usize, bytes: usize) -> Self {
        self.parts.push(Demand { field, value, bytes });
        self
    }

    /// Returns the bytes in all.
    pub fn bytes(&self) -> usize {
        self.parts.iter().fold(0, |sum, part| sum.saturating_add(part.bytes))
    }

    fn most(&self) -> Option<&Demand> {
        self.parts.iter().max_by_key(|part| part.bytes)
    }

    /// Returns the field that causes most bytes.
    pub fn field(&self) -> &'static str {
        self.most().map_or("", |part| part.field)
    }

    /// Returns the value of that field.
    pub fn value(&self) -> usize {
        self.most().map_or(0, |part| part.value)
    }
}
