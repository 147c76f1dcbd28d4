//! Many runs of one linear recursion x(k+1) = A x(k) + f(k): the state predictor and its
//! sensitivities share their transition matrix. (Python side: identification/filter_error/fit.py)

use crate::error::CoreError;

/// States of every run as of `recurse_anyhow`, where none of them diverges.
///
/// # Errors
/// `Shape` where lengths do not fit, `NotFinite` where a run diverges.
pub fn recurse(
    transition: &[f64],
    forcing: &[f64],
    initial: &[f64],
    n_samples: usize,
) -> Result<Vec<f64>, CoreError> {
    let states = recurse_anyhow(transition, forcing, initial, n_samples)?;
    match states.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what: "a linear recursion", index }),
        None => Ok(states),
    }
}

/// States of every run, n_runs × n_samples × n: run after run, time before state.
///
/// `forcing` has that shape too; `initial` is n_runs × n.
///
/// # Errors
/// `Shape` where lengths do not fit.
pub fn recurse_anyhow(
    transition: &[f64],
    forcing: &[f64],
    initial: &[f64],
    n_samples: usize,
) -> Result<Vec<f64>, CoreError> {
    let n = transition.len().isqrt();
    let shape = |what, found, needed| Err(CoreError::Shape { what, found, needed });
    if n * n != transition.len() {
        return shape("transition matrix", transition.len(), n * n);
    }
    if n == 0 {
        return Ok(Vec::new());
    }
    if !initial.len().is_multiple_of(n) {
        return shape("initial states", initial.len(), n);
    }
    if forcing.len() != initial.len() * n_samples {
        return shape("forcing", forcing.len(), initial.len() * n_samples);
    }
    let mut states = vec![0.0; forcing.len()];
    let length = n * n_samples;
    if length == 0 {
        return Ok(states);
    }
    for (run, start) in initial.chunks_exact(n).enumerate() {
        let forced = &forcing[run * length..(run + 1) * length];
        let path = &mut states[run * length..(run + 1) * length];
        path[..n].copy_from_slice(start);
        for k in 1..n_samples {
            let (before, after) = path.split_at_mut(k * n);
            let last = &before[(k - 1) * n..];
            let drive = &forced[(k - 1) * n..k * n];
            for ((next, row), drive) in
                after[..n].iter_mut().zip(transition.chunks_exact(n)).zip(drive)
            {
                *next = drive + row.iter().zip(last).map(|(a, x)| a * x).sum::<f64>();
            }
        }
    }
    Ok(states)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_do_not_touch_each_other() {
        let transition = [1.0, 1.0, 0.0, 0.5];
        let forcing = [0.0, 1.0, 0.0, 1.0, 9.0, 9.0, 0.0, 0.0, 2.0, 0.0, 9.0, 9.0];
        let found = recurse(&transition, &forcing, &[1.0, 0.0, 0.0, 4.0], 3).unwrap();
        let first = [1.0, 0.0, 1.0, 1.0, 2.0, 1.5];
        let second = [0.0, 4.0, 4.0, 2.0, 8.0, 1.0];
        assert_eq!(found, [first, second].concat());
    }

    #[test]
    fn what_does_not_fit_or_diverges_is_refused() {
        assert!(matches!(recurse(&[1.0; 3], &[], &[], 0), Err(CoreError::Shape { .. })));
        assert!(matches!(recurse(&[1.0; 4], &[], &[0.0; 3], 0), Err(CoreError::Shape { .. })));
        assert!(matches!(recurse(&[1.0], &[0.0], &[0.0], 3), Err(CoreError::Shape { .. })));
        let found = recurse(&[1e200], &[0.0; 4], &[1.0], 4);
        assert!(matches!(found, Err(CoreError::NotFinite { .. })));
        let anyhow = recurse_anyhow(&[1e200], &[0.0; 4], &[1.0], 4).unwrap();
        assert_eq!(anyhow, [1.0, 1e200, f64::INFINITY, f64::INFINITY]);
        assert_eq!(recurse(&[1.0], &[], &[1.0], 0).unwrap(), Vec::<f64>::new());
    }
}
