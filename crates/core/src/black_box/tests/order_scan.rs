use super::*;
use crate::black_box::digital_filter::divide;
use crate::black_box::polynomial_fit::{fit_from, regress};
use crate::numerics::random::Random;

fn flown(seed: u64, n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut source = Random::new(seed);
    let u: Vec<f64> = (0..n).map(|_| source.normal()).collect();
    let e: Vec<f64> = (0..n).map(|_| 0.3 * source.normal()).collect();
    let mut y = vec![0.0; n];
    add_product(1.0, &[1.0, 0.5], 1, &u, &mut y);
    add_product(1.0, &[1.0, -0.6], 0, &e, &mut y);
    divide(&[1.0, -1.5, 0.7], &mut y);
    (y, u)
}

fn orders(a: usize, b: usize, c: usize, delay: usize) -> Orders {
    Orders { a, b: vec![b], c, d: 0, f: vec![0], delays: vec![delay] }
}

fn scanned(candidates: Vec<Orders>) -> Vec<Option<Scanned>> {
    let (y, u) = flown(1, 1000);
    let work = Scan {
        records: vec![Samples { output: &y, inputs: vec![&u] }],
        candidates,
        long: 25,
        maximum_iterations: 60,
        levels: true,
    };
    scan(&work, &|| false).unwrap()
}

#[test]
fn columns_of_the_large_triangle_give_each_regression() {
    let candidates = vec![orders(2, 2, 0, 1), orders(4, 3, 0, 2), orders(1, 1, 0, 4)];
    let (y, u) = flown(1, 1000);
    for (each, found) in candidates.iter().zip(scanned(candidates.clone())) {
        let found = found.unwrap();
        let samples = Samples { output: &y, inputs: vec![&u] };
        let mut alone =
            PredictionError::new(each.clone(), vec![samples], Before::Rest, 5, false).unwrap();
        alone.levels = true;
        let direct = regress(&mut alone).unwrap();
        let width = direct.theta.len() + 1;
        let squares = direct.triangle[width * width - 1].powi(2);
        assert!((found.squares / squares - 1.0).abs() < 1e-10);
        for (a, b) in found.theta.iter().zip(&direct.theta) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}

#[test]
fn refined_structures_reach_the_minimum_of_the_full_fit() {
    let found = scanned(vec![orders(2, 2, 1, 1), orders(1, 1, 1, 1)]);
    let best = found[0].as_ref().unwrap();
    assert!(best.converged && best.squares < found[1].as_ref().unwrap().squares);
    let (y, u) = flown(1, 1000);
    let samples = Samples { output: &y, inputs: vec![&u] };
    let mut whole =
        PredictionError::new(orders(2, 2, 1, 1), vec![samples], Before::Rest, 3, false).unwrap();
    whole.levels = true;
    let ends = fit_from(&whole, std::slice::from_ref(&best.theta), &Options::default(), &|| false);
    let end = ends[0].as_ref().unwrap();
    assert!((best.squares / end.cost - 1.0).abs() < 1e-4);
    for (a, b) in best.theta.iter().zip(&end.x) {
        assert!((a - b).abs() < 2e-3, "{a} {b}");
    }
}

#[test]
fn normal_equations_are_those_of_the_jacobian() {
    let (y, u) = flown(3, 700);
    let samples = Samples { output: &y, inputs: vec![&u] };
    let theta = [-1.4, 0.6, 0.9, 0.4, -0.3, 0.1];
    let mut problem =
        PredictionError::new(orders(2, 2, 2, 1), vec![samples], Before::Rest, 4, false).unwrap();
    let mut made = [vec![0.0; 49], vec![0.0; 49]];
    problem.levels = true;
    for (triangle, fast) in made.iter_mut().zip([false, true]) {
        problem.fast = fast;
        assert!(problem.triangle(&theta, triangle).unwrap());
    }
    let product = |r: &[f64], i: usize, j: usize| {
        crate::numerics::householder::dot(&r[i * 7..i * 7 + 7], &r[j * 7..j * 7 + 7])
    };
    for i in 0..7 {
        for j in 0..7 {
            let (one, two) = (product(&made[0], i, j), product(&made[1], i, j));
            let scale = (product(&made[0], i, i) * product(&made[0], j, j)).sqrt();
            assert!((one - two).abs() < 1e-11 * scale, "{i} {j}: {one} {two}");
        }
    }
}

#[test]
fn collinear_columns_and_short_records_are_told() {
    let (y, _) = flown(1, 300);
    let work = |long| Scan {
        records: vec![Samples { output: &y, inputs: vec![&y] }],
        candidates: vec![orders(1, 1, 0, 1), orders(1, 0, 0, 1)],
        long,
        maximum_iterations: 5,
        levels: false,
    };
    let found = scan(&work(10), &|| false).unwrap();
    assert!(found[0].is_none() && found[1].is_some());
    assert!(matches!(scan(&work(300), &|| false), Err(CoreError::Shape { .. })));
    let mut two = work(10);
    two.candidates.push(Orders { b: vec![1, 1], delays: vec![1, 1], ..orders(1, 1, 0, 1) });
    assert!(matches!(scan(&two, &|| false), Err(CoreError::Shape { .. })));
}

#[test]
fn no_structure_ends_above_one_within_it() {
    let mut source = Random::new(4);
    let u: Vec<f64> = (0..3000).map(|_| source.normal().signum()).collect();
    let e: Vec<f64> = (0..3000).map(|_| 0.3 * source.normal()).collect();
    let mut y = vec![0.0; 3000];
    add_product(1.0, &[0.5, 0.3, -0.1], 1, &u, &mut y);
    add_product(1.0, &[1.0, -0.8, 0.3], 0, &e, &mut y);
    divide(&[1.0, -2.2, 1.9, -0.65], &mut y);
    let mut candidates = Vec::new();
    for a in 1..3 {
        for b in 1..5 {
            candidates.extend((0..6).map(|c| orders(a, b, c, 1)));
            candidates.extend((1..3).map(|c| orders(a, b, c, 2)));
        }
    }
    let work = Scan {
        records: vec![Samples { output: &y, inputs: vec![&u] }],
        candidates: candidates.clone(),
        long: 25,
        maximum_iterations: 40,
        levels: true,
    };
    let found = scan(&work, &|| false).unwrap();
    let squares = |k: usize| found[k].as_ref().unwrap().squares;
    for (k, larger) in candidates.iter().enumerate() {
        for (j, smaller) in candidates.iter().enumerate() {
            if lies_within(smaller, larger) && larger.c > 0 {
                assert!(squares(k) <= squares(j), "{larger:?} above {smaller:?}");
            }
        }
    }
}

#[test]
fn coefficients_of_a_smaller_structure_keep_their_places() {
    let (smaller, larger) = (orders(1, 2, 1, 1), orders(3, 2, 2, 1));
    assert!(lies_within(&smaller, &larger) && !lies_within(&larger, &smaller));
    assert!(!lies_within(&larger, &larger) && !lies_within(&orders(1, 2, 1, 2), &larger));
    let (later, sooner) = (orders(1, 1, 1, 2), orders(1, 3, 1, 1));
    assert!(lies_within(&later, &sooner) && !lies_within(&orders(1, 1, 1, 0), &sooner));
    assert_eq!(widened(&later, &sooner, &[1.0, 2.0, 3.0]), [1.0, 0.0, 2.0, 0.0, 3.0]);
    let made = widened(&smaller, &larger, &[1.0, 2.0, 3.0, 4.0]);
    assert_eq!(made, [1.0, 0.0, 0.0, 2.0, 3.0, 4.0, 0.0]);
}
