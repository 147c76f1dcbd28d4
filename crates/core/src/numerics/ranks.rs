//! Ranks of numbers, ties sharing theirs. (Python side: `uncertainty/unequal_noise.py`)

const BITS: usize = 11;
const BUCKETS: usize = 1 << BITS;
/// Digits of the upper half of a number.
const DIGITS: usize = 3;
const UPPER: u64 = !0 << 32;

/// Bits that are ordered as the numbers are; both zeros have the same.
fn key(value: f64) -> u64 {
    let bits = (value + 0.0).to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

const fn digit(word: u64, which: usize) -> usize {
    (word >> (31 + which * BITS)) as usize & (BUCKETS - 1)
}

const fn place(word: u64) -> usize {
    (word & !UPPER) as usize
}

/// Words in the order of their upper halves, by digits from the last to the first.
///
/// Reference: Knuth, *The Art of Computer Programming* 3, 2nd ed., algorithm 5.2.5 R.
fn by_digits(mut words: Vec<u64>) -> Vec<u64> {
    let mut counts = vec![0_usize; DIGITS * BUCKETS];
    for &each in &words {
        for which in 0..DIGITS {
            counts[which * BUCKETS + digit(each, which)] += 1;
        }
    }
    let mut other = words.clone();
    for (which, counts) in counts.chunks_exact_mut(BUCKETS).enumerate() {
        if counts.contains(&words.len()) {
            continue;
        }
        let mut begin = 0;
        for count in counts.iter_mut() {
            (*count, begin) = (begin, begin + *count);
        }
        for &each in &words {
            let to = &mut counts[digit(each, which)];
            other[*to] = each;
            *to += 1;
        }
        std::mem::swap(&mut words, &mut other);
    }
    words
}

/// Ranks of a row about zero and of unit variance; zeros where all numbers are the same.
///
/// Fewer than 2³² numbers, none of them NaN.
pub fn ranks(row: &[f64]) -> Vec<f64> {
    // The upper half of a number's bits, and its place.
    let words = row.iter().zip(0_u64..).map(|(&value, place)| key(value) & UPPER | place);
    let mut words = by_digits(words.collect());
    let (mut found, mut begin, mut squares) = (vec![0.0; row.len()], 0, 0.0);
    // Few numbers share their upper halves: these alone are compared.
    for alike in words.chunk_by_mut(|a, b| a & UPPER == b & UPPER) {
        if alike.len() > 1 {
            alike.sort_unstable_by_key(|&word| key(row[place(word)]));
        }
        for ties in alike.chunk_by(|&a, &b| row[place(a)] == row[place(b)]) {
            let about = 0.5 * ((2 * begin + ties.len()) as f64 - row.len() as f64);
            squares += ties.len() as f64 * about * about;
            ties.iter().for_each(|&word| found[place(word)] = about);
            begin += ties.len();
        }
    }
    if squares > 0.0 {
        let spread = (squares / row.len() as f64).sqrt();
        found.iter_mut().for_each(|each| *each /= spread);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::ranks;

    #[test]
    fn ties_share_their_ranks() {
        let found = ranks(&[3.0, -1.0, 3.0, 0.0, -0.0]);
        // About zero: 1.5, −2, 1.5, −.5, −.5; mean square 9/5.
        let spread = 1.8_f64.sqrt();
        for (found, known) in found.iter().zip([1.5, -2.0, 1.5, -0.5, -0.5]) {
            assert!((found - known / spread).abs() < 1e-15);
        }
        assert_eq!(ranks(&[2.0; 4]), [0.0; 4]);
        assert!(ranks(&[]).is_empty());
    }

    #[test]
    fn ranks_are_ordered_as_the_numbers() {
        let mut state = 1_u64;
        let row: Vec<f64> = (0..3000)
            .map(|k| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let value = f64::from(u32::try_from(state >> 40).unwrap()) - 8e6;
                match k % 7 {
                    0 => (value / 1e6).round(),
                    1 => value.mul_add(1e-17, 1.0), // Some alike, all of one upper half.
                    _ => value * 1e-300_f64.powi(k % 2),
                }
            })
            .collect();
        let found = ranks(&row);
        for (one, a) in found.iter().zip(&row).step_by(31) {
            for (other, b) in found.iter().zip(&row) {
                assert_eq!(one.partial_cmp(other), a.partial_cmp(b), "{a} and {b}");
            }
        }
        let square = found.iter().map(|each| each * each).sum::<f64>() / 3000.0;
        assert!((square - 1.0).abs() < 1e-12);
        assert!(found.iter().sum::<f64>().abs() < 1e-9);
    }
}
