//! Encoding of numbers and seals as bytes.

use sha2::{Digest, Sha256};

use crate::store::engine::error::Failure;

/// SHA-256 over the fields of a row. Texts and bytes are preceded by their length; numbers enter by their bits.
pub(in crate::store) struct Seal(Sha256);

impl Seal {
    /// Starts a seal; `thing` separates the seals of different tables.
    pub(in crate::store) fn of(thing: &str) -> Self {
        Seal(Sha256::new()).text(thing)
    }

    pub(in crate::store) fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes())
    }

    pub(in crate::store) fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    pub(in crate::store) fn integer(mut self, value: i64) -> Self {
        self.0.update(value.to_le_bytes());
        self
    }

    pub(in crate::store) fn finish(self) -> Vec<u8> {
        self.0.finalize().to_vec()
    }

    /// Fails with `what` as the damaged thing if the stored seal differs.
    pub(in crate::store) fn verify(self, stored: &[u8], what: impl FnOnce() -> String) -> Result<(), Failure> {
        if self.finish() == stored { Ok(()) } else { Err(Failure::Corrupt(what())) }
    }
}

pub(in crate::store) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(in crate::store) fn encode_reals(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Returns `None` if the length is not a multiple of eight.
pub(in crate::store) fn decode_reals(bytes: &[u8]) -> Option<Vec<f64>> {
    let (numbers, rest) = bytes.as_chunks::<8>();
    rest.is_empty().then(|| numbers.iter().map(|&number| f64::from_le_bytes(number)).collect())
}

/// Converts a count for SQL. Counts beyond `i64` do not occur; they saturate.
pub(in crate::store) fn to_sql(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

/// Reads a count from SQL; a negative one is damage.
pub(in crate::store) fn from_sql(count: i64) -> Result<usize, Failure> {
    usize::try_from(count).map_err(|_| Failure::Corrupt(format!("a count of {count}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_come_back_bit_for_bit() {
        let values = [0.1, -0.0, f64::MIN_POSITIVE / 4.0, f64::MAX, f64::NEG_INFINITY];
        let back = decode_reals(&encode_reals(&values)).expect("a multiple of eight");
        assert_eq!(back.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), values.map(f64::to_bits));
        assert_eq!(decode_reals(&[0; 9]), None);
    }

    #[test]
    fn fields_cannot_flow_into_each_other() {
        let seal = |first: &str, second: &str| Seal::of("row").text(first).text(second).finish();
        assert_ne!(seal("ab", "c"), seal("a", "bc"));
        assert_ne!(
            Seal::of("row").bytes(&encode_reals(&[0.0])).finish(),
            Seal::of("row").bytes(&encode_reals(&[-0.0])).finish()
        );
    }
}
