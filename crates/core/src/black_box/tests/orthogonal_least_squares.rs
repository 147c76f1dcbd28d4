use super::*;
use crate::black_box::radial_basis::{Kernel, Radial};
use crate::numerics::householder;
use crate::numerics::random::Random;
use proptest::prelude::*;

fn normal(random: &mut Random, count: usize) -> Vec<f64> {
    (0..count).map(|_| random.normal()).collect()
}

/// Sum of squared errors of a least-squares fit of the named columns, by Householder.
fn fitted(columns: &[f64], y: &[f64], terms: &[usize]) -> f64 {
    let n = y.len();
    let mut work: Vec<f64> =
        terms.iter().flat_map(|&j| columns[j * n..(j + 1) * n].to_vec()).collect();
    work.extend_from_slice(y);
    householder::triangularise(&mut work, n, terms.len());
    work[terms.len() * n + terms.len()..].iter().map(|value| value * value).sum()
}

/// Greedy selection by refitting every candidate at every step.
fn brute_force(columns: &[f64], y: &[f64], count: usize) -> (Vec<usize>, Vec<f64>) {
    let power: f64 = y.iter().map(|value| value * value).sum();
    let (mut terms, mut ratios, mut last) = (Vec::new(), Vec::new(), power);
    for _ in 0..count {
        let (mut best, mut least) = (0, f64::INFINITY);
        for j in (0..columns.len() / y.len()).filter(|j| !terms.contains(j)) {
            let with: Vec<usize> = terms.iter().copied().chain([j]).collect();
            let sum = fitted(columns, y, &with);
            if sum < least {
                (best, least) = (j, sum);
            }
        }
        terms.push(best);
        ratios.push((last - least) / power);
        last = least;
    }
    (terms, ratios)
}

fn compare(n: usize, m: usize, count: usize, seed: u64) {
    let mut random = Random::new(seed);
    let columns = normal(&mut random, n * m);
    let y = normal(&mut random, n);
    let candidates = Candidates::given(&columns, n);
    let ours = select(&candidates, &y, 0, &[], Stop::Terms, count).unwrap();
    let (terms, ratios) = brute_force(&columns, &y, count);
    assert_eq!(ours.terms, terms);
    for (a, b) in ours.error_reduction.iter().zip(&ratios) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
    let refit = fitted(&columns, &y, &terms);
    assert!((ours.sum_of_squares[count - 1] - refit).abs() < 1e-11 * n as f64);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn equals_brute_force(n in 12_usize..40, m in 8_usize..30, seed in 0_u64..1_000_000) {
        compare(n, m, 7, seed);
    }
}

#[test]
fn equals_brute_force_80_by_80() {
    compare(80, 80, 20, 7);
}

#[test]
fn radial_candidates_on_the_fly_equal_the_same_columns_given() {
    let mut random = Random::new(3);
    let (n, dimension) = (80, 4);
    let x = normal(&mut random, n * dimension);
    let y: Vec<f64> = x.chunks(dimension).map(|row| (row[0] * row[1]).sin()).collect();
    let radial = Radial::new(Kernel::Gaussian, 2.0, &x, dimension).unwrap();
    let columns: Vec<f64> = (0..n)
        .flat_map(|j| x.chunks(dimension).map(move |row| radial.value(j, row)).collect::<Vec<_>>())
        .collect();
    let given = Candidates::given(&columns, n);
    let lazy =
        Candidates { columns: &[], radial: Some((radial, &x)), rounded: false, n_samples: n };
    let a = select(&given, &y, 0, &[], Stop::Press, 25).unwrap();
    let b = select(&lazy, &y, 0, &[], Stop::Press, 25).unwrap();
    assert_eq!((&a.terms, a.kept), (&b.terms, b.kept));
    assert_eq!(a.weights, b.weights);
    let (terms, ratios) = brute_force(&columns, &y, 20);
    assert_eq!(a.terms[..20], terms[..]);
    assert!(a.error_reduction.iter().zip(&ratios).all(|(p, q)| (p - q).abs() < 1e-12));
}

#[test]
fn nearly_collinear_candidates_keep_their_digits() {
    // Candidates that differ by 1e-4 from the first: their squared remainder is 1e-8 of their length.
    let mut random = Random::new(11);
    let (n, m) = (60, 20);
    let trend: Vec<f64> = normal(&mut random, n);
    let mut columns = trend.clone();
    for _ in 1..m {
        columns.extend(trend.iter().map(|value| value + 1e-4 * random.normal()));
    }
    let y: Vec<f64> = trend.iter().map(|value| 3.0 * value + 0.1 * random.normal()).collect();
    let candidates = Candidates::given(&columns, n);
    let ours = select(&candidates, &y, 1, &[], Stop::Terms, 8).unwrap();
    let mut terms = vec![0];
    for step in 1..8 {
        let score = |j: &usize| fitted(&columns, &y, &[&terms[..], &[*j]].concat());
        let open: Vec<usize> = (0..m).filter(|j| !terms.contains(j)).collect();
        let next = open.iter().min_by(|a, b| score(a).total_cmp(&score(b))).unwrap();
        assert_eq!(ours.terms[step], *next);
        let refit = score(next);
        assert!((ours.sum_of_squares[step] - refit).abs() < 1e-12);
        terms.push(*next);
    }
}

#[test]
fn press_is_the_error_of_models_refitted_without_each_sample() {
    let mut random = Random::new(5);
    let (n, m) = (25, 6);
    let columns = normal(&mut random, n * m);
    let y = normal(&mut random, n);
    let candidates = Candidates::given(&columns, n);
    let ours = select(&candidates, &y, 0, &[], Stop::Terms, 3).unwrap();
    let mut sum = 0.0;
    for left in 0..n {
        let keep = |j: usize| -> Vec<f64> {
            (0..n).filter(|t| *t != left).map(|t| columns[j * n + t]).collect()
        };
        let part: Vec<f64> = ours.terms.iter().flat_map(|j| keep(*j)).collect();
        let rest: Vec<f64> = (0..n).filter(|t| *t != left).map(|t| y[t]).collect();
        let small = Candidates::given(&part, n - 1);
        let refit = select(&small, &rest, 3, &[], Stop::Terms, 3).unwrap();
        let terms = ours.terms.iter().zip(&refit.weights);
        let predicted: f64 = terms.map(|(j, weight)| weight * columns[j * n + left]).sum();
        sum += (y[left] - predicted).powi(2);
    }
    assert!((ours.press[2] - sum / n as f64).abs() < 1e-12);
}

fn sparse_problem() -> (Vec<f64>, Vec<f64>) {
    let mut random = Random::new(9);
    let columns = normal(&mut random, 200 * 30);
    let y = (0..200)
        .map(|t| 2.0 * columns[800 + t] - columns[3400 + t] + 0.1 * random.normal())
        .collect();
    (columns, y)
}

#[test]
fn stops_keep_what_they_promise() {
    let (columns, y) = sparse_problem();
    let candidates = Candidates::given(&columns, 200);
    let run = |stop| select(&candidates, &y, 0, &[], stop, 20).unwrap();
    assert_eq!(run(Stop::Bayes).terms[..2], [4, 17]);
    assert_eq!(run(Stop::Bayes).kept, 2);
    assert_eq!(run(Stop::ErrorReduction(0.01)).terms, [4, 17]);
    let goal = run(Stop::SumOfSquares(3.0));
    assert!(goal.kept == 2 && goal.sum_of_squares[1] <= 3.0 && goal.sum_of_squares[0] > 3.0);
    assert_eq!(run(Stop::Terms).kept, 20);
    let press = run(Stop::Press);
    let least = press.press.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(press.press[press.kept - 1], least);
    let (corrected, plain) = (run(Stop::AkaikeCorrected).kept, run(Stop::Akaike).kept);
    assert!((2..=plain).contains(&corrected));
    assert!((press.weights[0] - 2.0).abs() < 0.05 && (press.weights[1] + 1.0).abs() < 0.05);
}

#[test]
fn an_exact_fit_ends_the_selection() {
    let (columns, _) = sparse_problem();
    let y: Vec<f64> = (0..200).map(|t| columns[800 + t] - 0.5 * columns[3400 + t]).collect();
    let candidates = Candidates::given(&columns, 200);
    let mut terms = select(&candidates, &y, 0, &[], Stop::Press, 20).unwrap().terms;
    terms.sort_unstable();
    assert_eq!(terms, [4, 17]);
}

#[test]
fn forced_terms_come_first_and_one_thread_gives_the_same_bits() {
    let (columns, y) = sparse_problem();
    let candidates = Candidates::given(&columns, 200);
    let run = || select(&candidates, &y, 2, &[], Stop::Terms, 12).unwrap();
    let ours = run();
    assert_eq!(ours.terms[..3], [0, 1, 4]);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let other = pool.install(run);
        assert_eq!(other.terms, ours.terms);
        assert_eq!(other.weights, ours.weights);
    }
    // RᵀR is the Gram matrix of the terms.
    let k = ours.kept;
    for (i, j) in [(0, 0), (2, 5), (7, 7)] {
        let gram: f64 = (0..k).map(|r| ours.factor[r * k + i] * ours.factor[r * k + j]).sum();
        let column = |i: usize| &columns[ours.terms[i] * 200..(ours.terms[i] + 1) * 200];
        assert!((gram - dot(column(i), column(j))).abs() < 1e-10);
    }
}

#[test]
fn copies_of_a_term_are_counted_and_refused_when_forced() {
    let (mut columns, y) = sparse_problem();
    let copy = columns[800..1000].to_vec();
    columns.extend(copy.iter().map(|value| -3.0 * value));
    columns.splice(200..400, copy);
    let candidates = Candidates::given(&columns, 200);
    let ours = select(&candidates, &y, 0, &[], Stop::Terms, 5).unwrap();
    assert_eq!(ours.collinear, 2);
    let both = [&columns[800..1000], &columns[200..400]].concat();
    let twice = Candidates::given(&both, 200);
    let refused = select(&twice, &y, 2, &[], Stop::Terms, 5).unwrap_err();
    assert_eq!(refused, CoreError::Singular { what: "the set of forced terms" });
}

#[test]
fn refuses_what_cannot_be_selected_from() {
    let none = Candidates::given(&[], 2);
    assert!(select(&none, &[1.0, 2.0], 0, &[], Stop::Terms, 1).is_err());
    let some = Candidates::given(&[1.0, 2.0], 2);
    assert!(select(&some, &[0.0, 0.0], 0, &[], Stop::Terms, 1).is_err());
    assert!(select(&some, &[f64::NAN, 0.0], 0, &[], Stop::Terms, 1).is_err());
    assert!(select(&some, &[1.0], 0, &[], Stop::Terms, 1).is_err());
    assert!(select(&some, &[1.0, 2.0], 2, &[], Stop::Terms, 2).is_err());
    let radial = Radial::new(Kernel::Gaussian, 1.0, &[0.0, 1.0], 2).unwrap();
    let odd =
        Candidates { columns: &[], radial: Some((radial, &[1.0; 3])), rounded: true, n_samples: 2 };
    assert!(select(&odd, &[1.0, 2.0], 0, &[], Stop::Terms, 1).is_err());
}

#[test]
fn products_found_ahead_are_those_of_the_directions() {
    let mut random = Random::new(21);
    // More samples than a block, and columns with a common part.
    let (n, m) = (700, 60);
    let trend = normal(&mut random, n);
    let columns: Vec<f64> = (0..n * m).map(|i| random.normal() + trend[i % n]).collect();
    let y = normal(&mut random, n);
    let candidates = Candidates { rounded: false, ..Candidates::given(&columns, n) };
    let mut state = State::new(&candidates, &y, &[]).unwrap();
    let mut ahead = LookAhead::new(0, 40);
    for _ in 0..39 {
        let index = state.best().unwrap();
        assert!(state.add(index));
        let share = ahead.share(index, &state.progress());
        let direct = &state.directions[state.directions.len() - 1];
        for j in (0..m).filter(|j| state.remainders[*j].open) {
            let mut scratch = Vec::new();
            let column = candidates.column(j, &mut scratch);
            let exact = dot(direct, column);
            let error = (share[j] - exact).abs() / dot(column, column).sqrt();
            assert!(error < 1e-14, "{error}");
        }
        state.deflate((share, 0.0));
    }
    assert!(ahead.reads() < 25, "the candidates were read {} times", ahead.reads());
}

#[test]
fn refuses_penalties_and_columns_without_meaning() {
    let some = Candidates::given(&[1.0, 2.0], 2);
    assert!(select(&some, &[1.0, 2.0], 0, &[1.0, 1.0], Stop::Terms, 1).is_err());
    assert!(select(&some, &[1.0, 2.0], 0, &[-1.0], Stop::Terms, 1).is_err());
    let nan = Candidates::given(&[1.0, 2.0, 3.0, f64::NAN], 2);
    let refused = select(&nan, &[1.0, 2.0], 0, &[], Stop::Terms, 1).unwrap_err();
    assert_eq!(refused, CoreError::NotFinite { what: "the candidates", index: 1 });
    assert!(select(&some, &[1.0, 2.0], 0, &[f64::NAN], Stop::Terms, 1).is_err());
}

/// Columns of very different size that share a trend, copies among them.
fn alike(n: usize, m: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut random = Random::new(seed);
    let trend = normal(&mut random, n);
    let mut columns = Vec::new();
    for j in 0..m {
        let (size, apart) = (10.0_f64.powi(j as i32 % 7 - 3), 10.0_f64.powi(-(j as i32 % 4)));
        columns.extend(trend.iter().map(|value| size * (value + apart * random.normal())));
    }
    let copy: Vec<f64> = columns[..n].iter().map(|value| 2.0 * value).collect();
    columns.extend(copy);
    (columns, trend.iter().map(|value| value + 0.1 * random.normal()).collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn rounded_candidates_are_chosen_as_exact_ones(
        n in 12_usize..60, m in 8_usize..50, seed in 0_u64..1_000_000,
    ) {
        let (columns, y) = alike(n, m, seed);
        let candidates = Candidates::given(&columns, n);
        let exact = Candidates { rounded: false, ..candidates };
        let ours = select(&candidates, &y, 1, &[], Stop::Terms, 9).unwrap();
        let plain = select(&exact, &y, 1, &[], Stop::Terms, 9).unwrap();
        prop_assert_eq!(&ours.terms, &plain.terms);
        prop_assert_eq!(ours.weights, plain.weights);
        prop_assert_eq!(ours.collinear, plain.collinear);
    }

    #[test]
    fn what_is_left_is_within_its_doubts(seed in 0_u64..1_000_000) {
        let (n, m) = (50, 40);
        let (columns, y) = alike(n, m, seed);
        let candidates = Candidates::given(&columns, n);
        let mut state = State::new(&candidates, &y, &[]).unwrap();
        let mut ahead = LookAhead::new(0, 12);
        for _ in 0..12 {
            let index = state.best().unwrap();
            assert!(state.remainders[index].is_certain());
            if state.add(index) {
                let share = state.share(index, &mut ahead);
                state.deflate(share);
            }
            for (j, rest) in state.remainders.iter().enumerate().filter(|(_, rest)| rest.open) {
                let mut w = columns[j * n..(j + 1) * n].to_vec();
                orthogonalise(&mut w, &state.directions);
                let (length, product) = (dot(&w, &w), dot(&w, &state.unpenalised));
                // Double precision's own errors beside the doubts: of a whole candidate.
                let (a, b) = (1e-14 * rest.full, 1e-14 * (rest.full * dot(&y, &y)).sqrt());
                prop_assert!((rest.length - length).abs() <= rest.length_doubt + a);
                prop_assert!((rest.product - product).abs() <= rest.product_doubt + b);
                prop_assert!(rest.length_doubt <= 0.25 * rest.length);
            }
        }
    }
}

#[test]
fn candidates_alike_in_single_precision_are_told_apart() {
    let mut random = Random::new(31);
    let (n, m) = (64, 12);
    let (first, trend) = (normal(&mut random, n), normal(&mut random, n));
    let apart = normal(&mut random, n);
    let y: Vec<f64> = (0..n).map(|t| 3.0 * first[t] + trend[t] + 0.5 * apart[t]).collect();
    // The more of `apart` a candidate holds the better; they differ by 1e-11 from one to the next.
    let mut columns = first;
    for j in 0..m {
        let far = 1e-11 * ((5 * j + 3) % m) as f64;
        columns.extend(trend.iter().zip(&apart).map(|(value, other)| value + far * other));
    }
    let single: Vec<f32> = columns.iter().map(|value| *value as f32).collect();
    assert!((2..=m).filter(|j| single[j * n..(j + 1) * n] == single[n..2 * n]).count() > 6);
    let ours = select(&Candidates::given(&columns, n), &y, 1, &[], Stop::Terms, 2).unwrap();
    assert_eq!(ours.terms, [0, 5]);
}
