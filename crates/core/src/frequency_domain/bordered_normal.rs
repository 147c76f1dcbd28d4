//! Normal equations of rational responses: each record's transient is eliminated, the rest is shared.
//! (Python side: none)

/// Share of a column that the others must leave, squared, for its equations to be told apart.
const LEAST_PIVOT: f64 = 1e-10;

/// How coefficients lie: numerators and denominator but its first, then each record's transient.
#[derive(Debug, Clone, Copy)]
pub struct Unknowns {
    /// Terms of a transient.
    pub n_own: usize,
    /// Of the denominator.
    pub order: usize,
    /// Inputs.
    pub n_inputs: usize,
}

impl Unknowns {
    /// Coefficients that all records share.
    pub fn shared(&self) -> usize {
        self.n_inputs * (self.order + 1) + self.order
    }

    /// All coefficients of some records.
    pub fn all(&self, n_records: usize) -> usize {
        self.shared() + n_records * self.n_own
    }

    /// Channel and power of each column of a record: its transient, the inputs, the output.
    pub fn columns(&self) -> Vec<(usize, usize)> {
        let inputs =
            (1..=self.n_inputs).flat_map(|channel| (0..=self.order).map(move |k| (channel, k)));
        let output = (1..=self.order).map(|k| (self.n_inputs + 1, k));
        (0..self.n_own).map(|k| (0, k)).chain(inputs).chain(output).collect()
    }

    /// First power of a channel's columns, and its coefficients.
    pub fn of_channel<'a>(
        &self,
        channel: usize,
        record: usize,
        coefficients: &'a [f64],
    ) -> (usize, &'a [f64]) {
        let (shared, size) = (self.shared(), self.order + 1);
        if channel == 0 {
            return (0, &coefficients[shared + record * self.n_own..][..self.n_own]);
        }
        let last = usize::from(channel > self.n_inputs);
        (last, &coefficients[(channel - 1) * size..][..size - last])
    }
}

/// Products of one record's columns.
#[derive(Debug, Clone)]
pub struct Record {
    /// By pair of channels, each with those to its right: real sums by difference of powers, then
    /// imaginary ones.
    pub pairs: Vec<f64>,
    /// Of each column with the target.
    pub right: Vec<f64>,
    /// Differences of powers that are held.
    pub rows: usize,
}

impl Record {
    fn product(&self, n_channels: usize, one: (usize, usize), other: (usize, usize)) -> f64 {
        let (left, right) = if one.0 <= other.0 { (one, other) } else { (other, one) };
        let pair = left.0 * n_channels - left.0 * (left.0 + 1) / 2 + right.0;
        let at = 2 * self.rows * pair + left.1.abs_diff(right.1);
        let (re, im) = (self.pairs[at], self.pairs[at + self.rows]);
        if right.1 >= left.1 { re - im } else { re + im }
    }
}

/// The triangle of one record's own columns, and the shared columns behind it.
#[derive(Debug, Clone)]
struct Border {
    scale: f64,
    triangle: Vec<f64>,
    beside: Vec<f64>,
}

/// Triangles of the normal equations, columns scaled to length one.
#[derive(Debug, Clone)]
pub struct BorderedNormal {
    unknowns: Unknowns,
    borders: Vec<Border>,
    scales: Vec<f64>,
    triangle: Vec<f64>,
}

impl BorderedNormal {
    /// Of the products of some records; None where a column is nearly a sum of others.
    pub fn of(unknowns: Unknowns, records: &[Record]) -> Option<Self> {
        let (columns, n_own, n) = (unknowns.columns(), unknowns.n_own, unknowns.shared());
        let n_channels = unknowns.n_inputs + 2;
        let shared = &columns[n_own..];
        let mut schur = vec![0.0; n * n];
        for record in records {
            for (i, one) in shared.iter().enumerate() {
                for (j, other) in shared[..=i].iter().enumerate() {
                    schur[i * n + j] += record.product(n_channels, *one, *other);
                }
            }
        }
        let scales: Vec<f64> = (0..n).map(|k| 1.0 / schur[k * n + k].sqrt()).collect();
        for i in 0..n {
            for j in 0..=i {
                schur[i * n + j] *= scales[i] * scales[j];
            }
        }
        let mut borders = Vec::with_capacity(records.len());
        for record in records {
            let border = Border::of(record, &columns, n_own, n_channels, &scales)?;
            for i in 0..n {
                let one = &border.beside[i * n_own..(i + 1) * n_own];
                for j in 0..=i {
                    let other = &border.beside[j * n_own..(j + 1) * n_own];
                    schur[i * n + j] -= product(one, other);
                }
            }
            borders.push(border);
        }
        factored(&mut schur, n)?;
        Some(Self { unknowns, borders, scales, triangle: schur })
    }

    /// Coefficients for right sides by record, each by column.
    pub fn solve(&self, right: &[&[f64]]) -> Vec<f64> {
        let (n_own, n) = (self.unknowns.n_own, self.unknowns.shared());
        let mut shared = vec![0.0; n];
        let mut owns: Vec<Vec<f64>> = Vec::with_capacity(right.len());
        for (border, right) in self.borders.iter().zip(right) {
            let mut own: Vec<f64> = right[..n_own].iter().map(|x| x * border.scale).collect();
            forward(&border.triangle, &mut own);
            for (k, sum) in shared.iter_mut().enumerate() {
                let beside = &border.beside[k * n_own..(k + 1) * n_own];
                *sum += self.scales[k] * right[n_own + k] - product(beside, &own);
            }
            owns.push(own);
        }
        forward(&self.triangle, &mut shared);
        backward(&self.triangle, &mut shared);
        let mut found: Vec<f64> = shared.iter().zip(&self.scales).map(|(x, s)| x * s).collect();
        for (border, mut own) in self.borders.iter().zip(owns) {
            for (value, beside) in shared.iter().zip(border.beside.chunks_exact(n_own)) {
                for (each, factor) in own.iter_mut().zip(beside) {
                    *each -= factor * value;
                }
            }
            backward(&border.triangle, &mut own);
            found.extend(own.iter().map(|x| x * border.scale));
        }
        found
    }

    /// Size of coefficients, each in lengths of its column.
    pub fn size(&self, coefficients: &[f64]) -> f64 {
        let (n_own, n) = (self.unknowns.n_own, self.unknowns.shared());
        let (shared, owns) = coefficients.split_at(n);
        let parts = shared.iter().zip(&self.scales).map(|(x, s)| (x / s) * (x / s));
        let own = owns.chunks_exact(n_own).zip(&self.borders).flat_map(|(part, border)| {
            part.iter().map(|x| (x / border.scale) * (x / border.scale))
        });
        parts.chain(own).sum::<f64>().sqrt()
    }
}

impl Border {
    fn of(
        record: &Record,
        columns: &[(usize, usize)],
        n_own: usize,
        n_channels: usize,
        scales: &[f64],
    ) -> Option<Self> {
        let (own, shared) = columns.split_at(n_own);
        // All powers have the length of the first: their turns are of modulus one.
        let scale = 1.0 / record.product(n_channels, (0, 0), (0, 0)).sqrt();
        let mut triangle = vec![0.0; n_own * n_own];
        for (i, one) in own.iter().enumerate() {
            for (j, other) in own[..=i].iter().enumerate() {
                triangle[i * n_own + j] = scale * scale * record.product(n_channels, *one, *other);
            }
        }
        factored(&mut triangle, n_own)?;
        let mut beside = Vec::with_capacity(shared.len() * n_own);
        for (one, factor) in shared.iter().zip(scales) {
            let mut column: Vec<f64> = own
                .iter()
                .map(|other| scale * factor * record.product(n_channels, *other, *one))
                .collect();
            forward(&triangle, &mut column);
            beside.extend(column);
        }
        Some(Self { scale, triangle, beside })
    }
}

fn product(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

/// Cholesky's lower triangle in place of a symmetric matrix of unit diagonal; None where a pivot is lost.
fn factored(matrix: &mut [f64], n: usize) -> Option<()> {
    for i in 0..n {
        for j in 0..=i {
            let (above, rest) = matrix.split_at_mut(i * n);
            let row = &mut rest[..n];
            if j == i {
                let pivot = row[i] - product(&row[..i], &row[..i]);
                if !pivot.ge(&LEAST_PIVOT) {
                    return None;
                }
                row[i] = pivot.sqrt();
            } else {
                let other = &above[j * n..j * n + n];
                row[j] = (row[j] - product(&row[..j], &other[..j])) / other[j];
            }
        }
    }
    Some(())
}

fn forward(triangle: &[f64], right: &mut [f64]) {
    let n = right.len();
    for i in 0..n {
        let row = &triangle[i * n..i * n + i + 1];
        right[i] = (right[i] - product(&row[..i], &right[..i])) / row[i];
    }
}

fn backward(triangle: &[f64], right: &mut [f64]) {
    let n = right.len();
    for i in (0..n).rev() {
        right[i] /= triangle[i * n + i];
        let value = right[i];
        for (each, factor) in right[..i].iter_mut().zip(&triangle[i * n..]) {
            *each -= factor * value;
        }
    }
}
