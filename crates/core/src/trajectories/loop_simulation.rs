//! Loops of linear and other elements in time (Python side: `control/loops/simulation.py`).
//!
//! The linear blocks are one system, discretised exactly for what drives it between the steps. What
//! is not linear stands around it as elements that read signals and drive rows; where an element acts
//! within a step, its values are repeated until they agree with the signals that they cause.

use crate::error::CoreError;
use crate::linear::linear_simulation::Discrete;
use crate::numerics::householder::dot;
use crate::trajectories::equation_step::EquationStep;
use crate::trajectories::runge_kutta::LARGEST_STATE;

/// Passes after which an algebraic loop is taken not to settle.
const PASSES: usize = 200;
/// Change over size at which it has settled.
const SETTLED: f64 = 1e-13;

/// What an element does with the signals that it reads.
#[derive(Debug, Clone)]
pub enum Element {
    /// Passes them on: the row itself is delayed.
    Through,
    /// Keeps them between two values.
    Limits {
        /// Lower value.
        low: f64,
        /// Upper value.
        high: f64,
    },
    /// Follows them by at most so much a step.
    RateLimit {
        /// Largest change.
        most: f64,
    },
    /// Takes them every so many steps and keeps them between.
    Hold {
        /// Steps from sample to sample.
        every: usize,
    },
    /// A recursion over its own samples.
    Recursion(Recursion),
    /// Equations of motion; signals are departures from their trim.
    Equations(Box<Equations>),
}

/// x⁺ = A x + B z, y = C x + D z every so many steps.
#[derive(Debug, Clone)]
pub struct Recursion {
    /// Steps from sample to sample.
    pub every: usize,
    /// n × n, row-major.
    pub a: Vec<f64>,
    /// n × m.
    pub b: Vec<f64>,
    /// p × n.
    pub c: Vec<f64>,
    /// p × m.
    pub d: Vec<f64>,
    /// n.
    pub state: Vec<f64>,
}

/// A nonlinear model in the loop.
#[derive(Debug, Clone)]
pub struct Equations {
    /// What advances it.
    pub step: EquationStep,
    /// Inputs that keep their value through a step instead of going in a straight line.
    pub held: Vec<bool>,
    /// Its inputs at the trim.
    pub trim_inputs: Vec<f64>,
    /// Its outputs at the trim.
    pub trim_outputs: Vec<f64>,
    /// Its state now.
    pub state: Vec<f64>,
    /// Its inputs at the step before.
    pub before: Vec<f64>,
    /// Its state after the step that is being settled.
    pub next: Vec<f64>,
}

/// An element with the signals that it reads and the rows that it drives.
#[derive(Debug, Clone)]
pub struct Port {
    /// What it does.
    pub element: Element,
    /// Places of signals.
    pub reads: Vec<usize>,
    /// Places of rows.
    pub rows: Vec<usize>,
}

/// What is kept of a run.
#[derive(Debug, Clone, Copy)]
pub struct Kept<'a> {
    /// Places of signals.
    pub signals: &'a [usize],
    /// Steps from one kept sample to the next.
    pub every: usize,
}

/// Run from an initial state of the linear blocks over the rows (n_rows × (n_steps + 1)). The first
/// column is the rest before the start; rows of ports are filled here. Returns the kept signals, time
/// last.
///
/// # Errors
/// `Shape` where something does not fit, `Singular` where an algebraic loop does not settle,
/// `Diverged` where a signal grows beyond all bounds.
pub fn simulate(
    core: &Discrete,
    ports: &mut [Port],
    rows: &mut [f64],
    n_steps: usize,
    initial: &[f64],
    kept: Kept<'_>,
) -> Result<Vec<f64>, CoreError> {
    check(core, ports, rows, n_steps, initial, kept)?;
    let (n, _, p) = core.size();
    let columns = n_steps + 1;
    let read: Vec<usize> = ports.iter().flat_map(|port| port.reads.iter().copied()).collect();
    let at_once =
        ports.iter().flat_map(|port| &port.rows).any(|&row| core.acts_at_once(row, &read));
    let n_kept = n_steps.div_ceil(kept.every);
    let mut found = vec![0.0; kept.signals.len() * n_kept];
    let (mut x, mut next, mut z) = (initial.to_vec(), initial.to_vec(), vec![0.0; p]);
    for step in 0..n_steps {
        settle(core, ports, rows, columns, step, at_once, (&x, &mut next, &mut z))?;
        if !z.iter().chain(&next[..n]).all(|value| value.abs() < LARGEST_STATE) {
            return Err(CoreError::Diverged { sample: step / kept.every });
        }
        ports.iter_mut().for_each(|port| port.commit(step, &z));
        std::mem::swap(&mut x, &mut next);
        if step.is_multiple_of(kept.every) {
            for (place, &signal) in kept.signals.iter().enumerate() {
                found[place * n_kept + step / kept.every] = z[signal];
            }
        }
    }
    Ok(found)
}

/// Values of all rows and signals of one step.
fn settle(
    core: &Discrete,
    ports: &mut [Port],
    rows: &mut [f64],
    columns: usize,
    step: usize,
    at_once: bool,
    (x, next, z): (&[f64], &mut [f64], &mut [f64]),
) -> Result<(), CoreError> {
    let mut fresh = Vec::new();
    // The last value is the best guess of the next one.
    for &row in ports.iter().flat_map(|port| &port.rows) {
        rows[row * columns + step + 1] = rows[row * columns + step];
    }
    for _ in 0..PASSES {
        if step == 0 {
            next.copy_from_slice(x);
        } else {
            core.advance(rows, columns, step, x, next);
        }
        core.outputs_at(rows, columns, step + 1, next, z);
        let (mut change, mut size) = (0.0_f64, 0.0_f64);
        for port in ports.iter_mut() {
            fresh.clear();
            fresh.extend(port.rows.iter().map(|&row| rows[row * columns + step]));
            port.value(step, z, &mut fresh)?;
            for (&row, &value) in port.rows.iter().zip(&fresh) {
                let place = &mut rows[row * columns + step + 1];
                change = change.max((value - *place).abs());
                size = size.max(value.abs());
                *place = value;
            }
        }
        if !(change.is_finite() && size < LARGEST_STATE) {
            return Err(CoreError::Diverged { sample: step });
        }
        if !at_once {
            // No element read what another has just given, but the signals show it.
            core.outputs_at(rows, columns, step + 1, next, z);
            return Ok(());
        }
        if change <= SETTLED * size {
            return Ok(());
        }
    }
    Err(CoreError::Singular { what: "an algebraic loop through limits, holds or equations" })
}

impl Port {
    /// Values of the rows from the signals; `rows` holds those of the step before.
    fn value(&mut self, step: usize, z: &[f64], rows: &mut [f64]) -> Result<(), CoreError> {
        let reads = &self.reads;
        match &mut self.element {
            Element::Through => rows.iter_mut().zip(reads).for_each(|(row, &s)| *row = z[s]),
            Element::Limits { low, high } => {
                rows.iter_mut().zip(reads).for_each(|(row, &s)| *row = z[s].max(*low).min(*high));
            }
            Element::RateLimit { most } => rows
                .iter_mut()
                .zip(reads)
                .for_each(|(row, &s)| *row += (z[s] - *row).max(-*most).min(*most)),
            Element::Hold { every } => {
                if step.is_multiple_of(*every) {
                    rows.iter_mut().zip(reads).for_each(|(row, &s)| *row = z[s]);
                }
            }
            Element::Recursion(own) => {
                if step.is_multiple_of(own.every) {
                    let read: Vec<f64> = reads.iter().map(|&s| z[s]).collect();
                    product(&own.c, &own.state, &own.d, &read, rows);
                }
            }
            Element::Equations(own) => {
                let inputs: Vec<f64> =
                    reads.iter().zip(&own.trim_inputs).map(|(&s, trim)| z[s] + trim).collect();
                own.next.copy_from_slice(&own.state);
                if step > 0 {
                    let ends = own.held.iter().zip(own.before.iter().zip(&inputs));
                    let to: Vec<f64> =
                        ends.map(|(held, (a, b))| *if *held { a } else { b }).collect();
                    own.step.advance(&own.before, &to, &mut own.next)?;
                }
                own.step.observe(&inputs, &own.next, rows)?;
                rows.iter_mut().zip(&own.trim_outputs).for_each(|(row, trim)| *row -= trim);
            }
        }
        Ok(())
    }

    /// Keep what the settled step leaves.
    fn commit(&mut self, step: usize, z: &[f64]) {
        match &mut self.element {
            Element::Recursion(own) if step.is_multiple_of(own.every) => {
                let read: Vec<f64> = self.reads.iter().map(|&s| z[s]).collect();
                let mut next = vec![0.0; own.state.len()];
                product(&own.a, &own.state, &own.b, &read, &mut next);
                own.state = next;
            }
            Element::Equations(own) => {
                own.state.copy_from_slice(&own.next);
                for ((before, &s), trim) in
                    own.before.iter_mut().zip(&self.reads).zip(&own.trim_inputs)
                {
                    *before = z[s] + trim;
                }
            }
            _ => {}
        }
    }

    fn check(&self, n_signals: usize, n_rows: usize) -> Result<(), CoreError> {
        let (n_in, n_out) = match &self.element {
            Element::Recursion(own) => {
                let n = own.state.len();
                let (m, p) = (self.reads.len(), self.rows.len());
                require("A of a recursion", own.a.len(), n * n)?;
                require("B of a recursion", own.b.len(), n * m)?;
                require("C of a recursion", own.c.len(), p * n)?;
                require("D of a recursion", own.d.len(), p * m)?;
                (m, p)
            }
            Element::Equations(own) => {
                let (n, m, p) = own.step.size();
                require("state of the equations", own.state.len(), n)?;
                require("next state of the equations", own.next.len(), n)?;
                require("inputs of the equations", own.before.len(), m)?;
                require("holds of the inputs", own.held.len(), m)?;
                require("trim of the inputs", own.trim_inputs.len(), m)?;
                require("trim of the outputs", own.trim_outputs.len(), p)?;
                (m, p)
            }
            _ => (self.rows.len(), self.rows.len()),
        };
        require("signals that an element reads", self.reads.len(), n_in)?;
        require("rows that an element drives", self.rows.len(), n_out)?;
        for (what, places, size) in
            [("place of a signal", &self.reads, n_signals), ("place of a row", &self.rows, n_rows)]
        {
            if let Some(&found) = places.iter().find(|&&place| place >= size) {
                return Err(CoreError::Shape { what, found, needed: size });
            }
        }
        match &self.element {
            Element::Hold { every: 0 } | Element::Recursion(Recursion { every: 0, .. }) => {
                Err(CoreError::Shape { what: "steps between samples", found: 0, needed: 1 })
            }
            _ => Ok(()),
        }
    }
}

/// result = M x + N u.
fn product(m: &[f64], x: &[f64], n: &[f64], u: &[f64], result: &mut [f64]) {
    for (row, out) in result.iter_mut().enumerate() {
        *out = dot(&m[row * x.len()..(row + 1) * x.len()], x)
            + dot(&n[row * u.len()..(row + 1) * u.len()], u);
    }
}

fn check(
    core: &Discrete,
    ports: &[Port],
    rows: &[f64],
    n_steps: usize,
    initial: &[f64],
    kept: Kept<'_>,
) -> Result<(), CoreError> {
    let (n, m, p) = core.size();
    require("rows of the loops", rows.len(), m * (n_steps + 1))?;
    require("initial state of the loops", initial.len(), n)?;
    if kept.every == 0 {
        return Err(CoreError::Shape { what: "steps between kept samples", found: 0, needed: 1 });
    }
    if let Some(&found) = kept.signals.iter().find(|&&place| place >= p) {
        return Err(CoreError::Shape { what: "place of a kept signal", found, needed: p });
    }
    if let Some(index) = rows.iter().position(|value| !value.is_finite()) {
        return Err(CoreError::NotFinite { what: "what drives the loops", index });
    }
    ports.iter().try_for_each(|port| port.check(p, m))
}

fn require(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

#[cfg(test)]
#[path = "tests/loop_simulation.rs"]
mod tests;
