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
