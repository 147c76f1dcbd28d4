//! Hashes of short spans of samples, by which a part of a record is known again.
//! (Python side: `record/digest.py`)

const MIX: u64 = 0x9E37_79B9_7F4A_7C15;

/// Hashes of all spans of `span` samples (a power of two) that move: of samples, of pairs, of fours.
pub fn span_hashes(samples: &[f64], span: usize) -> Vec<u64> {
    // Negative zero is zero.
    let mut found: Vec<u64> = samples.iter().map(|each| (each + 0.0).to_bits()).collect();
    if span == 0 || found.len() < span {
        return Vec::new();
    }
    let mut rest = 0;
    let still: Vec<bool> = (0..found.len())
        .map(|at| {
            rest = if at > 0 && found[at] == found[at - 1] { rest + 1 } else { 0 };
            rest + 1 >= span
        })
        .collect();
    let mut step = 1;
    while step < span {
        let count = found.len() - step;
        for at in 0..count {
            let joined = (found[at] ^ (found[at + step] >> 7)).wrapping_mul(MIX);
            let joined = joined.wrapping_add(found[at + step]);
            found[at] = joined ^ (joined >> 29);
        }
        found.truncate(count);
        step *= 2;
    }
    let moving = still[span - 1..].iter().map(|still| !still);
    found.into_iter().zip(moving).filter_map(|(hash, moves)| moves.then_some(hash)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The plain form: a tree over each span by itself.
    fn of_span(samples: &[f64]) -> u64 {
        match samples {
            [one] => (one + 0.0).to_bits(),
            _ => {
                let (left, right) = samples.split_at(samples.len() / 2);
                let (left, right) = (of_span(left), of_span(right));
                let joined = (left ^ (right >> 7)).wrapping_mul(MIX).wrapping_add(right);
                joined ^ (joined >> 29)
            }
        }
    }

    proptest! {
        #[test]
        fn each_moving_span_is_hashed_by_itself(
            samples in prop::collection::vec(prop::sample::select(&[0.0, -0.0, 1.0, 2.5][..]), 0..60),
            power in 0_u32..5,
        ) {
            let span = 1 << power;
            let moves = |part: &&[f64]| part.iter().any(|value| *value != part[0]);
            let plain: Vec<u64> = samples.windows(span).filter(moves).map(of_span).collect();
            prop_assert_eq!(span_hashes(&samples, span), plain);
        }
    }

    #[test]
    fn a_part_is_known_again_and_its_neighbours_are_not() {
        let record: Vec<f64> = (0..400).map(|k| (0.37 * f64::from(k)).sin()).collect();
        let whole = span_hashes(&record, 16);
        assert_eq!(whole.len(), 385);
        assert_eq!(span_hashes(&record[100..200], 16), whole[100..185]);
        let mut apart = whole.clone();
        apart.sort_unstable();
        apart.dedup();
        assert_eq!(apart.len(), whole.len());
        assert!(span_hashes(&record[..15], 16).is_empty() && span_hashes(&record, 0).is_empty());
    }
}
