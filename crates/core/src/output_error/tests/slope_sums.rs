use super::*;

const N: usize = 130;
const P: usize = 2;

/// Outputs and derivatives that are waves: two parameters, two initial states, one input.
struct Waves {
    lengths: [usize; 1],
}

fn wave(k: usize, output: usize, column: usize) -> f64 {
    ((3 * column + output + 1) as f64 * 0.37 * k as f64).sin()
}

impl Trajectories for Waves {
    /// The step along which θ moves alone, if any.
    type Shared = Option<Vec<f64>>;

    fn n_outputs(&self) -> usize {
        P
    }
    fn n_parameters(&self) -> usize {
        2
    }
    fn n_shifts(&self) -> usize {
        1
    }
    fn record_lengths(&self) -> &[usize] {
        &self.lengths
    }
    fn n_initial(&self, _: usize) -> usize {
        2
    }
    fn is_affine(&self) -> bool {
        true
    }
    fn share(&self, _: &[f64], _: bool) -> Result<Self::Shared, CoreError> {
        Ok(None)
    }
    fn run(
        &self,
        shared: &Self::Shared,
        _: usize,
        _: &[f64],
        _: &[f64],
        wanted: &Wanted<'_>,
        scratch: &mut Vec<f64>,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError> {
        let n_theta = shared.as_ref().map_or(2, |_| 1);
        let (stride, columns) = (wanted.stride(n_theta), wanted.columns(n_theta));
        for first in (0..N).step_by(50) {
            scratch.clear();
            for k in first..N.min(first + 50) {
                for output in 0..P {
                    scratch.push(wave(k, output, 0));
                    match shared {
                        Some(step) => scratch.push(
                            step.iter().zip(1..).map(|(each, c)| each * wave(k, output, c)).sum(),
                        ),
                        None => scratch.extend([1, 2].map(|column| wave(k, output, column))),
                    }
                    scratch.extend([3, 4].map(|column| wave(k, output, column)));
                    scratch.resize(scratch.len() + stride - columns, 0.0);
                }
            }
            sink(first, scratch);
        }
        Ok(())
    }
}

impl Directed for Waves {
    fn along(&self, _: &Self::Shared, step: &[f64]) -> Self::Shared {
        Some(step.to_vec())
    }
}

fn data() -> RecordData {
    RecordData {
        measured: (0..N * P).map(|k| (k as f64).cos()).collect(),
        initial: vec![0.0; 2],
        shift: vec![0.0],
        bias: vec![0.25, -0.5],
        free_initial: vec![1],
        free_shift: vec![0],
        free_bias: vec![1],
        limits: Vec::new(),
    }
}

/// Derivatives in the order θ, own numbers; the last is the bias of the second output.
fn slope(k: usize, output: usize, column: usize) -> f64 {
    if column < 4 { wave(k, output, 1 + column) } else { output as f64 }
}

#[test]
fn sums_are_those_of_the_columns() {
    let (waves, data) = (Waves { lengths: [N] }, data());
    let sloped = Sloped::new(&waves, 0, &data, &[0.0; 2]).unwrap();
    let (left, products) = sloped.products(None).unwrap();
    let other: Vec<f64> = left.iter().map(|each| 2.0 * each + 1.0).collect();
    let (same, twice) = sloped.products(Some(&other)).unwrap();
    assert_eq!(same, other);
    for o in 0..P {
        let rest = |k: usize| data.measured[k * P + o] - wave(k, o, 0) - data.bias[o];
        for k in 0..N {
            assert!((left[o * N + k] - rest(k)).abs() < 1e-15);
        }
        for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
            for (products, residual) in [(&products, &left), (&twice, &other)] {
                let each = |c: usize, k: usize| {
                    if c < 5 { slope(k, o, c) } else { residual[o * N + k] }
                };
                let wanted: f64 = (0..N).map(|k| each(i, k) * each(j, k)).sum();
                assert!((products[(o * 6 + i) * 6 + j] - wanted).abs() < 1e-11, "{o} {i} {j}");
            }
        }
    }
}

#[test]
fn a_step_leaves_what_its_columns_do() {
    let (waves, data, step) = (Waves { lengths: [N] }, data(), [0.3, -0.2, 0.7, 0.1, -0.4]);
    let sloped = Sloped::new(&waves, 0, &data, &[0.0; 2]).unwrap();
    let (left, _) = sloped.products(None).unwrap();
    let found = sloped.stepped(&left, &step).unwrap();
    for o in 0..P {
        for k in 0..N {
            let moved: f64 = (0..5).map(|c| step[c] * slope(k, o, c)).sum();
            assert!((found[o * N + k] - (left[o * N + k] - moved)).abs() < 1e-14);
        }
    }
    assert!(sloped.stepped(&left, &step[..4]).is_err());
    assert!(sloped.products(Some(&left[1..])).is_err());
}
