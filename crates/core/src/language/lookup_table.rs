//! Tables of one or two axes as functions: linear, or cubic with given kind of slopes. (Python side:
//! models/language/tables.py)
//!
//! Every kind is a sum of node values and node slopes times basis functions of the place in a cell, so
//! that dual numbers give the derivatives of all orders. Monotone slopes: Fritsch and Butland, A method
//! for constructing local monotone piecewise cubic interpolants, SIAM J. Sci. Stat. Comput. 5 (1984).

use std::sync::Arc;

use crate::error::CoreError;
use crate::numerics::dual::{Dual, Scalar};

/// Most numbers in one table.
pub const MAXIMUM_POINTS: usize = 10_000;

/// What happens between the breakpoints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight lines.
    Linear,
    /// Cubics that rise and fall only where the points do; one derivative is continuous.
    Pchip,
    /// The cubic spline without a knot at the second and last but one point; two continuous derivatives.
    Cubic,
}

/// What happens beyond the first and last breakpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outside {
    /// The value at the edge.
    Hold,
    /// The straight line at the edge.
    Linear,
    /// Not a number, which every evaluation refuses.
    Refuse,
}

/// What of a table is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Part {
    Value,
    /// Derivative along the first axis.
    First,
    /// Derivative along the second axis.
    Second,
}

#[derive(Debug)]
struct Content {
    axes: Vec<Vec<f64>>,
    /// Values, then slopes along the first axis, along the second, and mixed; row-major.
    nodes: [Vec<f64>; 4],
    interpolation: Interpolation,
    outside: Outside,
}

/// A table; copies share its content.
#[derive(Debug, Clone)]
pub struct LookupTable {
    content: Arc<Content>,
}

impl LookupTable {
    /// Check the points and find the slopes at them.
    ///
    /// # Errors
    /// `Shape` for the number of axes, breakpoints or values; `Range` for breakpoints that do not rise;
    /// `NotFinite`.
    pub fn new(
        axes: Vec<Vec<f64>>,
        values: Vec<f64>,
        interpolation: Interpolation,
        outside: Outside,
    ) -> Result<Self, CoreError> {
        check(&axes, &values)?;
        let n = axes.get(1).map_or(1, Vec::len);
        let zero = vec![0.0; values.len()];
        let along = |table: &[f64], axis: usize| -> Vec<f64> {
            match (interpolation, axes.get(axis)) {
                (Interpolation::Linear, _) | (_, None) => zero.clone(),
                (kind, Some(points)) => slopes_of_lines(points, table, n, axis, kind),
            }
        };
        let first = along(&values, 0);
        let (second, mixed) = (along(&values, 1), along(&first, 1));
        let nodes = [values, first, second, mixed];
        Ok(Self { content: Arc::new(Content { axes, nodes, interpolation, outside }) })
    }

    /// Number of axes, one or two.
    pub fn n_axes(&self) -> usize {
        self.content.axes.len()
    }

    /// Values at the nodes, then slopes along the first axis, along the second, and mixed; row-major.
    pub fn nodes(&self) -> &[Vec<f64>; 4] {
        &self.content.nodes
    }

    /// Value or slope at a place.
    pub(crate) fn part<T: Scalar>(&self, part: Part, x: T, y: T) -> T {
        let along = |of: Part, place: T| match of == part {
            true => Dual::<T, 1>::variable(place, 0),
            false => Dual { value: place, gradient: [T::constant(0.0)] },
        };
        match part {
            Part::Value => self.at(x, y),
            _ => self.at(along(Part::First, x), along(Part::Second, y)).gradient[0],
        }
    }

    /// Value at a place; a table of one axis does not look at `y`.
    pub fn at<T: Scalar>(&self, x: T, y: T) -> T {
        let content = &*self.content;
        let (row, across) = content.basis(0, x);
        let [values, first, second, mixed] = &content.nodes;
        let mut sum = T::constant(0.0);
        let Some(points) = content.axes.get(1) else {
            for (corner, [value, slope]) in across.into_iter().enumerate() {
                let place = row + corner;
                sum = sum + value * T::constant(values[place]) + slope * T::constant(first[place]);
            }
            return sum;
        };
        let (column, along) = content.basis(1, y);
        for (i, [value_x, slope_x]) in across.into_iter().enumerate() {
            for (k, [value_y, slope_y]) in along.into_iter().enumerate() {
                let place = (row + i) * points.len() + column + k;
                sum = sum
                    + value_x
                        * (value_y * T::constant(values[place])
                            + slope_y * T::constant(second[place]))
                    + slope_x
                        * (value_y * T::constant(first[place])
                            + slope_y * T::constant(mixed[place]));
            }
        }
        sum
    }
}

impl Content {
    /// Cell along an axis, and the factors of value and slope at its two ends.
    fn basis<T: Scalar>(&self, axis: usize, place: T) -> (usize, [[T; 2]; 2]) {
        let points = &self.axes[axis];
        let number = place.real();
        let cell = points.partition_point(|&point| point <= number).clamp(1, points.len() - 1) - 1;
        let (start, width) = (points[cell], points[cell + 1] - points[cell]);
        let one = T::constant(1.0);
        let mut t = (place - T::constant(start)) * T::constant(1.0 / width);
        let beyond = number < start || number > points[cell + 1];
        if beyond && self.outside == Outside::Refuse {
            t = T::constant(f64::NAN);
        }
        if beyond && self.outside == Outside::Hold {
            t = T::constant(if number < start { 0.0 } else { 1.0 });
        }
        let (zero, width) = (T::constant(0.0), T::constant(width));
        if self.interpolation == Interpolation::Linear {
            return (cell, [[one - t, zero], [t, zero]]);
        }
        if beyond && self.outside == Outside::Linear {
            let line = if number < start {
                [[one, t * width], [zero, zero]]
            } else {
                [[zero, zero], [one, (t - one) * width]]
            };
            return (cell, line);
        }
        let (rest, three, two) = (one - t, T::constant(3.0), T::constant(2.0));
        let left = [rest * rest * (one + two * t), rest * rest * t * width];
        let right = [t * t * (three - two * t), -(t * t * rest * width)];
        (cell, [left, right])
    }
}

fn check(axes: &[Vec<f64>], values: &[f64]) -> Result<(), CoreError> {
    if !(1..=2).contains(&axes.len()) {
        return Err(CoreError::Shape { what: "axes of a table", found: axes.len(), needed: 2 });
    }
    axes.iter().try_for_each(|points| check_axis(points))?;
    let needed = axes.iter().try_fold(1_usize, |product, axis| product.checked_mul(axis.len()));
    let needed = needed.filter(|&count| count <= MAXIMUM_POINTS).unwrap_or(MAXIMUM_POINTS);
    check_values(values, needed)
}

fn check_axis(points: &[f64]) -> Result<(), CoreError> {
    if points.len() < 2 {
        let found = points.len();
        return Err(CoreError::Shape { what: "breakpoints of a table", found, needed: 2 });
    }
    if let Some(index) = points.iter().position(|point| !point.is_finite()) {
        return Err(CoreError::NotFinite { what: "breakpoints of a table", index });
    }
    let steps = points.windows(2).map(|pair| pair[1] - pair[0]);
    if let Some(found) = steps.into_iter().find(|&step| !(step > 0.0 && (1.0 / step).is_finite())) {
        let needed = "breakpoints that rise";
        return Err(CoreError::Range { what: "step of a table's axis", found, needed });
    }
    Ok(())
}

fn check_values(values: &[f64], needed: usize) -> Result<(), CoreError> {
    if values.len() != needed {
        return Err(CoreError::Shape { what: "values of a table", found: values.len(), needed });
    }
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what: "values of a table", index }),
        None => Ok(()),
    }
}

/// Slopes along one axis of a row-major table with `n` columns.
fn slopes_of_lines(
    points: &[f64],
    table: &[f64],
    n: usize,
    axis: usize,
    kind: Interpolation,
) -> Vec<f64> {
    let mut result = vec![0.0; table.len()];
    let (count, stride) = if axis == 0 { (n, n) } else { (table.len() / n, 1) };
    for line in 0..count {
        let start = if axis == 0 { line } else { line * n };
        let places = (0..points.len()).map(|k| start + k * stride);
        let values: Vec<f64> = places.clone().map(|place| table[place]).collect();
        let slopes = if kind == Interpolation::Pchip {
            monotone(points, &values)
        } else {
            smooth(points, &values)
        };
        for (place, slope) in places.zip(slopes) {
            result[place] = slope;
        }
    }
    result
}

/// The cubic spline through points, at some places; its end pieces go on beyond them.
///
/// # Errors
/// As `LookupTable::new`, but for any number of points.
pub fn cubic_spline(points: &[f64], values: &[f64], at: &[f64]) -> Result<Vec<f64>, CoreError> {
    check_axis(points)?;
    check_values(values, points.len())?;
    let slopes = smooth(points, values);
    let piece = |&place: &f64| {
        let cell = points.partition_point(|&point| point <= place).clamp(1, points.len() - 1) - 1;
        let width = points[cell + 1] - points[cell];
        let (along, chord) = (place - points[cell], (values[cell + 1] - values[cell]) / width);
        let bend = (slopes[cell] + slopes[cell + 1] - 2.0 * chord) / width;
        let (cubic, square) = (bend / width, (chord - slopes[cell]) / width - bend);
        values[cell] + along * (slopes[cell] + along * (square + along * cubic))
    };
    Ok(at.iter().map(piece).collect())
}

fn steps(points: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let widths: Vec<f64> = points.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let chords = values.windows(2).zip(&widths).map(|(pair, width)| (pair[1] - pair[0]) / width);
    let chords = chords.collect();
    (widths, chords)
}

fn monotone(points: &[f64], values: &[f64]) -> Vec<f64> {
    let (h, m) = steps(points, values);
    let n = points.len();
    if n == 2 {
        return vec![m[0]; 2];
    }
    let end = |h0: f64, h1: f64, m0: f64, m1: f64| {
        let slope = ((2.0 * h0 + h1) * m0 - h0 * m1) / (h0 + h1);
        if slope * m0 <= 0.0 {
            0.0
        } else if m0 * m1 <= 0.0 && slope.abs() > 3.0 * m0.abs() {
            3.0 * m0
        } else {
            slope
        }
    };
    let mut slopes = vec![end(h[0], h[1], m[0], m[1])];
    for k in 1..n - 1 {
        let (w1, w2) = (2.0 * h[k] + h[k - 1], h[k] + 2.0 * h[k - 1]);
        let flat = m[k - 1] * m[k] <= 0.0;
        slopes.push(if flat { 0.0 } else { (w1 + w2) / (w1 / m[k - 1] + w2 / m[k]) });
    }
    slopes.push(end(h[n - 2], h[n - 3], m[n - 2], m[n - 3]));
    slopes
}

/// Slopes of the spline whose third derivative does not jump at the second and last but one point.
fn smooth(points: &[f64], values: &[f64]) -> Vec<f64> {
    let (h, m) = steps(points, values);
    let n = points.len();
    if n == 2 {
        return vec![m[0]; 2];
    }
    if n == 3 {
        let bend = (m[1] - m[0]) / (h[0] + h[1]);
        return vec![m[0] - bend * h[0], m[0] + bend * h[0], m[1] + bend * h[1]];
    }
    // Rows of a tridiagonal system: below, diagonal, above, right side.
    let end = |h0: f64, h1: f64, m0: f64, m1: f64| {
        let d = h0 + h1;
        (h1, d, ((h0 + 2.0 * d) * h1 * m0 + h0 * h0 * m1) / d)
    };
    let (diagonal, above, right) = end(h[0], h[1], m[0], m[1]);
    let mut rows = vec![(0.0, diagonal, above, right)];
    for k in 1..n - 1 {
        let right = 3.0 * (h[k] * m[k - 1] + h[k - 1] * m[k]);
        rows.push((h[k], 2.0 * (h[k - 1] + h[k]), h[k - 1], right));
    }
    let (diagonal, below, right) = end(h[n - 2], h[n - 3], m[n - 2], m[n - 3]);
    rows.push((below, diagonal, 0.0, right));
    for k in 1..n {
        let (_, diagonal, above, right) = rows[k - 1];
        let factor = rows[k].0 / diagonal;
        rows[k].1 -= factor * above;
        rows[k].3 -= factor * right;
    }
    let mut slopes = vec![0.0; n];
    let mut next = 0.0;
    for (slope, &(_, diagonal, above, right)) in slopes.iter_mut().zip(&rows).rev() {
        next = (right - above * next) / diagonal;
        *slope = next;
    }
    slopes
}

#[cfg(test)]
#[path = "tests/lookup_table.rs"]
mod tests;
