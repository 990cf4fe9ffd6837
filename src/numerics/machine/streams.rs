//! Labelled random streams, so that an added draw changes no other stream.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Longest purpose that fits the key, in bytes.
const PURPOSE_BYTES: usize = 16;

/// Returns the stream of `(seed, purpose, step, index)`; distinct labels give independent streams.
///
/// The ChaCha key holds the seed, the step and the purpose; the index is the stream number.
///
/// # Panics
/// Panics if the purpose does not fit the key: if it were cut off, two purposes could share a stream.
pub fn stream(seed: u64, purpose: &str, step: usize, index: usize) -> ChaCha8Rng {
    assert!(purpose.len() <= PURPOSE_BYTES && !purpose.contains('\0'), "{purpose} is no label of at most 16 bytes");
    let mut key = [0_u8; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&(step as u64).to_le_bytes());
    for (slot, byte) in key[16..].iter_mut().zip(purpose.bytes()) {
        *slot = byte;
    }
    let mut generator = ChaCha8Rng::from_seed(key);
    generator.set_stream(index as u64);
    generator
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;

    #[test]
    fn a_draw_of_one_label_says_nothing_of_another() {
        let labels = [
            (1, "bridge", 0, 0),
            (2, "bridge", 0, 0),
            (1, "bridge in cells", 0, 0),
            (1, "bridge", 1, 0),
            (1, "bridge", 0, 1),
        ];
        let draws = |(seed, purpose, step, index): (u64, &str, usize, usize)| -> Vec<f64> {
            let mut generator = stream(seed, purpose, step, index);
            (0..10_000).map(|_| generator.random::<f64>() - 0.5).collect()
        };
        assert_eq!(draws(labels[0]), draws(labels[0]), "a label is a stream");
        let draws: Vec<Vec<f64>> = labels.map(draws).into();
        for (index, one) in draws.iter().enumerate() {
            for other in &draws[..index] {
                let correlation = 12.0 * one.iter().zip(other).map(|(a, b)| a * b).sum::<f64>() / 10_000.0;
                // Five standard errors of the correlation of 10,000 independent pairs.
                assert!(correlation.abs() < 0.05, "{correlation}");
            }
        }
    }

    #[test]
    #[should_panic(expected = "is no label")]
    fn a_label_that_would_be_cut_off_is_refused() {
        stream(1, "evaluate-history-2", 0, 0);
    }
}
