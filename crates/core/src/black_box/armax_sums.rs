//! One pass over a record for all that a Newton step of an ARMAX predictor needs: sums of products of
//! its errors, of their slopes and of their second slopes, which are shifts of a few filtered signals.
//! (Python side: validation/order_scan/scan_orders.py)
//!
//! With x/C of the output, of each input and of the errors as base signals, e = A (y/C) − Σ B (u/C) + l/C.
//!
//! Reference: Ljung, *System Identification*, 2nd ed., eqs. 10.50 to 10.53; second slopes by the same
//! rule once more.

use crate::black_box::lane_rows::{LANES, Pieces, Row, add_products, add_shifted, divide_rows};
use crate::black_box::polynomial_orders::Orders;
use crate::black_box::polynomial_predictor::{Polynomials, Samples};
use crate::black_box::steady_answers::Steady;
use crate::numerics::widest::eight_wide;

/// Rows that are worked on together: with their past they stay in the nearest cache.
const BLOCK: usize = 32;

/// A record cut into pieces.
pub struct Cut {
    output: Pieces,
    inputs: Vec<Pieces>,
    /// Mean of the output.
    pub output_mean: f64,
    /// Means of the inputs.
    pub input_means: Vec<f64>,
    /// Samples.
    pub n: usize,
}

impl Cut {
    /// Cut the channels of a record.
    pub fn of(record: &Samples<'_>) -> Self {
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
        Self {
            output: Pieces::of(record.output),
            inputs: record.inputs.iter().map(|input| Pieces::of(input)).collect(),
            output_mean: mean(record.output),
            input_means: record.inputs.iter().map(|input| mean(input)).collect(),
            n: record.output.len(),
        }
    }

    /// Rows of each piece.
    pub fn length(&self) -> usize {
        self.output.rows.len()
    }
}

/// Columns of one base signal: later by `first` samples and on.
#[derive(Debug, Clone, Copy)]
pub struct Group {
    /// Which channel, over C, the signal is.
    pub source: Source,
    /// Delay of the first column.
    pub first: usize,
    /// Columns.
    pub count: usize,
    /// Sign of the slopes.
    pub sign: f64,
}

/// What is divided by C.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The output.
    Output,
    /// An input.
    Input(usize),
    /// The prediction errors.
    Errors,
}

/// Groups of columns in the order of the coefficients; the errors' is always the last.
pub fn groups(orders: &Orders) -> Vec<Group> {
    let output = Group { source: Source::Output, first: 1, count: orders.a, sign: 1.0 };
    let errors = Group { source: Source::Errors, first: 1, count: orders.c, sign: -1.0 };
    let inputs = orders
        .b
        .iter()
        .zip(&orders.delays)
        .enumerate()
        .map(|(i, (&count, &first))| Group { source: Source::Input(i), first, count, sign: -1.0 });
    [output].into_iter().chain(inputs).chain([errors]).collect()
}

/// What one pass is made at.
pub struct At<'a> {
    /// Polynomials.
    pub polynomials: &'a Polynomials,
    /// Columns.
    pub groups: &'a [Group],
    /// A constant before 1/C.
    pub level: f64,
    /// Its way through.
    pub steady: &'a Steady,
    /// First errors that do not count.
    pub skip: usize,
    /// Whether products for the curvature are asked for: they take half of the time.
    pub curved: bool,
}

impl At<'_> {
    /// Rows of the past that shifts reach.
    pub fn reach(&self) -> usize {
        let c = self.polynomials.c.len();
        self.groups.iter().map(|g| g.first + g.count).max().unwrap_or(0) + c
    }
}

/// Sums over the errors that count, without the signs of the slopes.
pub struct Sums {
    /// Squares of the errors.
    pub squares: f64,
    /// The errors.
    pub errors: f64,
    /// Errors times each column, by group.
    pub slopes: Vec<Vec<f64>>,
    /// Errors times x/C² of each group, from one sample after the first column's delay on; zero where no
    /// curvature was asked for.
    pub bends: Vec<Vec<f64>>,
    /// First column of a group times each column of another; of one before it without its first. Zero
    /// where no curvature was asked for.
    pub products: Vec<Vec<Vec<f64>>>,
    /// Each base signal, all samples.
    pub totals: Vec<f64>,
    /// First samples of the base signals, and of the errors behind them.
    pub heads: Vec<Vec<f64>>,
    /// Last samples of the base signals, as many as shifts reach.
    pub tails: Vec<Vec<f64>>,
}

/// Rows of every signal with their past, and running sums.
struct Pass<'a> {
    at: &'a At<'a>,
    cut: &'a Cut,
    reach: usize,
    /// x/C of each group.
    base: Vec<Vec<Row>>,
    /// x/C² of each group.
    twice: Vec<Vec<Row>>,
    errors: Vec<Row>,
    left: Vec<Row>,
    squares: [Row; 1],
    sum: Row,
    slopes: Vec<Vec<Row>>,
    bends: Vec<Vec<Row>>,
    products: Vec<Vec<Vec<Row>>>,
    totals: Vec<Row>,
    heads: Vec<Vec<f64>>,
}

/// All sums of a record, whose pieces are longer than C remembers.
pub fn sums(cut: &Cut, at: &At<'_>) -> Sums {
    let mut pass = Pass::new(cut, at);
    eight_wide(
        #[inline(always)]
        || pass.run(),
    );
    pass.ended()
}

impl<'a> Pass<'a> {
    fn new(cut: &'a Cut, at: &'a At<'a>) -> Self {
        let (groups, reach) = (at.groups, at.reach());
        let rows = || vec![[0.0; LANES]; reach + BLOCK];
        let zeros = |count: usize| vec![[0.0; LANES]; count];
        let c = at.polynomials.c.len() - 1;
        let per_group = |count: &dyn Fn(&Group) -> usize| -> Vec<Vec<Row>> {
            groups.iter().map(|group| zeros(count(group))).collect()
        };
        Self {
            at,
            cut,
            reach,
            base: groups.iter().map(|_| rows()).collect(),
            twice: groups.iter().map(|_| rows()).collect(),
            errors: rows(),
            left: Vec::with_capacity(BLOCK),
            squares: [[0.0; LANES]],
            sum: [0.0; LANES],
            slopes: per_group(&|group| group.count),
            bends: per_group(&|group| if group.count > 0 { group.count + c - 1 } else { 0 }),
            products: groups.iter().map(|_| per_group(&|group| group.count)).collect(),
            totals: zeros(groups.len()),
            heads: vec![Vec::new(); groups.len() + 1],
        }
    }

    fn pieces(&self, source: Source) -> Option<&'a Pieces> {
        match source {
            Source::Output => Some(&self.cut.output),
            Source::Input(i) => Some(&self.cut.inputs[i]),
            Source::Errors => None,
        }
    }

    /// The pieces from the ends of those before them on: as long as C remembers, and what shifts reach.
    #[inline(always)]
    fn run(&mut self) {
        let ahead = self.at.steady.lasting + self.reach;
        let channels: Vec<&Pieces> =
            self.at.groups.iter().filter_map(|group| self.pieces(group.source)).collect();
        let mut before = vec![[0.0; LANES]; ahead * channels.len()];
        for (piece, target) in channels.iter().zip(before.chunks_mut(ahead)) {
            piece.before(ahead, target);
        }
        for from in (0..ahead).step_by(BLOCK) {
            let count = BLOCK.min(ahead - from);
            for (place, rows) in before.chunks(ahead).enumerate() {
                self.load(place, &rows[from..from + count]);
            }
            self.signals(None, count);
            self.forget(count);
        }
        for from in (0..self.cut.length()).step_by(BLOCK) {
            let count = BLOCK.min(self.cut.length() - from);
            for (place, pieces) in channels.iter().enumerate() {
                self.load(place, &pieces.rows[from..from + count]);
            }
            self.signals(Some(from), count);
            self.keep_heads(from, count);
            self.add(from, count);
            self.forget(count);
        }
    }

    #[inline(always)]
    fn load(&mut self, place: usize, rows: &[Row]) {
        self.base[place][self.reach..self.reach + rows.len()].copy_from_slice(rows);
    }

    /// All signals over the next rows; before the pieces begin there is no row number.
    #[inline(always)]
    fn signals(&mut self, from: Option<usize>, count: usize) {
        let (reach, end) = (self.reach, self.reach + count);
        let p = self.at.polynomials;
        let c = &p.c[1..];
        let last = self.base.len() - 1;
        divide_all(c, &mut self.base[..last], reach, end);
        let errors = &mut self.errors[reach..end];
        for (offset, row) in errors.iter_mut().enumerate() {
            *row = steady_row(self.at, self.cut.output.pad, from.map(|from| from + offset));
        }
        add_shifted(&p.a, &self.base[0], reach, 0, errors);
        for (group, rows) in self.at.groups.iter().zip(&self.base) {
            if let Source::Input(i) = group.source {
                subtract_shifted(&p.b[i], rows, reach, group.first, errors);
            }
        }
        self.base[last][reach..end].copy_from_slice(errors);
        divide_all(c, &mut self.base[last..], reach, end);
        if !self.at.curved {
            return;
        }
        for (twice, base) in self.twice.iter_mut().zip(&self.base) {
            twice[reach..end].copy_from_slice(&base[reach..end]);
        }
        divide_all(c, &mut self.twice, reach, end);
    }

    /// First samples of the first piece.
    #[inline(always)]
    fn keep_heads(&mut self, from: usize, count: usize) {
        let (pad, wanted) =
            (self.cut.output.pad, self.at.steady.answers[0].len().max(self.at.skip));
        if from >= pad + wanted {
            return;
        }
        for (head, rows) in self.heads.iter_mut().zip(self.base.iter().chain([&self.errors])) {
            for (offset, row) in rows[self.reach..self.reach + count].iter().enumerate() {
                if from + offset >= pad && head.len() < wanted {
                    head.push(row[0]);
                }
            }
        }
    }

    #[inline(always)]
    fn add(&mut self, from: usize, count: usize) {
        let (reach, groups) = (self.reach, self.at.groups);
        // Rows of the first piece that do not count.
        let uncounted = (self.cut.output.pad + self.at.skip).saturating_sub(from).min(count);
        counted(&self.errors[reach..], count, uncounted, &mut self.left);
        for row in &self.left {
            self.sum.iter_mut().zip(row).for_each(|(sum, e)| *sum += e);
        }
        add_products(&self.left, &self.errors, reach, 0, &mut self.squares);
        for (g, group) in groups.iter().enumerate() {
            add_products(&self.left, &self.base[g], reach, group.first, &mut self.slopes[g]);
            for row in &self.base[g][reach..reach + count] {
                self.totals[g].iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
            }
        }
        if self.at.curved {
            self.add_curvature(count, uncounted);
        }
    }

    #[inline(always)]
    fn add_curvature(&mut self, count: usize, uncounted: usize) {
        let (reach, groups) = (self.reach, self.at.groups);
        for (g, group) in groups.iter().enumerate() {
            add_products(&self.left, &self.twice[g], reach, group.first + 1, &mut self.bends[g]);
        }
        for (g, group) in groups.iter().enumerate().filter(|(_, group)| group.count > 0) {
            counted(&self.base[g][reach - group.first..], count, uncounted, &mut self.left);
            for (h, other) in groups.iter().enumerate().filter(|(_, other)| other.count > 0) {
                // The first columns' product with that of a group before is known from there.
                let known = usize::from(h < g);
                let sums = &mut self.products[g][h][known..];
                add_products(&self.left, &self.base[h], reach, other.first + known, sums);
            }
        }
    }

    /// Rows that shifts reach become the past of the next.
    #[inline(always)]
    fn forget(&mut self, count: usize) {
        let all = self.base.iter_mut().chain(&mut self.twice).chain([&mut self.errors]);
        for rows in all {
            rows.copy_within(count..count + self.reach, 0);
        }
    }

    fn ended(self) -> Sums {
        let one = |row: &Row| row.iter().sum::<f64>();
        let all = |rows: &Vec<Row>| rows.iter().map(one).collect::<Vec<f64>>();
        let tail = |rows: &Vec<Row>| rows[..self.reach].iter().map(|row| row[LANES - 1]).collect();
        Sums {
            squares: one(&self.squares[0]),
            errors: one(&self.sum),
            slopes: self.slopes.iter().map(all).collect(),
            bends: self.bends.iter().map(all).collect(),
            products: self.products.iter().map(|by| by.iter().map(all).collect()).collect(),
            totals: all(&self.totals),
            tails: self.base.iter().map(tail).collect(),
            heads: self.heads,
        }
    }
}

/// Rows with zeros in the first piece where it does not count.
#[inline(always)]
fn counted(rows: &[Row], count: usize, uncounted: usize, left: &mut Vec<Row>) {
    left.clear();
    left.extend_from_slice(&rows[..count]);
    left[..uncounted].iter_mut().for_each(|row| row[0] = 0.0);
}

/// The level's part of the errors in one row.
#[inline(always)]
fn steady_row(at: &At<'_>, pad: usize, row: Option<usize>) -> Row {
    let steady = at.level * at.steady.ends[0];
    let mut made = [steady; LANES];
    made[0] = match row.and_then(|row| row.checked_sub(pad)) {
        None => 0.0,
        Some(t) => at.steady.answers[0].get(t).map_or(steady, |answer| at.level * answer),
    };
    made
}

#[inline(always)]
fn subtract_shifted(p: &[f64], source: &[Row], first: usize, shift: usize, target: &mut [Row]) {
    for (k, weight) in p.iter().enumerate() {
        add_shifted(&[-weight], source, first, shift + k, target);
    }
}

/// Signals through 1/C, up to three in one another's shadow.
#[inline(always)]
fn divide_all(c: &[f64], signals: &mut [Vec<Row>], first: usize, end: usize) {
    for group in signals.chunks_mut(3) {
        match group {
            [x, y, z] => divide_rows(c, [&mut x[..end], &mut y[..end], &mut z[..end]], first),
            [x, y] => divide_rows(c, [&mut x[..end], &mut y[..end]], first),
            others => {
                others.iter_mut().for_each(|x| divide_rows(c, [&mut x[..end]], first));
            }
        }
    }
}
