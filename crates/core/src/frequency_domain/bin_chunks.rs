//! Fourier bins some at a time, and sums of their products. (Python side: none)

use num_complex::Complex64;

/// Bins that are worked on together; unused ones count nothing.
pub(crate) const CHUNK: usize = 64;
/// Running sums of one product, and products side by side.
pub(crate) const LANES: usize = 8;
pub(crate) const ABREAST: usize = 4;

/// Running sums of one product.
pub(crate) type Sums = [f64; LANES];

/// Values of one chunk, each row `CHUNK` long.
pub(crate) struct Chunk {
    pub(crate) from: usize,
    pub(crate) count: usize,
    pub(crate) powers: [Vec<f64>; 2],
    pub(crate) channels: [Vec<f64>; 2],
}

impl Chunk {
    /// Power times the conjugate of one channel times another.
    #[inline(always)]
    pub(crate) fn weighed_product(
        &self,
        a: usize,
        b: usize,
        power: &[f64; CHUNK],
    ) -> ([f64; CHUNK], [f64; CHUNK]) {
        let mut found = ([0.0; CHUNK], [0.0; CHUNK]);
        let [re, im] = &self.channels;
        let (p, q) = (&re[a * CHUNK..][..CHUNK], &im[a * CHUNK..][..CHUNK]);
        let (r, s) = (&re[b * CHUNK..][..CHUNK], &im[b * CHUNK..][..CHUNK]);
        for k in 0..CHUNK {
            found.0[k] = power[k] * (p[k] * r[k] + q[k] * s[k]);
            found.1[k] = power[k] * (p[k] * s[k] - q[k] * r[k]);
        }
        found
    }

    /// Add the products of each channel's columns with values: `rows` of the first, `further` of others.
    #[inline(always)]
    pub(crate) fn pull(
        &self,
        values: &[[f64; CHUNK]; 2],
        sums: &mut [Sums],
        rows: usize,
        further: usize,
    ) {
        for (channel, sums) in sums.chunks_exact_mut(rows).enumerate() {
            let (re, im) =
                (&self.channels[0][channel * CHUNK..], &self.channels[1][channel * CHUNK..]);
            let mut made = ([0.0; CHUNK], [0.0; CHUNK]);
            for k in 0..CHUNK {
                made.0[k] = re[k] * values[0][k] + im[k] * values[1][k];
                made.1[k] = re[k] * values[1][k] - im[k] * values[0][k];
            }
            let held = if channel == 0 { rows } else { further };
            add_products(&made.0, &self.powers[0], &mut sums[..held]);
            add_products(&made.1, &self.powers[1], &mut sums[..held]);
        }
    }
}

/// Real and imaginary parts, nothing behind their end.
pub(crate) fn apart(values: &[Complex64]) -> [[f64; CHUNK]; 2] {
    let mut found = [[0.0; CHUNK]; 2];
    for (k, value) in values.iter().enumerate() {
        (found[0][k], found[1][k]) = (value.re, value.im);
    }
    found
}

/// Add the products of one row with several: `ABREAST` at a time, so that no sum waits for another.
#[inline(always)]
pub(crate) fn add_products(row: &[f64; CHUNK], others: &[f64], sums: &mut [Sums]) {
    let several = others.chunks_exact(ABREAST * CHUNK).zip(sums.chunks_exact_mut(ABREAST));
    for (others, sums) in several {
        let mut running = [[0.0; LANES]; ABREAST];
        for at in (0..CHUNK).step_by(LANES) {
            for (which, lanes) in running.iter_mut().enumerate() {
                let other = &others[which * CHUNK + at..][..LANES];
                for k in 0..LANES {
                    lanes[k] += row[at + k] * other[k];
                }
            }
        }
        for (sum, lanes) in sums.iter_mut().zip(&running) {
            for k in 0..LANES {
                sum[k] += lanes[k];
            }
        }
    }
}
