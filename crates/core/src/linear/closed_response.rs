//! Responses of a linear core whose signals come back to it: late, and through blocks of their own.
//! (Python side: control/loops/response.py)

use num_complex::Complex64;

use crate::error::CoreError;
use crate::linear::discretisation::StateSpace;
use crate::linear::linear_response::Eights;
use crate::numerics::complex_lanes::{LANES, Lanes};
use crate::numerics::complex_lu::ComplexLu;

/// What drives the columns of a core, and what of its signals comes back.
#[derive(Debug, Clone)]
pub struct Around<'a> {
    /// Delay of each column, s.
    pub delays_s: &'a [f64],
    /// Number of signals from outside.
    pub n_outside: usize,
    /// Of each column what drives it: a signal from outside, or behind these one that goes around.
    pub drivers: &'a [usize],
    /// Outputs of the core that go around: those that drive themselves, then what the ports read.
    pub seen: &'a [usize],
    /// Responses of the ports, (`n_given`, `n_reads`, `n_points`): they drive behind the others.
    pub ports: &'a [Complex64],
    /// How many signals the ports give, and read.
    pub n_given: usize,
    /// See `n_given`.
    pub n_reads: usize,
    /// Outputs of the core that are asked for.
    pub wanted: &'a [usize],
}

impl Around<'_> {
    fn check(&self, n_outputs: usize, n_points: usize) -> Result<(), CoreError> {
        let shape = |what, found, needed| Err(CoreError::Shape { what, found, needed });
        let n = self.drivers.len();
        if self.delays_s.len() != n {
            return shape("delays of columns", self.delays_s.len(), n);
        }
        if self.seen.len() < self.n_reads {
            return shape("signals that go around", self.seen.len(), self.n_reads);
        }
        let needed = self.n_given * self.n_reads * n_points;
        if self.ports.len() != needed {
            return shape("responses of ports", self.ports.len(), needed);
        }
        let drives = self.n_outside + self.n_late() + self.n_given;
        if let Some(&found) = self.drivers.iter().find(|&&each| each >= drives) {
            return shape("what drives a column", found, drives);
        }
        if let Some(&found) = self.seen.iter().chain(self.wanted).find(|&&each| each >= n_outputs) {
            return shape("an output of the core", found, n_outputs);
        }
        Ok(())
    }

    fn n_late(&self) -> usize {
        self.seen.len() - self.n_reads
    }

    /// Responses at one point from those of the core, (`n_outputs`, columns), to (wanted, outside).
    fn close(
        &self,
        point: usize,
        n_points: usize,
        core: &[Complex64],
        found: &mut [Complex64],
    ) -> Result<(), CoreError> {
        let (n, outside) = (self.drivers.len(), self.n_outside);
        let (late, around) = (self.n_late(), self.n_late() + self.n_given);
        // What each signal from outside, and then each that goes around, makes of an output.
        let driven = |output: usize| {
            let mut sums = vec![Complex64::default(); outside + around];
            for (value, &driver) in core[output * n..(output + 1) * n].iter().zip(self.drivers) {
                sums[driver] += value;
            }
            sums
        };
        let (mut loops, mut given) = (
            vec![Complex64::default(); around * around],
            vec![Complex64::default(); around * outside],
        );
        let mut add = |row: usize, share: Complex64, sums: &[Complex64]| {
            let (from, back) = sums.split_at(outside);
            let into = loops[row * around..(row + 1) * around].iter_mut().zip(back);
            into.for_each(|(to, value)| *to -= share * value);
            for (input, value) in from.iter().enumerate() {
                given[input * around + row] += share * value;
            }
        };
        for (row, &output) in self.seen[..late].iter().enumerate() {
            add(row, Complex64::new(1.0, 0.0), &driven(output));
        }
        for (read, &output) in self.seen[late..].iter().enumerate() {
            let sums = driven(output);
            for port in 0..self.n_given {
                add(
                    late + port,
                    self.ports[(port * self.n_reads + read) * n_points + point],
                    &sums,
                );
            }
        }
        (0..around).for_each(|k| loops[k * around + k] += 1.0);
        let factors = ComplexLu::new(loops, around)?;
        given.chunks_exact_mut(around.max(1)).for_each(|right| factors.solve(right));
        for (row, &output) in self.wanted.iter().enumerate() {
            let sums = driven(output);
            let (from, back) = sums.split_at(outside);
            for (input, direct) in from.iter().enumerate() {
                let moved = given[input * around..(input + 1) * around].iter();
                let returned: Complex64 = back.iter().zip(moved).map(|(a, b)| a * b).sum();
                found[(row * outside + input) * n_points + point] = direct + returned;
            }
        }
        Ok(())
    }
}

/// Responses from outside at points s with all loops closed, (`n_wanted`, `n_outside`, `n_points`).
///
/// # Errors
/// `Shape` where sizes do not fit, `Singular` where a point is a pole of the core or of the loops.
pub fn closed_responses(
    core: &StateSpace<'_>,
    around: &Around<'_>,
    points: &[Complex64],
) -> Result<Vec<Complex64>, CoreError> {
    let (n_columns, n_outputs) = (around.drivers.len(), core.n_outputs);
    around.check(n_outputs, points.len())?;
    let eights = Eights::new(core, n_columns, points);
    let size = around.wanted.len() * around.n_outside;
    let mut found = vec![Complex64::default(); size * points.len()];
    let mut values = vec![Lanes::ZERO; n_outputs * n_columns];
    let mut alone = vec![Complex64::default(); values.len()];
    let mut late = vec![Complex64::default(); n_columns];
    for first in (0..points.len()).step_by(LANES) {
        eights.around(first, &mut |output, column, value| {
            values[output * n_columns + column] = *value;
        })?;
        for (lane, &s) in points[first..].iter().take(LANES).enumerate() {
            late.iter_mut().zip(around.delays_s).for_each(|(to, delay)| *to = (-s * delay).exp());
            for (to, (value, turn)) in alone.iter_mut().zip(values.iter().zip(late.iter().cycle()))
            {
                *to = value.get(lane) * turn;
            }
            around.close(first + lane, points.len(), &alone, &mut found)?;
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(omega: &[f64]) -> Vec<Complex64> {
        omega.iter().map(|&each| Complex64::new(0.0, each)).collect()
    }

    /// y = (u − 2 y(t − 0.3)) / (s + 1), closed: 1 / (s + 1 + 2 e^(−0.3 s)).
    #[test]
    fn a_late_signal_comes_back() {
        let core = StateSpace {
            a: &[-1.0],
            b: &[1.0, -2.0],
            c: &[1.0],
            d: &[0.0, 0.0],
            delays_s: &[],
            n_outputs: 1,
        };
        let around = Around {
            delays_s: &[0.0, 0.3],
            n_outside: 1,
            drivers: &[0, 1],
            seen: &[0],
            ports: &[],
            n_given: 0,
            n_reads: 0,
            wanted: &[0],
        };
        let points = at(&(0..19).map(|k| 0.2 * f64::from(k)).collect::<Vec<_>>());
        let found = closed_responses(&core, &around, &points).unwrap();
        for (s, value) in points.iter().zip(found) {
            let known = (s + 1.0 + 2.0 * (-0.3 * s).exp()).inv();
            assert!((value - known).norm() < 1e-13, "{value} for {known}");
        }
    }

    /// A port of gain P reads y and drives two columns, one of them late.
    #[test]
    fn a_port_drives_several_columns() {
        let core = StateSpace {
            a: &[-1.0],
            b: &[1.0, 1.0, 1.0],
            c: &[1.0, 0.0],
            d: &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            delays_s: &[],
            n_outputs: 2,
        };
        let points = at(&[0.1, 1.0, 7.0]);
        let ports: Vec<_> = [1.0, -0.5, 2.0].map(|p| Complex64::new(p, 0.25)).to_vec();
        let around = Around {
            delays_s: &[0.0, 0.0, 0.2],
            n_outside: 1,
            drivers: &[0, 1, 1],
            seen: &[0],
            ports: &ports,
            n_given: 1,
            n_reads: 1,
            wanted: &[0, 1],
        };
        let found = closed_responses(&core, &around, &points).unwrap();
        for (k, (s, port)) in points.iter().zip(&ports).enumerate() {
            let known = (s + 1.0 - port * (1.0 + (-0.2 * s).exp())).inv();
            assert!((found[k] - known).norm() < 1e-13, "{} for {known}", found[k]);
            assert!((found[3 + k] - 1.0).norm() < 1e-15);
        }
    }

    #[test]
    fn a_loop_of_gain_one_is_refused() {
        let core =
            StateSpace { a: &[], b: &[], c: &[], d: &[1.0, 1.0], delays_s: &[], n_outputs: 1 };
        let around = Around {
            delays_s: &[0.0, 0.0],
            n_outside: 1,
            drivers: &[0, 1],
            seen: &[0],
            ports: &[],
            n_given: 0,
            n_reads: 0,
            wanted: &[0],
        };
        assert!(closed_responses(&core, &around, &at(&[1.0])).is_err());
        let far = Around { drivers: &[0, 2], ..around };
        assert!(matches!(
            closed_responses(&core, &far, &at(&[1.0])),
            Err(CoreError::Shape { found: 2, needed: 2, .. })
        ));
    }
}
