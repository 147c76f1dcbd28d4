use super::*;
use crate::black_box::digital_filter::{add_product, divide};
use crate::black_box::polynomial_fit::Before;
use crate::black_box::polynomial_predictor::Samples;
use crate::numerics::random::Random;

const LENGTHS: [usize; 2] = [2003, 1400];
const SKIP: usize = 7;

fn channels(n: usize, seed: u64) -> [Vec<f64>; 3] {
    let mut source = Random::new(seed);
    let mut drawn = |size: f64| (0..n).map(|_| size * source.normal() + 0.3).collect::<Vec<f64>>();
    let (u, v, e) = (drawn(1.0), drawn(2.0), drawn(0.5));
    let mut y = vec![0.0; n];
    add_product(1.0, &[1.0, 0.5], 1, &u, &mut y);
    add_product(0.4, &[1.0], 3, &v, &mut y);
    add_product(1.0, &[1.0, -0.6, 0.2], 0, &e, &mut y);
    divide(&[1.0, -1.5, 0.7], &mut y);
    [y, u, v]
}

/// Cost, gradient and curvature at a point, or what the usual way makes of the first two.
fn looked_at(c: usize, levels: bool, theta: &[f64]) -> (Point, Option<Point>) {
    let data: Vec<_> = LENGTHS.iter().zip(1..).map(|(&n, seed)| channels(n, seed)).collect();
    let records: Vec<Samples<'_>> =
        data.iter().map(|[y, u, v]| Samples { output: y, inputs: vec![u, v] }).collect();
    let cuts: Vec<Cut> = records.iter().map(Cut::of).collect();
    let orders = Orders { a: 2, b: vec![2, 1], c, d: 0, f: vec![0, 0], delays: vec![1, 3] };
    let mut problem = PredictionError::new(orders, records, Before::Rest, SKIP, false).unwrap();
    problem.levels = levels;
    let newton = Newton::new(&mut problem, &cuts);
    let (n, quick) = (theta.len(), newton.quick(theta));
    let mut usual = Point::new(n);
    let Newton { usual: mut dense, .. } = newton;
    dense.begin(theta).unwrap();
    dense.linearise(theta, &mut usual).unwrap();
    (usual, quick)
}

/// Rᵀ times a row, and RᵀR.
fn expanded(point: &Point) -> (Vec<f64>, Vec<f64>) {
    let n = point.projected.len();
    let column = |j: usize| &point.triangle[j * n..(j + 1) * n];
    let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(a, b)| a * b).sum::<f64>();
    let gradient = (0..n).map(|j| product(column(j), &point.projected)).collect();
    let square = (0..n * n).map(|k| product(column(k / n), column(k % n))).collect();
    (gradient, square)
}

fn theta(c: usize) -> Vec<f64> {
    let tail = [-0.55, 0.2, -0.05, 0.02, -0.01, 0.005, 0.002, -0.001];
    [&[-1.48, 0.69, 0.95, 0.52, 0.38], &tail[..c]].concat()
}

#[test]
fn one_pass_is_the_usual_way() {
    for c in 1..=8 {
        for levels in [false, true] {
            let (usual, quick) = looked_at(c, levels, &theta(c));
            let quick = quick.unwrap();
            let off = (quick.cost / usual.cost - 1.0).abs();
            assert!(off < 1e-13, "{c} {levels}: {off}");
            let n = quick.projected.len();
            let ((found, _), (wanted, square)) = (expanded(&quick), expanded(&usual));
            for (j, (found, wanted)) in found.iter().zip(wanted).enumerate() {
                let size = (square[j * n + j] * usual.cost).sqrt();
                let off = (found - wanted).abs() / size;
                assert!(off < 1e-13, "{c} {levels} {j}: {off}");
            }
        }
    }
}

#[test]
fn curvature_is_how_the_gradient_changes() {
    for levels in [false, true] {
        let at = theta(3);
        let (_, curvature) = expanded(&looked_at(3, levels, &at).1.unwrap());
        let n = at.len();
        for j in 0..n {
            let moved = |step: f64| {
                let mut x = at.clone();
                x[j] += step;
                expanded(&looked_at(3, levels, &x).1.unwrap()).0
            };
            let (up, down) = (moved(1e-5), moved(-1e-5));
            for i in 0..n {
                let change = (up[i] - down[i]) / 2e-5;
                let size = (curvature[i * n + i] * curvature[j * n + j]).sqrt();
                // A level that is eliminated leaves its own second slopes out.
                let room = if levels { 2e-3 } else { 1e-7 };
                let off = (curvature[j * n + i] - change).abs() / size;
                assert!(off < room, "{levels} {i} {j}: {off}");
            }
        }
    }
}

#[test]
fn a_long_memory_is_left_to_the_usual_way() {
    let mut slow = theta(1);
    slow[5] = -0.999;
    assert!(looked_at(1, true, &slow).1.is_none());
}

#[test]
fn near_a_curvature_only_the_gradient_is_made_anew() {
    let [y, u, v] = channels(LENGTHS[0], 5);
    let cuts = [Cut::of(&Samples { output: &y, inputs: vec![&u, &v] })];
    let mut problem = newton_problem(&y, &u, &v);
    let mut newton = Newton::new(&mut problem, &cuts);
    let (mut at, mut point) = (theta(2), Point::new(7));
    newton.begin(&at).unwrap();
    newton.linearise(&at, &mut point).unwrap();
    let (first, mut last) = (point.triangle.clone(), at.clone());
    last[0] += 1e-4;
    at[0] += 0.1;
    for (x, same) in [(last, true), (at, false)] {
        let wanted = Newton::new(&mut newton_problem(&y, &u, &v), &cuts).quick(&x).unwrap();
        let cost = newton.cost(&x).unwrap();
        newton.linearise(&x, &mut point).unwrap();
        assert_eq!(cost, wanted.cost);
        assert_eq!(point.triangle == first, same);
        for (a, b) in expanded(&point).0.iter().zip(expanded(&wanted).0) {
            assert!((a - b).abs() < 1e-12 * point.cost, "{same}: {a} {b}");
        }
    }
}

fn newton_problem<'a>(y: &'a [f64], u: &'a [f64], v: &'a [f64]) -> PredictionError<'a> {
    let records = vec![Samples { output: y, inputs: vec![u, v] }];
    let orders = Orders { a: 2, b: vec![2, 1], c: 2, d: 0, f: vec![0, 0], delays: vec![1, 3] };
    let mut problem = PredictionError::new(orders, records, Before::Rest, SKIP, false).unwrap();
    problem.levels = true;
    problem
}
