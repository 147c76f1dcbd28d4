//! Seeded normal numbers for simulation: the same seed gives the same flight on every machine.
//!
//! Reference: Blackman & Vigna, "Scrambled linear pseudorandom number generators", ACM TOMS 47
//! (2021): xoshiro256++, seeded by splitmix64; Marsaglia & Bray (1964) for the normal pair.

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub struct Random {
    state: [u64; 4],
    spare: Option<f64>,
}

impl Random {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        let mut counter = seed;
        let state = std::array::from_fn(|_| {
            counter = counter.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = counter;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            z ^ (z >> 31)
        });
        Self { state, spare: None }
    }

    fn next_bits(&mut self) -> u64 {
        let [a, b, c, d] = self.state;
        let result = a.wrapping_add(d).rotate_left(23).wrapping_add(a);
        let (c, d) = (c ^ a, d ^ b);
        self.state = [a ^ d, b ^ c, c ^ (b << 17), d.rotate_left(45)];
        result
    }

    /// Uniform in [0, 1) with 53 random bits.
    pub fn uniform(&mut self) -> f64 {
        (self.next_bits() >> 11) as f64 * f64::EPSILON * 0.5
    }

    /// Normal with mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        if let Some(value) = self.spare.take() {
            return value;
        }
        loop {
            let (x, y) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = x * x + y * y;
            if square > 0.0 && square < 1.0 {
                let factor = (-2.0 * square.ln() / square).sqrt();
                self.spare = Some(y * factor);
                return x * factor;
            }
        }
    }

    /// Independent normal numbers of one standard deviation.
    pub fn normals<const N: usize>(&mut self, sigma: f64) -> [f64; N] {
        std::array::from_fn(|_| sigma * self.normal())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generator_gives_its_published_first_value() {
        // Reference C code with state 1, 2, 3, 4: rotl(1 + 4, 23) + 1.
        let mut random = Random { state: [1, 2, 3, 4], spare: None };
        assert_eq!(random.next_bits(), 41_943_041);
        assert_eq!(random.next_bits(), 58_720_359);
    }

    #[test]
    fn moments_are_those_of_a_normal() {
        let mut random = Random::new(7);
        let n = 200_000;
        let sums = (0..n)
            .map(|_| random.normal())
            .fold([0.0; 3], |s, x| [s[0] + x, s[1] + x * x, s[2] + x.powi(4)]);
        let [mean, square, fourth] = sums.map(|s| s / f64::from(n));
        assert!(mean.abs() < 0.01 && (square - 1.0).abs() < 0.02 && (fourth - 3.0).abs() < 0.1);
    }
}
