//! Resampling of a series that depends on its past.

use rand::Rng;
use rand::RngExt;

/// Returns the indices of one resample of `0..length`: blocks of `block` consecutive indices from random starts on a
/// circle, cut to `length`. Dependence within a block survives, and every index is drawn equally often on average.
/// Source: Politis and Romano, *A circular block-resampling procedure for stationary data* (1992).
pub fn circular_blocks(length: usize, block: usize, generator: &mut impl Rng) -> Vec<usize> {
    let mut indices = Vec::with_capacity(length + block);
    while indices.len() < length {
        let start = generator.random_range(0..length);
        indices.extend((start..start + block.max(1)).map(|index| index % length));
    }
    indices.truncate(length);
    indices
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::machine::streams::stream;

    #[test]
    fn blocks_are_neighbours_and_indices_equally_likely() {
        let mut counts = [0_usize; 10];
        for draw in 0..20_000 {
            let indices = circular_blocks(10, 4, &mut stream(1, "test", 0, draw));
            assert_eq!(indices.len(), 10);
            for block in indices.chunks(4) {
                assert!(block.windows(2).all(|pair| pair[1] == (pair[0] + 1) % 10), "{indices:?}");
            }
            indices.into_iter().for_each(|index| counts[index] += 1);
        }
        // 20,000 are expected for each; blocks of four make the standard deviation at most 4 sqrt(20,000 * 3 / 10) =
        // 310.
        assert!(counts.iter().all(|&count| count.abs_diff(20_000) < 1300), "{counts:?}");
    }
}
