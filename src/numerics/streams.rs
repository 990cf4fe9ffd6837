//! Labelled random streams: a draw added in one place changes nothing elsewhere.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Longest purpose, in bytes, that the key has room for.
const PURPOSE_BYTES: usize = 16;

/// The stream of `(seed, purpose, step, index)`; distinct labels give independent streams.
///
/// The ChaCha key holds the seed, the step and the purpose (its first 16 bytes); the index is the stream number.
pub fn stream(seed: u64, purpose: &str, step: usize, index: usize) -> ChaCha8Rng {
    let mut key = [0_u8; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&(step as u64).to_le_bytes());
    for (slot, byte) in key[16..].iter_mut().zip(purpose.bytes().take(PURPOSE_BYTES)) {
        *slot = byte;
    }
    let mut generator = ChaCha8Rng::from_seed(key);
    generator.set_stream(index as u64);
    generator
}
