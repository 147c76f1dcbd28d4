//! Weights of an autoregression by Levinson's recursion over its orders.
//! (Python side: uncertainty/residual_noise.py)

/// Reflection above which a series predicts itself to rounding, as a pure tone does.
const TONE: f64 = 1.0 - 1e-9;
/// Share of the power that is left where there is rounding alone.
const ROUNDING: f64 = 1e-12;

/// Weights of the autoregression of `n` samples with these autocovariances that the Bayesian
/// information criterion prefers, and whether they are an autocovariance: a reflection of one or
/// more says that they are none.
///
/// Brockwell & Davis, Time Series: Theory and Methods (2nd ed.), sections 8.2 and 9.3.
pub fn weights(lags: &[f64], n: f64) -> (Vec<f64>, bool) {
    let Some(&power) = lags.first() else { return (Vec::new(), false) };
    let (mut trial, mut best): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut innovation = power;
    let mut criterion = if power > 0.0 { n * power.ln() } else { f64::NEG_INFINITY };
    for order in 1..lags.len() {
        // A residual that predicts itself to rounding has no further order.
        if innovation.is_nan() || innovation <= ROUNDING * power {
            break;
        }
        let past = lags[1..order].iter().rev();
        let told: f64 = trial.iter().zip(past).fold(0.0, |sum, (weight, lag)| sum + weight * lag);
        let reflection = (lags[order] - told) / innovation;
        if reflection.abs() >= 1.0 {
            return (best, false);
        }
        if reflection.abs() > TONE {
            break;
        }
        let turned: Vec<f64> = trial.iter().rev().copied().collect();
        trial.iter_mut().zip(turned).for_each(|(weight, other)| *weight -= reflection * other);
        trial.push(reflection);
        innovation *= 1.0 - reflection * reflection;
        let worth = n * innovation.max(1e-300).ln() + order as f64 * n.ln();
        if worth < criterion {
            criterion = worth;
            best.clone_from(&trial);
        }
    }
    (best, power >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::weights;

    #[test]
    fn weights_are_those_of_the_process() {
        // x(t) = 0.9 x(t − 1) − 0.2 x(t − 2) + e.
        let mut lags = vec![1.0, 0.9 / 1.2];
        for k in 2..8 {
            lags.push(0.9 * lags[k - 1] - 0.2 * lags[k - 2]);
        }
        let (found, sound) = weights(&lags, 1e4);
        assert!(sound && found.len() == 2);
        assert!((found[0] - 0.9).abs() < 1e-12 && (found[1] + 0.2).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_autocovariance_is_told() {
        assert_eq!(weights(&[1.0, 1.5], 100.0), (vec![], false));
        assert_eq!(weights(&[-1.0, 0.0], 100.0), (vec![], false));
        assert_eq!(weights(&[0.0, 0.0], 100.0), (vec![], true));
    }
}
