use super::*;
use crate::numerics::random::Random;
use proptest::prelude::*;

fn rounded_with(columns: &[f64], y: &[f64]) -> (RoundedColumns, Vec<Remainder>) {
    RoundedColumns::of(&Candidates::given(columns, y.len()), y, &[])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn products_miss_no_more_than_is_said(
        n in 1_usize..260, m in 1_usize..40, decades in -150_i32..150, seed in 0_u64..1_000_000,
    ) {
        let mut random = Random::new(seed);
        let size = 10.0_f64.powi(decades);
        let columns: Vec<f64> = (0..n * m).map(|_| size * random.normal()).collect();
        let y: Vec<f64> = (0..n).map(|_| random.normal()).collect();
        let (rounded, rest) = rounded_with(&columns, &y);
        let norm = dot(&y, &y).sqrt();
        let q: Vec<f64> = y.iter().map(|value| value / norm).collect();
        let (found, blurred) = rounded.products(&q, |_| true);
        for (index, column) in columns.chunks(n).enumerate() {
            let exact = dot(column, &q);
            let missed = rest[index].missed + blurred * rest[index].length.sqrt();
            prop_assert!((found[index] - exact).abs() <= missed);
            // Half a step for each sample, of 32,767 to 16,383 in the largest entry.
            let most = (n as f64).sqrt() / 32_766.0 * (1.0 + 1e-9);
            prop_assert!(rest[index].missed <= most * rest[index].length.sqrt());
            prop_assert_eq!(rest[index].length, dot(column, column));
            prop_assert_eq!(rest[index].product, dot(column, &y));
        }
    }
}

#[test]
fn whole_numbers_have_exact_products() {
    for (n, m) in [(1, 1), (7, 3), (8, 4), (23, 21)] {
        let columns: Vec<f64> = (0..n * m).map(|i| (i % 17) as f64 - 8.0).collect();
        let q: Vec<f64> = (0..n).map(|i| (i % 5) as f64 - 1.0).collect();
        let (rounded, _) = rounded_with(&columns, &q);
        let (found, blurred) = rounded.products(&q, |_| true);
        assert_eq!(blurred, 0.0);
        let exact: Vec<f64> =
            columns.chunks(n).map(|p| p.iter().zip(&q).map(|(x, v)| x * v).sum()).collect();
        let nothing = columns.chunks(n).map(|p| p.iter().all(|x| *x == 0.0));
        for ((ours, exact), nothing) in found.iter().zip(exact).zip(nothing) {
            assert!(nothing || *ours == exact, "{ours} {exact}");
        }
    }
}

#[test]
fn closed_groups_are_not_read() {
    let columns: Vec<f64> = (0..40).map(|i| 1.0 + i as f64).collect();
    let (rounded, _) = rounded_with(&columns, &[1.0, 1.0]);
    let (found, _) = rounded.products(&[1.0, 0.0], |index| index == 5);
    assert_eq!(found[4..8], [9.0, 11.0, 13.0, 15.0]);
    assert!(found[..4].iter().chain(&found[8..]).all(|value| *value == 0.0));
}
