use super::*;
use crate::numerics::random::Random;

/// C and F with poles at `pole`, beside quick ones.
fn slow(pole: f64) -> (Orders, Vec<f64>) {
    let orders = Orders { a: 1, b: vec![2, 1], c: 1, d: 2, f: vec![2, 1], delays: vec![0, 1] };
    let f = [-pole - 0.3, 0.3 * pole];
    (orders, [&[-0.5, 1.0, 0.4, -0.7, -pole, -0.9, 0.2][..], &f, &[0.6]].concat())
}

#[test]
fn what_the_past_adds_is_what_a_run_with_it_has_more() {
    let mut source = Random::new(11);
    for (pole, n) in [(0.5, 900), (0.97, 900), (0.9999, 900), (0.5, 40)] {
        let (orders, theta) = slow(pole);
        let p = Polynomials::new(&orders, &theta).unwrap();
        let channels: Vec<Vec<f64>> =
            (0..3).map(|_| (0..n).map(|_| source.normal()).collect()).collect();
        let inputs = vec![&channels[1][..], &channels[2]];
        let samples = Samples { output: &channels[0], inputs };
        let mut past = Past::new(&orders, &p, n, 0);
        past.add_level(&p, n, 0);
        let values: Vec<f64> = (0..past.n_unknowns).map(|_| source.normal()).collect();
        let mut found = run(&orders, &p, &samples, &[]);
        found.add_past(&orders, &p, &past, &values);
        let wanted = run(&orders, &p, &samples, &values);
        let parts = |run: &Run| [&run.responses[..], std::slice::from_ref(&run.error)].concat();
        for (one, other) in parts(&found).iter().zip(parts(&wanted)) {
            for (x, y) in one.iter().zip(&other) {
                assert!((x - y).abs() < 1e-11 * y.abs().max(1.0), "{pole} {n}: {x} {y}");
            }
        }
        assert_eq!(found.level, *values.last().unwrap());
    }
}
