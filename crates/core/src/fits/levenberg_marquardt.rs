//! The one Levenberg–Marquardt with bounds behind every fit. (Python side: identification/)
//!
//! Minimises Σ r_i(x)² subject to lower ≤ x ≤ upper. Each fit supplies residuals and exact Jacobian.
//! The Jacobian is triangularised once per accepted point; trial steps work on the small triangle.
//! Variables at a bound whose gradient points outward are held; a step that would cross a bound
//! stops there and the others are solved again.
//!
//! Reference: Moré (1978), "The Levenberg–Marquardt algorithm: implementation and theory"; damping
//! by Nielsen (1999); Nocedal & Wright, *Numerical Optimization*, 2nd ed., §10.3 and §16.7.

use crate::error::CoreError;
use crate::fits::dense_problem::Dense;
use crate::fits::least_squares::{
    Minimum, Objective, Options, Point, Problem, Progress, Termination,
};
use crate::numerics::householder::{back_substitute, dot, norm, triangularise};

/// Relative rise of the cost that rounding alone does not predict.
const RISE: f64 = 1e-9;
/// Relative fall of the cost that a minimum may leave: of thousands of residuals a thousandth of a
/// standard error.
const OFFSET: f64 = 1e-9;

/// Where a search ended.
#[derive(Debug, Clone)]
pub struct Found {
    /// Variables.
    pub x: Vec<f64>,
    /// Sum of squares there.
    pub cost: f64,
    /// Triangle of the Jacobian there, n × n, columns contiguous; empty where it was not asked for.
    pub triangle: Vec<f64>,
    /// Steps tried.
    pub iterations: usize,
    /// Why it ended.
    pub termination: Termination,
}

/// Minimise from `start`, which is moved into the bounds first. `proceed` is asked after each step
/// and ends the iteration by returning false.
///
/// # Errors
/// `Shape` or `Range` for bounds that do not fit, and whatever the problem refuses at the start.
pub fn minimise<P: Problem>(
    problem: &mut P,
    start: &[f64],
    lower: &[f64],
    upper: &[f64],
    options: &Options,
    proceed: &mut dyn FnMut(&Progress) -> bool,
) -> Result<Minimum, CoreError> {
    let mut dense = Dense::new(problem);
    let found = search(&mut dense, start, lower, upper, options, proceed)?;
    if found.triangle.is_empty() {
        dense.residuals.clear();
        dense.jacobian.clear();
    }
    Ok(Minimum {
        x: found.x,
        cost: found.cost,
        residuals: dense.residuals,
        jacobian: dense.jacobian,
        triangle: found.triangle,
        iterations: found.iterations,
        termination: found.termination,
    })
}

/// As `minimise`, for an objective that keeps its residuals to itself.
///
/// # Errors
/// As `minimise`.
pub fn search<O: Objective>(
    objective: &mut O,
    start: &[f64],
    lower: &[f64],
    upper: &[f64],
    options: &Options,
    proceed: &mut dyn FnMut(&Progress) -> bool,
) -> Result<Found, CoreError> {
    check(objective.n_parameters(), start, lower, upper)?;
    let mut x: Vec<f64> = (0..start.len()).map(|j| start[j].clamp(lower[j], upper[j])).collect();
    objective.project(&mut x);
    let mut search = Search::begin(objective, x, lower, upper)?;
    search.damping = options.first_damping;
    let termination = loop {
        if let Some(reason) = search.finished(options) {
            break reason;
        }
        if search.iterations >= options.maximum_iterations {
            break Termination::Iterations;
        }
        let outcome = search.step(objective, options)?;
        let Search { iterations: iteration, cost, ref x, .. } = search;
        if !proceed(&Progress { iteration, cost, x }) {
            break Termination::Interrupted;
        }
        if let Some(reason) = outcome {
            break reason;
        }
    };
    let (x, cost, iterations) = (search.x, search.cost, search.iterations);
    Ok(Found { x, cost, triangle: search.point.triangle, iterations, termination })
}

fn check(n: usize, start: &[f64], lower: &[f64], upper: &[f64]) -> Result<(), CoreError> {
    for (what, found) in
        [("start", start.len()), ("lower bounds", lower.len()), ("upper bounds", upper.len())]
    {
        if found != n {
            return Err(CoreError::Shape { what, found, needed: n });
        }
    }
    if let Some(index) = start.iter().position(|value| !value.is_finite()) {
        return Err(CoreError::NotFinite { what: "the start", index });
    }
    match (0..n).find(|&j| lower[j].is_nan() || upper[j].is_nan() || lower[j] > upper[j]) {
        Some(j) => Err(CoreError::Range {
            what: "lower bound",
            found: lower[j],
            needed: "at most the upper bound",
        }),
        None => Ok(()),
    }
}

struct Search<'a> {
    lower: &'a [f64],
    upper: &'a [f64],
    x: Vec<f64>,
    cost: f64,
    first_cost: f64,
    point: Point,
    gradient: Vec<f64>,
    scale: Vec<f64>,
    damping: f64,
    growth: f64,
    iterations: usize,
    trial: Vec<f64>,
    delta: Vec<f64>,
    work: Vec<f64>,
}

impl<'a> Search<'a> {
    fn begin<O: Objective>(
        objective: &mut O,
        x: Vec<f64>,
        lower: &'a [f64],
        upper: &'a [f64],
    ) -> Result<Self, CoreError> {
        let n = x.len();
        objective.begin(&x)?;
        let mut search = Self {
            lower,
            upper,
            trial: x.clone(),
            delta: vec![0.0; n],
            gradient: vec![0.0; n],
            scale: vec![0.0; n],
            point: Point::new(n),
            work: Vec::new(),
            x,
            cost: 0.0,
            first_cost: 0.0,
            damping: 0.0,
            growth: 2.0,
            iterations: 0,
        };
        search.linearise(objective)?;
        search.first_cost = search.cost;
        Ok(search)
    }

    /// Triangle of the Jacobian at `x`, the gradient and the scales.
    fn linearise<O: Objective>(&mut self, objective: &mut O) -> Result<(), CoreError> {
        objective.linearise(&self.x, &mut self.point)?;
        self.cost = self.point.cost;
        for j in 0..self.x.len() {
            let column = self.column(j);
            let (length, slope) = (norm(column), dot(column, &self.point.projected));
            // Scales never shrink (Moré): a column that fades for a while does not let its variable
            // loose.
            self.scale[j] = self.scale[j].max(length);
            self.gradient[j] = slope;
        }
        Ok(())
    }

    fn is_held(&self, j: usize) -> bool {
        self.lower[j] == self.upper[j]
            || (self.x[j] <= self.lower[j] && self.gradient[j] > 0.0)
            || (self.x[j] >= self.upper[j] && self.gradient[j] < 0.0)
    }

    fn column(&self, j: usize) -> &[f64] {
        &self.point.triangle[j * self.x.len()..(j + 1) * self.x.len()]
    }

    fn finished(&self, options: &Options) -> Option<Termination> {
        if self.cost <= 1e-30 * self.first_cost || self.cost == 0.0 {
            return Some(Termination::Zero);
        }
        let size = self.cost.sqrt();
        let mut any = false;
        // What eliminated numbers would still take is slope as well.
        if self.point.beside.sqrt() > options.gradient_tolerance * size {
            return None;
        }
        for j in (0..self.x.len()).filter(|&j| !self.is_held(j)) {
            any = true;
            let length = norm(self.column(j));
            // The cosine between residuals and column: free of units.
            if length > 0.0 && self.gradient[j].abs() > options.gradient_tolerance * length * size {
                return None;
            }
        }
        Some(if any { Termination::Gradient } else { Termination::Bounds })
    }

    /// One trial step; a reason where the iteration is over.
    fn step<O: Objective>(
        &mut self,
        objective: &mut O,
        options: &Options,
    ) -> Result<Option<Termination>, CoreError> {
        self.iterations += 1;
        self.solve();
        let n = self.x.len();
        for j in 0..n {
            self.trial[j] = (self.x[j] + self.delta[j]).clamp(self.lower[j], self.upper[j]);
            self.delta[j] = self.trial[j] - self.x[j];
        }
        let predicted = self.predicted_reduction() + self.point.beside;
        objective.project(&mut self.trial);
        let scaled = |values: &[f64]| -> f64 {
            values.iter().zip(&self.scale).map(|(v, s)| (v * s).powi(2)).sum::<f64>().sqrt()
        };
        let small = scaled(&self.delta) <= options.step_tolerance * scaled(&self.x);
        let cost = objective.cost(&self.trial).unwrap_or(f64::INFINITY);
        let reduction = self.cost - cost;
        if !(cost.is_finite() && reduction > 0.0 && predicted > 0.0) {
            return Ok(self.refuse(small, predicted, options));
        }
        let ratio = reduction / predicted;
        let flat = reduction.max(predicted) <= options.cost_tolerance * self.cost;
        std::mem::swap(&mut self.x, &mut self.trial);
        // Nielsen: the better the prediction, the less damping, within these factors.
        self.damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(1.0 / 10.0, 2.0);
        self.damping = self.damping.max(1e-20);
        self.growth = 2.0;
        let reason = if small {
            Some(Termination::Step)
        } else if flat {
            Some(Termination::Cost)
        } else {
            None
        };
        if options.last_slopes || self.iterations < options.maximum_iterations {
            self.linearise(objective)?;
            let promise: f64 = self.point.projected.iter().map(|q| q * q).sum();
            let goes_on = options.undamped_end && promise > options.cost_tolerance * self.cost;
            return Ok(reason.filter(|reason| *reason != Termination::Cost || !goes_on));
        }
        self.cost = cost;
        self.point.triangle.clear();
        Ok(Some(reason.unwrap_or(Termination::Iterations)))
    }

    fn refuse(&mut self, small: bool, predicted: f64, options: &Options) -> Option<Termination> {
        // A step that was cut at bounds may promise a rise: that asks for damping, not for an end.
        let rises = predicted < -RISE * self.cost;
        if !rises && predicted <= options.cost_tolerance * self.cost {
            // Rounding hides any further reduction.
            return Some(Termination::Cost);
        }
        if small {
            return Some(if self.damping < 1.0 { Termination::Step } else { self.stalled() });
        }
        // Refusals in a row raise the damping ever faster.
        self.damping *= self.growth;
        self.growth *= 2.0;
        (self.damping > 1e20).then(|| self.stalled())
    }

    /// Where no step lowers the cost: at a minimum, as far as the cost can tell, where even the
    /// undamped step would take next to nothing away.
    ///
    /// Reference: Bates & Watts (1981), *Technometrics* 23: the relative offset.
    fn stalled(&mut self) -> Termination {
        self.damping = f64::EPSILON.powi(2);
        self.solve();
        let left = self.predicted_reduction() + self.point.beside;
        if left <= OFFSET * self.cost { Termination::Cost } else { Termination::Stalled }
    }

    fn predicted_reduction(&self) -> f64 {
        let n = self.x.len();
        let mut reduction = 0.0;
        for row in 0..n {
            let change: f64 =
                (row..n).map(|j| self.point.triangle[j * n + row] * self.delta[j]).sum();
            reduction -= change * (2.0 * self.point.projected[row] + change);
        }
        reduction
    }

    /// Damped step with the held variables at rest and crossing ones stopped at their bound.
    fn solve(&mut self) {
        let n = self.x.len();
        self.delta.fill(0.0);
        let mut free: Vec<usize> = (0..n).filter(|&j| !self.is_held(j)).collect();
        while !free.is_empty() {
            let step = self.damped(&free);
            let crossing =
                |j: usize, d: f64| self.x[j] + d < self.lower[j] || self.x[j] + d > self.upper[j];
            let crossed: Vec<usize> = free
                .iter()
                .zip(&step)
                .filter(|&(&j, &d)| crossing(j, d))
                .map(|(&j, _)| j)
                .collect();
            for (&j, &d) in free.iter().zip(&step) {
                let bound = if d < 0.0 { self.lower[j] } else { self.upper[j] };
                self.delta[j] = if crossing(j, d) { bound - self.x[j] } else { d };
            }
            if crossed.is_empty() {
                return;
            }
            free.retain(|j| !crossed.contains(j));
        }
    }

    /// min ‖R_F δ + Qᵀr + R_B δ_B‖² + λ‖D_F δ‖² for the free columns F.
    fn damped(&mut self, free: &[usize]) -> Vec<f64> {
        let (n, f) = (self.x.len(), free.len());
        let m = n + f;
        let mut work = std::mem::take(&mut self.work);
        work.clear();
        work.resize(m * (f + 1), 0.0);
        for (place, &j) in free.iter().enumerate() {
            work[place * m..place * m + n].copy_from_slice(self.column(j));
            let scale = if self.scale[j] > 0.0 { self.scale[j] } else { 1.0 };
            work[place * m + n + place] = self.damping.sqrt() * scale;
        }
        let rhs = &mut work[f * m..];
        for (row, entry) in rhs.iter_mut().enumerate().take(n) {
            // Variables stopped at a bound move what is left to it; the free ones answer.
            let moved: f64 = (0..n)
                .filter(|j| !free.contains(j))
                .map(|j| self.point.triangle[j * n + row] * self.delta[j])
                .sum();
            *entry = -(self.point.projected[row] + moved);
        }
        triangularise(&mut work, m, f);
        let mut step = vec![0.0; f];
        back_substitute(&work, m, f, &work[f * m..], &mut step);
        self.work = work;
        step
    }
}

#[cfg(test)]
#[path = "tests/levenberg_marquardt.rs"]
mod tests;
