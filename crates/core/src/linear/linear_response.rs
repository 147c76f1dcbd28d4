//! C (sI − A)⁻¹ B + D at many points, an input that does not reach an output exactly zero.
//! (Python side: models/linear/linear_system.py)

use num_complex::Complex64;

use crate::error::CoreError;
use crate::linear::discretisation::StateSpace;
use crate::numerics::complex_lanes::{LANES, Lanes};
use crate::numerics::complex_lu::ComplexLu;
use crate::numerics::sparse_lu::{Block, Factors, Plan};
use crate::numerics::widest::widest;

/// Points from which planning pivots costs less than choosing them at each.
const FEWEST: usize = 2 * LANES;

/// Entries of sI − A that are not zero for every s, row by row: the coefficient of s, and −A.
struct Pencil {
    n: usize,
    entries: Vec<(usize, usize)>,
    /// Of an entry's place: one on the diagonal, and −A.
    shares: Vec<(f64, f64)>,
}

impl Pencil {
    fn of(a: &[f64], n: usize) -> Self {
        let used = |&(row, column): &(usize, usize)| row == column || a[row * n + column] != 0.0;
        let entries = (0..n * n).map(|k| (k / n, k % n)).filter(used).collect();
        let shares =
            a.iter().enumerate().map(|(k, a)| (f64::from(u8::from(k / n == k % n)), -a)).collect();
        Self { n, entries, shares }
    }

    fn at(&self, s: Complex64) -> Vec<Complex64> {
        self.shares.iter().map(|&(rate, value)| s * rate + value).collect()
    }

    /// Pivots and fill for all points, planned at one that stands for them.
    fn plan(&self, points: &[Complex64]) -> Option<Plan> {
        if points.len() < FEWEST {
            return None;
        }
        let typical = self.at(points[points.len() / 2]);
        let values: Vec<_> = self.entries.iter().map(|(i, j)| typical[i * self.n + j]).collect();
        Plan::new(self.n, &self.entries, &values)
    }

    /// Factors at up to eight points.
    fn factor(&self, plan: Option<&Plan>, points: &[Complex64]) -> Result<Block, CoreError> {
        let mut lanes = Lanes::ZERO;
        (0..LANES).for_each(|lane| lanes.set(lane, points[lane.min(points.len() - 1)]));
        let entry = |row: usize, column: usize| {
            let (rate, value) = self.shares[row * self.n + column];
            let mut found = Lanes::real(value);
            found.add_scaled(rate, &lanes);
            found
        };
        let mut factors = Factors::default();
        if plan.is_some_and(|plan| plan.factor(entry, &mut factors)) {
            return Ok(Block::Planned(factors));
        }
        let each = points.iter().map(|&point| ComplexLu::new(self.at(point), self.n));
        each.collect::<Result<_, _>>().map(Block::Pivoted)
    }
}

/// A system at many points, eight of them at a time, from the side, inputs or outputs, that has fewer.
pub struct Eights<'a> {
    system: &'a StateSpace<'a>,
    n_inputs: usize,
    points: &'a [Complex64],
    pencil: Pencil,
    plan: Option<Plan>,
}

impl<'a> Eights<'a> {
    /// Plan the pivots for all points.
    pub fn new(system: &'a StateSpace<'a>, n_inputs: usize, points: &'a [Complex64]) -> Self {
        let pencil = Pencil::of(system.a, system.a.len().isqrt());
        let plan = pencil.plan(points);
        Self { system, n_inputs, points, pencil, plan }
    }

    /// Hand C (sI − A)⁻¹ B + D at up to eight points from `first` on to `keep`, pair by pair: output,
    /// input, values. Lanes beyond the last point repeat it.
    ///
    /// # Errors
    /// `Singular` where a point is an eigenvalue of A.
    pub fn around(
        &self,
        first: usize,
        keep: &mut impl FnMut(usize, usize, &Lanes),
    ) -> Result<(), CoreError> {
        let (system, n_inputs) = (self.system, self.n_inputs);
        let here = &self.points[first..self.points.len().min(first + LANES)];
        let mut whole = |output: usize, input: usize, value: &Lanes| {
            let mut value = *value;
            let through = system.d[output * n_inputs + input];
            value.re.iter_mut().for_each(|part| *part += through);
            keep(output, input, &value);
        };
        let block = self.pencil.factor(self.plan.as_ref(), here)?;
        widest(
            #[inline(always)]
            || around(system, n_inputs, self.plan.as_ref(), &block, &mut whole),
        );
        Ok(())
    }
}

/// Responses at the points, (`n_outputs`, `n_inputs`, `n_points`); the delays take no part.
///
/// # Errors
/// `Singular` where a point is an eigenvalue of A.
pub fn responses(
    system: &StateSpace<'_>,
    n_inputs: usize,
    points: &[Complex64],
) -> Result<Vec<Complex64>, CoreError> {
    let eights = Eights::new(system, n_inputs, points);
    let mut found = vec![Complex64::default(); system.n_outputs * n_inputs * points.len()];
    for first in (0..points.len()).step_by(LANES) {
        let count = LANES.min(points.len() - first);
        eights.around(first, &mut |output, input, value| {
            let at = (output * n_inputs + input) * points.len() + first;
            let lanes = found[at..at + count].iter_mut().enumerate();
            lanes.for_each(|(lane, to)| *to = value.get(lane));
        })?;
    }
    Ok(found)
}

/// C (sI − A)⁻¹ B at eight points, pair by pair.
#[inline(always)]
fn around(
    system: &StateSpace<'_>,
    n_inputs: usize,
    plan: Option<&Plan>,
    block: &Block,
    keep: &mut impl FnMut(usize, usize, &Lanes),
) {
    let (n, n_outputs) = (system.a.len().isqrt(), system.n_outputs);
    let (mut right, mut solution) = (vec![Lanes::ZERO; n], vec![Lanes::ZERO; n]);
    let input = |place: usize| system.b.iter().skip(place).step_by(n_inputs);
    let output = |place: usize| system.c[place * n..(place + 1) * n].iter();
    let transposed = n_outputs < n_inputs;
    for one in 0..n_outputs.min(n_inputs) {
        if transposed {
            right.iter_mut().zip(output(one)).for_each(|(to, c)| *to = Lanes::real(*c));
        } else {
            right.iter_mut().zip(input(one)).for_each(|(to, b)| *to = Lanes::real(*b));
        }
        block.solve(plan, &mut right, &mut solution, transposed);
        for other in 0..n_outputs.max(n_inputs) {
            let mut sum = Lanes::ZERO;
            let mut add = |(factor, value): (&f64, &Lanes)| {
                if *factor != 0.0 {
                    sum.add_scaled(*factor, value);
                }
            };
            if transposed {
                input(other).zip(&solution).for_each(&mut add);
                keep(one, other, &sum);
            } else {
                output(other).zip(&solution).for_each(&mut add);
                keep(other, one, &sum);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three lags of 1, 2 and 3 rad/s in parallel, their states mixed.
    #[test]
    fn a_sum_of_lags_is_found_behind_a_change_of_states() {
        // T diag(−1, −2, −3) T⁻¹ with T = [1 1 0; 0 1 1; 0 0 1].
        let a = [-1.0, -1.0, 1.0, 0.0, -2.0, -1.0, 0.0, 0.0, -3.0];
        let (b, c, d) = ([2.0, 2.0, 1.0], [1.0, -1.0, 2.0], [0.5]);
        let system = StateSpace { a: &a, b: &b, c: &c, d: &d, delays_s: &[0.0], n_outputs: 1 };
        let points = [Complex64::new(0.0, 0.7), Complex64::new(0.0, 40.0)];
        let found = responses(&system, 1, &points).unwrap();
        for (s, value) in points.iter().zip(found) {
            // T⁻¹ b = (1, 1, 1), c T = (1, 0, 1).
            let known = (s + 1.0).inv() + (s + 3.0).inv() + 0.5;
            assert!((value - known).norm() < 1e-14, "{value} for {known}");
        }
    }

    /// Ten states in a ring with a light mode on the way: pivots change, and both sides are used.
    #[test]
    fn many_points_at_once_are_each_by_itself() {
        let n = 10;
        let mut a = vec![0.0; n * n];
        for k in 0..n {
            a[k * n + k] = -0.01 * 3.0_f64.powi(i32::try_from(k).unwrap());
            a[k * n + (k + 3) % n] = 1.0 + 0.1 * a[k * n + k];
            a[k * n + (k + 7) % n] -= 2.0;
        }
        let b: Vec<f64> = (0..3 * n).map(|k| f64::from(u8::from(k % 4 == 0))).collect();
        let points: Vec<_> = (0..77).map(|k| Complex64::new(0.0, 1.1_f64.powi(k) * 0.02)).collect();
        for n_outputs in [2, 5] {
            let c: Vec<f64> = (0..n_outputs * n).map(|k| f64::from(u8::from(k % 3 == 0))).collect();
            let d = vec![0.25; n_outputs * 3];
            let system = StateSpace { a: &a, b: &b, c: &c, d: &d, delays_s: &[0.0; 3], n_outputs };
            let found = responses(&system, 3, &points).unwrap();
            for (place, &point) in points.iter().enumerate() {
                let alone = responses(&system, 3, &[point]).unwrap();
                for (pair, value) in alone.iter().enumerate() {
                    let error = (found[pair * points.len() + place] - value).norm();
                    assert!(error < 1e-12 * value.norm(), "{point}: {error:e} of {value}");
                }
            }
        }
    }

    #[test]
    fn a_pole_is_refused() {
        let one = [1.0];
        let system =
            StateSpace { a: &one, b: &one, c: &one, d: &one, delays_s: &[0.0], n_outputs: 1 };
        assert!(responses(&system, 1, &[Complex64::new(1.0, 0.0)]).is_err());
    }
}
