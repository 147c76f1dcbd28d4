//! Triangular factors of one sparse complex matrix at many frequencies, its pivots and fill planned
//! once. (Python side: none)
//!
//! Reference: Duff, Erisman & Reid, *Direct Methods for Sparse Matrices*, 2nd ed., §7.2 (Markowitz
//! with threshold pivoting) and ch. 9 (one analysis, many factorisations).

use num_complex::Complex64;

use crate::numerics::complex_lanes::Lanes;
use crate::numerics::complex_lu::ComplexLu;
use crate::numerics::widest::widest;

/// Smallest share of the largest entry of its column that a pivot may have when it is planned.
const THRESHOLD: f64 = 0.1;
/// Largest multiplier, of rows scaled alike, at which planned pivots are believed.
const LARGEST_MULTIPLIER: f64 = 1e4;

/// Pivots and fill of a sparsity pattern.
#[derive(Debug, Clone)]
pub struct Plan {
    n: usize,
    /// Entries of the matrix: row, column; the first of all slots.
    entries: Vec<(usize, usize)>,
    n_slots: usize,
    steps: Vec<Step>,
}

#[derive(Debug, Clone)]
struct Step {
    row: usize,
    column: usize,
    pivot: usize,
    /// Rows below with their slot, and the ratio of the scales of both rows.
    lower: Vec<(usize, usize, f64)>,
    /// Columns to the right with their slot.
    upper: Vec<(usize, usize)>,
    /// Slots: target, multiplier, entry of the pivot's row.
    updates: Vec<(usize, usize, usize)>,
}

/// Factors at the frequencies of one set of lanes.
#[derive(Debug, Clone, Default)]
pub struct Factors {
    slots: Vec<Lanes>,
    inverses: Vec<Lanes>,
}

/// How the frequencies of one set of lanes were factored.
#[derive(Debug, Clone)]
pub enum Block {
    /// With the planned pivots.
    Planned(Factors),
    /// One by one with pivots of their own, where the plan's do not serve.
    Pivoted(Vec<ComplexLu>),
}

impl Block {
    /// Solve for a right side, transposed or not; it is overwritten. `plan` is the one that factored.
    pub fn solve(
        &self,
        plan: Option<&Plan>,
        right: &mut [Lanes],
        solution: &mut [Lanes],
        transposed: bool,
    ) {
        match (self, plan) {
            (Self::Planned(factors), Some(plan)) if transposed => {
                plan.solve_transposed(factors, right, solution);
            }
            (Self::Planned(factors), Some(plan)) => plan.solve(factors, right, solution),
            (Self::Pivoted(each), _) => {
                for (lane, factors) in each.iter().enumerate() {
                    let mut one: Vec<Complex64> = right.iter().map(|v| v.get(lane)).collect();
                    if transposed {
                        factors.solve_transposed(&mut one);
                    } else {
                        factors.solve(&mut one);
                    }
                    solution.iter_mut().zip(one).for_each(|(out, v)| out.set(lane, v));
                }
            }
            (Self::Planned(_), None) => {}
        }
    }
}

fn size(value: Complex64) -> f64 {
    value.re.abs() + value.im.abs()
}

impl Plan {
    /// Plan for the entries of an n × n matrix with typical values; None where it is singular.
    pub fn new(n: usize, entries: &[(usize, usize)], typical: &[Complex64]) -> Option<Self> {
        let mut slot = vec![usize::MAX; n * n];
        let mut value = vec![Complex64::default(); n * n];
        for (place, (&(row, column), &number)) in entries.iter().zip(typical).enumerate() {
            slot[row * n + column] = place;
            value[row * n + column] = number;
        }
        // Rows have units of their own: entries are compared as shares of their row's largest.
        let scale: Vec<f64> = (0..n)
            .map(|row| value[row * n..(row + 1) * n].iter().map(|v| size(*v)).fold(0.0, f64::max))
            .collect();
        if scale.iter().any(|&most| !(most > 0.0 && most.is_finite())) {
            return None;
        }
        let (mut rows, mut columns): (Vec<usize>, Vec<usize>) =
            ((0..n).collect(), (0..n).collect());
        let (mut n_slots, mut steps) = (entries.len(), Vec::with_capacity(n));
        while !rows.is_empty() {
            let (row, column) = choose(n, &rows, &columns, &slot, &value, &scale)?;
            rows.retain(|&each| each != row);
            columns.retain(|&each| each != column);
            let at = |i: usize, j: usize| i * n + j;
            let under: Vec<usize> =
                rows.iter().copied().filter(|&i| slot[at(i, column)] != usize::MAX).collect();
            let beside: Vec<usize> =
                columns.iter().copied().filter(|&j| slot[at(row, j)] != usize::MAX).collect();
            let mut updates = Vec::with_capacity(under.len() * beside.len());
            for &i in &under {
                let factor = value[at(i, column)] / value[at(row, column)];
                for &j in &beside {
                    // Fill: a place that held nothing gets a slot after those of the entries.
                    if slot[at(i, j)] == usize::MAX {
                        slot[at(i, j)] = n_slots;
                        n_slots += 1;
                    }
                    let change = factor * value[at(row, j)];
                    value[at(i, j)] -= change;
                    updates.push((slot[at(i, j)], slot[at(i, column)], slot[at(row, j)]));
                }
            }
            let lower = under.iter().map(|&i| (i, slot[at(i, column)], scale[row] / scale[i]));
            let upper = beside.iter().map(|&j| (j, slot[at(row, j)]));
            steps.push(Step {
                row,
                column,
                pivot: slot[at(row, column)],
                lower: lower.collect(),
                upper: upper.collect(),
                updates,
            });
        }
        Some(Self { n, entries: entries.to_vec(), n_slots, steps })
    }

    /// Entries of the matrix, in the order in which `factor` takes their values.
    pub fn entries(&self) -> &[(usize, usize)] {
        &self.entries
    }

    /// Factor at eight frequencies; false where the planned pivots do not serve all of them.
    pub fn factor(&self, entry: impl Fn(usize, usize) -> Lanes, factors: &mut Factors) -> bool {
        widest(
            #[inline(always)]
            || self.factored(entry, factors),
        )
    }

    #[inline(always)]
    fn factored(&self, entry: impl Fn(usize, usize) -> Lanes, factors: &mut Factors) -> bool {
        let slots = &mut factors.slots;
        slots.clear();
        slots.extend(self.entries.iter().map(|&(row, column)| entry(row, column)));
        slots.resize(self.n_slots, Lanes::ZERO);
        factors.inverses.clear();
        for step in &self.steps {
            let inverse = slots[step.pivot].inverse();
            factors.inverses.push(inverse);
            if !inverse.size().is_finite() {
                return false;
            }
            for &(_, place, ratio) in &step.lower {
                let multiplier = slots[place].times(&inverse);
                // As planned no scaled multiplier is above 1 / THRESHOLD; a large one says that
                // this frequency is unlike the planned one, and its digits would be lost.
                if multiplier.size() * ratio > LARGEST_MULTIPLIER {
                    return false;
                }
                slots[place] = multiplier;
            }
            for &(target, multiplier, upper) in &step.updates {
                let (a, b) = (slots[multiplier], slots[upper]);
                slots[target].subtract_product(&a, &b);
            }
        }
        true
    }

    /// x = A⁻¹ b; b is overwritten.
    pub fn solve(&self, factors: &Factors, b: &mut [Lanes], x: &mut [Lanes]) {
        widest(
            #[inline(always)]
            || self.solved(factors, b, x),
        );
    }

    #[inline(always)]
    fn solved(&self, factors: &Factors, b: &mut [Lanes], x: &mut [Lanes]) {
        for step in &self.steps {
            let value = b[step.row];
            for &(row, place, _) in &step.lower {
                b[row].subtract_product(&factors.slots[place], &value);
            }
        }
        for (step, inverse) in self.steps.iter().zip(&factors.inverses).rev() {
            let mut value = b[step.row];
            for &(column, place) in &step.upper {
                value.subtract_product(&factors.slots[place], &x[column]);
            }
            x[step.column] = value.times(inverse);
        }
    }

    /// y = A⁻ᵀ c (transposed, not conjugated); c is overwritten.
    pub fn solve_transposed(&self, factors: &Factors, c: &mut [Lanes], y: &mut [Lanes]) {
        widest(
            #[inline(always)]
            || self.solved_transposed(factors, c, y),
        );
    }

    #[inline(always)]
    fn solved_transposed(&self, factors: &Factors, c: &mut [Lanes], y: &mut [Lanes]) {
        for (step, inverse) in self.steps.iter().zip(&factors.inverses) {
            let value = c[step.column].times(inverse);
            for &(column, place) in &step.upper {
                c[column].subtract_product(&factors.slots[place], &value);
            }
            y[step.row] = value;
        }
        for step in self.steps.iter().rev() {
            let mut value = y[step.row];
            for &(row, place, _) in &step.lower {
                value.subtract_product(&factors.slots[place], &y[row]);
            }
            y[step.row] = value;
        }
    }

    /// Rows and columns.
    pub fn n(&self) -> usize {
        self.n
    }
}

/// The pivot with the least fill among those large enough in their column.
fn choose(
    n: usize,
    rows: &[usize],
    columns: &[usize],
    slot: &[usize],
    value: &[Complex64],
    scale: &[f64],
) -> Option<(usize, usize)> {
    let relative = |i: usize, j: usize| size(value[i * n + j]) / scale[i];
    let used = |i: usize, j: usize| slot[i * n + j] != usize::MAX;
    let mut best: Option<((usize, usize), (usize, f64))> = None;
    for &j in columns {
        let largest = rows.iter().map(|&i| relative(i, j)).fold(0.0, f64::max);
        let height = rows.iter().filter(|&&i| used(i, j)).count();
        for &i in rows.iter().filter(|&&i| used(i, j)) {
            let share = relative(i, j);
            if !(share > 0.0 && share.is_finite() && share >= THRESHOLD * largest) {
                continue;
            }
            let width = columns.iter().filter(|&&j| used(i, j)).count();
            // Markowitz: at most so many places are filled.
            let fill = (height - 1) * (width - 1);
            let better = best
                .is_none_or(|(_, (least, most))| fill < least || (fill == least && share > most));
            if better {
                best = Some(((i, j), (fill, share)));
            }
        }
    }
    best.map(|(place, _)| place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::complex_lanes::LANES;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_dense_factors(
            n in 1_usize..8,
            numbers in prop::collection::vec(-1.0_f64..1.0, 2 * 49 + 14),
            holes in prop::collection::vec(0_u8..3, 49),
        ) {
            let mut entries = Vec::new();
            let mut dense = vec![Complex64::default(); n * n];
            let mut typical = Vec::new();
            for row in 0..n {
                for column in 0..n {
                    // The strong entries lie off the diagonal, so that pivots must be found.
                    let strong = column == (row + 1) % n;
                    if strong || holes[row * n + column] == 0 {
                        let k = row * n + column;
                        let shift = if strong { 4.0 } else { 0.0 };
                        let number = Complex64::new(numbers[2 * k] + shift, numbers[2 * k + 1]);
                        entries.push((row, column));
                        typical.push(number);
                        dense[row * n + column] = number;
                    }
                }
            }
            let plan = Plan::new(n, &entries, &typical).unwrap();
            let grow = |lane: usize| 1.0 + 0.1 * lane as f64;
            let mut factors = Factors::default();
            let entry = |row: usize, column: usize| {
                let mut lanes = Lanes::ZERO;
                (0..LANES).for_each(|k| lanes.set(k, dense[row * n + column] * grow(k)));
                lanes
            };
            prop_assert!(plan.factor(entry, &mut factors));
            let right: Vec<_> =
                (0..n).map(|k| Complex64::new(numbers[98 + k], numbers[98 + 7 + k])).collect();
            let wide = || -> Vec<Lanes> {
                right.iter().map(|&v| {
                    let mut lanes = Lanes::ZERO;
                    (0..LANES).for_each(|k| lanes.set(k, v));
                    lanes
                }).collect()
            };
            let (mut x, mut y) = (vec![Lanes::ZERO; n], vec![Lanes::ZERO; n]);
            plan.solve(&factors, &mut wide(), &mut x);
            plan.solve_transposed(&factors, &mut wide(), &mut y);
            let lu = ComplexLu::new(dense, n).unwrap();
            let (mut plain, mut across) = (right.clone(), right);
            lu.solve(&mut plain);
            lu.solve_transposed(&mut across);
            for i in 0..n {
                for lane in [0, LANES - 1] {
                    prop_assert!((x[i].get(lane) * grow(lane) - plain[i]).norm() < 1e-11);
                    prop_assert!((y[i].get(lane) * grow(lane) - across[i]).norm() < 1e-11);
                }
            }
        }
    }

    #[test]
    fn what_has_no_plan_is_refused() {
        let one = Complex64::new(1.0, 0.0);
        assert!(Plan::new(2, &[(0, 0), (1, 0)], &[one, one]).is_none());
        assert!(Plan::new(1, &[(0, 0)], &[Complex64::default()]).is_none());
    }

    #[test]
    fn pivots_that_vanish_elsewhere_are_noticed() {
        let one = Complex64::new(1.0, 0.0);
        let entries = [(0, 0), (0, 1), (1, 0), (1, 1)];
        let plan = Plan::new(2, &entries, &[one, one * 0.5, one * 0.5, one]).unwrap();
        let mut factors = Factors::default();
        let tiny = |row: usize, column: usize| Lanes::real(if row == column { 1e-9 } else { 1.0 });
        assert!(!plan.factor(tiny, &mut factors));
        assert!(!plan.factor(|_, _| Lanes::ZERO, &mut factors));
    }
}
