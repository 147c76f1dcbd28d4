//! Newton steps of ARMAX prediction errors from one pass over the data, to rank many structures.
//! (Python side: validation/order_scan/scan_orders.py)
//!
//! Second slopes of the errors count: where a structure is too small its errors stay large, and steps
//! without them take dozens of rounds. Where they make the sum of squares bend downward, and where C
//! remembers longer than a piece of a record, the usual steps are made. Near the point of a curvature
//! only cost and gradient are made anew: they alone say where a minimum is.
//!
//! Reference: Nocedal & Wright, *Numerical Optimization*, 2nd ed., §10.3; the level is eliminated as in
//! Kaufman (1975), BIT 15.

use crate::black_box::armax_sums::{At, Cut, Group, Source, Sums, groups, sums};
use crate::black_box::lane_rows::LANES;
use crate::black_box::polynomial_fit::PredictionError;
use crate::black_box::polynomial_normal::factorise;
use crate::black_box::polynomial_orders::Orders;
use crate::black_box::polynomial_predictor::Polynomials;
use crate::black_box::steady_answers::Steady;
use crate::error::CoreError;
use crate::fits::dense_problem::Dense;
use crate::fits::least_squares::{Objective, Point};

/// Share of the curvature without second slopes that must be left with them.
const BENDS: f64 = 0.1;
/// Share of the sum of squares that a step promises to take away at most where curvature is kept.
const NEAR: f64 = 1e-5;

/// Sum of squared prediction errors of an ARMAX structure.
pub struct Newton<'p, 'd> {
    cuts: &'p [Cut],
    orders: Orders,
    groups: Vec<Group>,
    skip: usize,
    levels: bool,
    usual: Dense<'p, PredictionError<'d>>,
    made: Option<(Vec<f64>, Point)>,
    kept: Option<Kept>,
}

/// Where curvature was made last, and what it was.
struct Kept {
    x: Vec<f64>,
    point: Point,
}

impl Kept {
    /// Whether the curvature still serves.
    fn serves(&self, x: &[f64]) -> bool {
        let n = x.len();
        let moved = |row: usize| -> f64 {
            (row..n).map(|j| self.point.triangle[j * n + row] * (x[j] - self.x[j])).sum()
        };
        (0..n).map(|row| moved(row).powi(2)).sum::<f64>() <= NEAR * self.point.cost
    }
}

impl<'p, 'd> Newton<'p, 'd> {
    /// Of a problem at rest before its records, which are cut in the same order.
    pub fn new(problem: &'p mut PredictionError<'d>, cuts: &'p [Cut]) -> Self {
        Self {
            cuts,
            orders: problem.orders.clone(),
            groups: groups(&problem.orders),
            skip: problem.skip,
            levels: problem.levels,
            usual: Dense::new(problem),
            made: None,
            kept: None,
        }
    }

    /// The objective linearised by one pass; None where C remembers too long for that, or where
    /// too few digits are left.
    fn quick(&self, x: &[f64]) -> Option<Point> {
        let p = Polynomials::new(&self.orders, x).ok()?;
        let limit = self.cuts.iter().map(Cut::length).min()?;
        let reach = self.groups.iter().map(|g| g.first + g.count).max()? + p.c.len();
        let more = reach + self.skip;
        let steady = Steady::of(&p.c, limit.checked_sub(more + LANES)?, more)?;
        let (n, kept) = (x.len(), self.kept.as_ref().filter(|kept| kept.serves(x)));
        let mut normal = Normal { squares: vec![0.0; (n + 1) * (n + 1)], bends: vec![0.0; n * n] };
        for cut in self.cuts {
            let mut at = At {
                polynomials: &p,
                groups: &self.groups,
                level: 0.0,
                steady: &steady,
                skip: self.skip,
                curved: kept.is_none(),
            };
            if self.levels {
                at.level = cut.steady_level(&p);
            }
            let found = sums(cut, &at);
            let record = RecordSums { at: &at, sums: &found, n: cut.n };
            record.add(self.levels, &mut normal);
        }
        match kept {
            Some(kept) => normal.point_with(&kept.point.triangle),
            None => normal.point(),
        }
    }
}

impl Objective for Newton<'_, '_> {
    fn n_parameters(&self) -> usize {
        self.orders.n_parameters()
    }

    fn cost(&mut self, x: &[f64]) -> Result<f64, CoreError> {
        self.made = self.quick(x).map(|point| (x.to_vec(), point));
        match &self.made {
            Some((_, point)) => Ok(point.cost),
            None => self.usual.cost(x),
        }
    }

    fn begin(&mut self, x: &[f64]) -> Result<(), CoreError> {
        self.made = self.quick(x).map(|point| (x.to_vec(), point));
        if self.made.is_some() { Ok(()) } else { self.usual.begin(x) }
    }

    fn project(&self, x: &mut [f64]) {
        self.usual.project(x);
    }

    fn linearise(&mut self, at: &[f64], point: &mut Point) -> Result<(), CoreError> {
        match self.made.take() {
            Some((x, made)) if x == at => {
                if !self.kept.as_ref().is_some_and(|kept| kept.serves(at)) {
                    self.kept = Some(Kept { x, point: made.clone() });
                }
                *point = made;
                Ok(())
            }
            _ => self.usual.linearise(at, point),
        }
    }
}

/// Products of [slopes | errors], column-major, the upper half; and what second slopes add.
struct Normal {
    squares: Vec<f64>,
    bends: Vec<f64>,
}

impl Normal {
    fn is_finite(&self) -> bool {
        self.squares.iter().chain(&self.bends).all(|value| value.is_finite())
    }

    /// With the triangle R of another point: only the last column counts.
    fn point_with(&self, triangle: &[f64]) -> Option<Point> {
        let n = triangle.len().isqrt();
        let gradient = &self.squares[n * (n + 1)..];
        let mut projected: Vec<f64> = Vec::with_capacity(n);
        for (j, slope) in gradient[..n].iter().enumerate() {
            let column = &triangle[j * n..=j * n + j];
            let above: f64 = column.iter().zip(&projected).map(|(r, q)| r * q).sum();
            projected.push((slope - above) / column[j]);
        }
        let (cost, triangle) = (gradient[n], triangle.to_vec());
        self.is_finite().then_some(Point { cost, beside: 0.0, triangle, projected })
    }

    fn point(&self) -> Option<Point> {
        let width = self.squares.len().isqrt();
        let n = width - 1;
        if !self.is_finite() {
            return None;
        }
        let plain = factorise(&self.squares, width)?;
        let mut bent = self.squares.clone();
        for (column, bends) in bent.chunks_exact_mut(width).zip(self.bends.chunks_exact(n)) {
            column.iter_mut().zip(bends).for_each(|(sum, bend)| *sum += bend);
        }
        let upward = |r: &Vec<f64>| {
            (0..n).all(|j| r[j * width + j].powi(2) >= BENDS * plain[j * width + j].powi(2))
        };
        let r = factorise(&bent, width).filter(upward).unwrap_or(plain);
        let mut point = Point::new(n);
        point.cost = self.squares[n * width + n];
        for j in 0..n {
            point.triangle[j * n..(j + 1) * n].copy_from_slice(&r[j * width..j * width + n]);
        }
        point.projected.copy_from_slice(&r[n * width..n * width + n]);
        Some(point)
    }
}

impl Cut {
    /// The constant that leaves A y − Σ B u without a mean.
    fn steady_level(&self, p: &Polynomials) -> f64 {
        let driven: f64 =
            p.b.iter().zip(&self.input_means).map(|(b, mean)| b.iter().sum::<f64>() * mean).sum();
        driven - p.a.iter().sum::<f64>() * self.output_mean
    }
}

/// What one record adds.
struct RecordSums<'a> {
    at: &'a At<'a>,
    sums: &'a Sums,
    n: usize,
}

/// The level's products: with itself, with the errors, with each column, and how far it is from where the
/// errors ask for it.
struct Level {
    square: f64,
    columns: Vec<f64>,
    missing: f64,
}

impl RecordSums<'_> {
    fn add(&self, levels: bool, normal: &mut Normal) {
        let columns: Vec<(usize, usize)> = self
            .at
            .groups
            .iter()
            .enumerate()
            .flat_map(|(g, group)| (0..group.count).map(move |k| (g, k)))
            .collect();
        let n = columns.len();
        let width = n + 1;
        let level = levels.then(|| self.level(&columns));
        let mut sums = vec![0.0; n * n];
        for (j, &(h, k)) in columns.iter().enumerate() {
            for (i, &(g, m)) in columns.iter().enumerate().take(j + 1) {
                let sum = match (m, k) {
                    (0, _) => self.sums.products[g][h][k],
                    (_, 0) => self.sums.products[h][g][m],
                    _ => sums[(j - 1) * n + i - 1] + self.edges((g, m), (h, k)),
                };
                sums[j * n + i] = sum;
                let taken = level.as_ref().map_or(0.0, |l| l.columns[i] * l.columns[j] / l.square);
                let sign = self.at.groups[g].sign * self.at.groups[h].sign;
                normal.squares[j * width + i] += sign * (sum - taken);
                let missing = level.as_ref().map_or(0.0, |level| level.missing);
                normal.bends[j * n + i] += self.bend((g, m), (h, k), missing);
            }
        }
        for (j, &column) in columns.iter().enumerate() {
            normal.squares[n * width + j] += self.slope(column, level.as_ref().map(|l| (l, j)));
        }
        let taken = level.map_or(0.0, |l| l.missing * l.missing * l.square);
        normal.squares[n * width + n] += self.sums.squares - taken;
    }

    /// What a product of two columns gains and loses when both are a sample later.
    fn edges(&self, (g, m): (usize, usize), (h, k): (usize, usize)) -> f64 {
        let at = |group: usize, lag: usize| {
            let shift = self.at.groups[group].first + lag;
            let tail = &self.sums.tails[group];
            let head = self.at.skip.checked_sub(shift).map_or(0.0, |t| self.sums.heads[group][t]);
            [head, tail[tail.len() - shift]]
        };
        let ([x, y], [v, w]) = (at(g, m), at(h, k));
        x * v - y * w
    }

    /// Σ e ∂²e by two coefficients: only C meets others, and itself.
    ///
    /// What the level lacks is added as it is once all has come to rest.
    fn bend(&self, (g, m): (usize, usize), (h, k): (usize, usize), missing: f64) -> f64 {
        if self.at.groups[h].source != Source::Errors {
            return 0.0;
        }
        let factor = if g == h { 2.0 } else { -self.at.groups[g].sign };
        // Both delays of C's columns begin at one, of which the sums' own first sample is one.
        let twice = self.at.steady.ends[1];
        factor * (self.sums.bends[g][m + k] + missing * twice * self.sums.totals[g])
    }

    /// Σ e ∂e, the errors taken at the best level.
    fn slope(&self, (g, k): (usize, usize), level: Option<(&Level, usize)>) -> f64 {
        let group = self.at.groups[g];
        let mut sum = self.sums.slopes[g][k];
        if let Some((level, place)) = level {
            let missing = level.missing;
            sum += missing * level.columns[place];
            if group.source == Source::Errors {
                let [of_errors, of_level] = self.twice_filtered(group.first + k);
                sum += missing * (of_errors + missing * of_level);
            }
        }
        group.sign * sum
    }

    fn level(&self, columns: &[(usize, usize)]) -> Level {
        let (skip, steady) = (self.at.skip, self.at.steady);
        let (answer, end) = (&steady.answers[0], steady.ends[0]);
        let errors = &self.sums.heads[self.at.groups.len()];
        let moving = |t: usize| answer[t] - end;
        let square = (self.n - answer.len()) as f64 * end * end
            + answer[skip..].iter().map(|d| d * d).sum::<f64>();
        let with_errors = end * self.sums.errors
            + (skip..answer.len()).map(|t| moving(t) * errors[t]).sum::<f64>();
        let column = |&(g, k): &(usize, usize)| {
            let shift = self.at.groups[g].first + k;
            let (head, tail) = (&self.sums.heads[g], &self.sums.tails[g]);
            let uncounted: f64 = head[..skip.saturating_sub(shift)].iter().sum();
            let beyond: f64 = tail[tail.len() - shift..].iter().sum();
            let early: f64 =
                (skip.max(shift)..answer.len()).map(|t| moving(t) * head[t - shift]).sum();
            end * (self.sums.totals[g] - uncounted - beyond) + early
        };
        Level {
            square,
            columns: columns.iter().map(column).collect(),
            missing: -with_errors / square,
        }
    }

    /// Products of errors, and of the level's way, with the level through 1/C² later by some samples.
    fn twice_filtered(&self, shift: usize) -> [f64; 2] {
        let (skip, steady) = (self.at.skip, self.at.steady);
        let [once, twice] = &steady.answers;
        let [once_end, twice_end] = steady.ends;
        let errors = &self.sums.heads[self.at.groups.len()];
        let later = |t: usize| if t >= shift { twice[t - shift] } else { 0.0 };
        let of_errors: f64 = (skip..once.len()).map(|t| (later(t) - twice_end) * errors[t]).sum();
        let of_level: f64 = (skip..once.len()).map(|t| once[t] * later(t)).sum();
        [
            twice_end * self.sums.errors + of_errors,
            (self.n - once.len()) as f64 * once_end * twice_end + of_level,
        ]
    }
}

#[cfg(test)]
#[path = "tests/armax_newton.rs"]
mod tests;
