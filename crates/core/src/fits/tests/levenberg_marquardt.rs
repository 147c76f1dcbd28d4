use super::*;

struct Rosenbrock;

impl Problem for Rosenbrock {
    fn n_parameters(&self) -> usize {
        2
    }
    fn n_residuals(&self) -> usize {
        2
    }
    fn residuals(&mut self, x: &[f64], r: &mut [f64]) -> Result<(), CoreError> {
        r.copy_from_slice(&[10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], j: &mut [f64]) -> Result<(), CoreError> {
        j.copy_from_slice(&[-20.0 * x[0], 10.0, -1.0, 0.0]);
        Ok(())
    }
}

fn solve(lower: [f64; 2], upper: [f64; 2]) -> Minimum {
    let go = &mut |_: &Progress| true;
    minimise(&mut Rosenbrock, &[-1.2, 1.0], &lower, &upper, &Options::default(), go).unwrap()
}

const OPEN: [f64; 2] = [f64::INFINITY; 2];

#[test]
fn rosenbrock_free() {
    let found = solve([f64::NEG_INFINITY; 2], OPEN);
    assert!((found.x[0] - 1.0).abs() < 1e-12 && (found.x[1] - 1.0).abs() < 1e-12);
    assert!(found.termination.is_converged() && found.iterations < 60);
}

#[test]
fn rosenbrock_at_a_bound() {
    // With x ≤ 0.5 the minimum is (0.5, 0.25), cost 0.25.
    let found = solve([-2.0, -2.0], [0.5, 2.0]);
    assert!((found.x[0] - 0.5).abs() < 1e-15 && (found.x[1] - 0.25).abs() < 1e-10);
    // With y ≥ 1.5 as lower bound: the stationary point of the remaining cubic.
    let found = solve([-2.0, 1.5], [2.0, 2.0]);
    let x = found.x[0];
    assert_eq!(found.x[1], 1.5);
    assert!((-400.0 * x * (1.5 - x * x) - 2.0 * (1.0 - x)).abs() < 1e-6);
}

/// Counts the Jacobians that a search asks for, and the residuals that come beside one.
#[derive(Default)]
struct Counted {
    jacobians: usize,
    residuals: usize,
    beside: bool,
}

impl Problem for Counted {
    fn n_parameters(&self) -> usize {
        2
    }
    fn n_residuals(&self) -> usize {
        2
    }
    fn residuals(&mut self, x: &[f64], r: &mut [f64]) -> Result<(), CoreError> {
        self.residuals += 1;
        Rosenbrock.residuals(x, r)
    }
    fn jacobian(&mut self, x: &[f64], j: &mut [f64]) -> Result<(), CoreError> {
        self.jacobians += 1;
        Rosenbrock.jacobian(x, j)
    }
    fn makes_both(&self) -> bool {
        self.beside
    }
    fn both(&mut self, x: &[f64], r: &mut [f64], j: &mut [f64]) -> Result<(), CoreError> {
        self.jacobian(x, j)?;
        Rosenbrock.residuals(x, r)
    }
}

#[test]
fn a_last_point_that_nobody_asks_slopes_of_is_the_same_without_them() {
    let ends = |maximum_iterations: usize, last_slopes: bool| {
        let mut problem = Counted::default();
        let options = Options { maximum_iterations, last_slopes, ..Options::default() };
        let (low, go) = ([f64::NEG_INFINITY; 2], &mut |_: &Progress| true);
        let found = minimise(&mut problem, &[-1.2, 1.0], &low, &OPEN, &options, go).unwrap();
        (found, problem.jacobians)
    };
    let mut spared = 0;
    for most in 1..8 {
        let (whole, asked) = ends(most, true);
        let (bare, fewer) = ends(most, false);
        assert_eq!((&whole.x, whole.iterations), (&bare.x, bare.iterations));
        assert_eq!((whole.cost, whole.termination), (bare.cost, bare.termination));
        // A step that was refused leaves the slopes that there were.
        let saved = usize::from(bare.triangle.is_empty());
        assert_eq!((asked, bare.jacobian.len()), (fewer + saved, 4 * (1 - saved)));
        assert_eq!(bare.residuals.len(), 2 * (1 - saved));
        spared += saved;
    }
    assert!(spared > 0 && spared < 7);
    // A search that ends by itself knows its slopes.
    assert_eq!(ends(200, false).0.jacobian.len(), 4);
}

#[test]
fn residuals_of_the_start_come_beside_its_jacobian_where_a_problem_makes_both() {
    let ends = |beside: bool| {
        let mut problem = Counted { beside, ..Counted::default() };
        let (low, go) = ([f64::NEG_INFINITY; 2], &mut |_: &Progress| true);
        let options = Options::default();
        let found = minimise(&mut problem, &[-1.2, 1.0], &low, &OPEN, &options, go).unwrap();
        (found.x, found.residuals, found.jacobian, problem)
    };
    let ((x, r, j, one), (y, s, k, both)) = (ends(false), ends(true));
    assert_eq!((x, r, j), (y, s, k));
    assert_eq!((one.jacobians, one.residuals), (both.jacobians, both.residuals + 1));
}

/// Two nearly parallel columns whose free minimum (-9, 10) lies across both bounds.
struct Parallel;

impl Problem for Parallel {
    fn n_parameters(&self) -> usize {
        2
    }
    fn n_residuals(&self) -> usize {
        2
    }
    fn residuals(&mut self, x: &[f64], r: &mut [f64]) -> Result<(), CoreError> {
        r.copy_from_slice(&[x[0] + x[1] - 1.0, 0.1 * (x[1] - 10.0)]);
        Ok(())
    }
    fn jacobian(&mut self, _: &[f64], j: &mut [f64]) -> Result<(), CoreError> {
        j.copy_from_slice(&[1.0, 1.0, 0.0, 0.1]);
        Ok(())
    }
}

#[test]
fn a_step_cut_at_two_bounds_does_not_end_the_search() {
    // Cut at both bounds the first step promises a rise from 2 to 49.
    let go = &mut |_: &Progress| true;
    let (low, high) = ([0.0, -8.0], [8.0, 8.0]);
    let found = minimise(&mut Parallel, &[0.0, 0.0], &low, &high, &Options::default(), go).unwrap();
    assert_eq!(found.x[0], 0.0);
    assert!((found.x[1] - 1.1 / 1.01).abs() < 1e-8, "{:?}", found.x);
    assert!(found.termination.is_converged());
}

#[test]
fn everything_fixed_and_interruption() {
    let found = solve([-1.2, 1.0], [-1.2, 1.0]);
    assert_eq!(found.termination, Termination::Bounds);
    let stop = &mut |_: &Progress| false;
    let low = [f64::NEG_INFINITY; 2];
    let found =
        minimise(&mut Rosenbrock, &[-1.2, 1.0], &low, &OPEN, &Options::default(), stop).unwrap();
    assert_eq!((found.termination, found.iterations), (Termination::Interrupted, 1));
}

#[test]
fn bad_bounds_and_starts_are_refused() {
    let go = &mut |_: &Progress| true;
    let options = Options::default();
    let crossed = minimise(&mut Rosenbrock, &[0.0; 2], &[1.0, 0.0], &[0.0; 2], &options, go);
    assert!(matches!(crossed, Err(CoreError::Range { .. })));
    let short = minimise(&mut Rosenbrock, &[0.0], &[0.0], &[0.0], &options, go);
    assert!(matches!(short, Err(CoreError::Shape { .. })));
    let nan = minimise(&mut Rosenbrock, &[f64::NAN, 0.0], &[-1.0; 2], &[1.0; 2], &options, go);
    assert!(matches!(nan, Err(CoreError::NotFinite { .. })));
}

/// A cost that no step lowers, whatever its slope promises.
struct Deaf {
    slope: f64,
}

impl Objective for Deaf {
    fn n_parameters(&self) -> usize {
        1
    }

    fn cost(&mut self, _x: &[f64]) -> Result<f64, CoreError> {
        Ok(1.0)
    }

    fn begin(&mut self, _x: &[f64]) -> Result<(), CoreError> {
        Ok(())
    }

    fn linearise(&mut self, _x: &[f64], point: &mut Point) -> Result<(), CoreError> {
        point.cost = 1.0;
        point.triangle[0] = 1.0;
        point.projected[0] = self.slope;
        Ok(())
    }
}

#[test]
fn a_stall_is_a_minimum_where_next_to_nothing_is_left() {
    // The undamped step promises the slope's square of a cost of one.
    for (slope, ended) in [(1e-6, Termination::Cost), (1e-2, Termination::Stalled)] {
        let (low, high) = ([f64::NEG_INFINITY], [f64::INFINITY]);
        let found =
            search(&mut Deaf { slope }, &[1.0], &low, &high, &Options::default(), &mut |_| true)
                .unwrap();
        assert_eq!(found.termination, ended);
    }
}
