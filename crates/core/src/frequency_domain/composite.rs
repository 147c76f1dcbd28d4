//! The composite of several windows at many places: four unknowns meet five residuals at each.
//! (Python side: `responses/estimators/composite.py`)

/// Weight of the coherence among the five terms of the cost, and when a place has come to rest.
#[derive(Debug, Clone, Copy)]
pub struct CompositeRule {
    /// Weight of the fifth residual.
    pub coherence_weight: f64,
    /// Gauss–Newton steps at most.
    pub steps: usize,
    /// Halvings of a step at most.
    pub halvings: usize,
    /// Largest change of an unknown, over its scale, that counts as rest.
    pub tolerance: f64,
    /// Share by which rounding may raise the cost.
    pub rounding: f64,
}

/// What is asked at one place: scaled targets of unknowns and coherence, and their scales.
#[derive(Debug, Clone, Copy)]
struct Place {
    target: [f64; 5],
    scale: [f64; 5],
}

/// Scaled unknowns at every place after Gauss–Newton steps.
///
/// Rows of all arguments lie one after another: four of starts, five of targets and of scales, each as
/// long as there are places.
pub fn composite(start: &[f64], target: &[f64], scale: &[f64], rule: CompositeRule) -> Vec<f64> {
    let count = start.len() / 4;
    let mut found = vec![0.0; 4 * count];
    for at in 0..count {
        let row = |of: &[f64], k: usize| of.get(k * count + at).copied().unwrap_or(f64::NAN);
        let place = Place {
            target: std::array::from_fn(|k| row(target, k)),
            scale: std::array::from_fn(|k| row(scale, k)),
        };
        let end = place.rest(std::array::from_fn(|k| row(start, k)), rule);
        for (k, value) in end.into_iter().enumerate() {
            found[k * count + at] = value;
        }
    }
    found
}

impl Place {
    fn rest(&self, start: [f64; 4], rule: CompositeRule) -> [f64; 4] {
        let mut x = start;
        for _ in 0..rule.steps {
            let next = self.step(x, rule);
            let moved = (0..4).map(|k| (next[k] - x[k]).abs());
            // A place that is not a number rests.
            let rests = !moved.fold(0.0, |most: f64, each| most.max(each)).ge(&rule.tolerance);
            x = next;
            if rests {
                break;
            }
        }
        x
    }

    /// Coherence over its scale, and its gradient.
    fn coherence(&self, x: [f64; 4]) -> (f64, [f64; 4]) {
        let scale = self.scale;
        let (re, im) = (x[2] * scale[2], x[3] * scale[3]);
        let power = x[0] * x[1] * scale[0] * scale[1] * scale[4];
        let value = (re * re + im * im) / power;
        let slope = [
            -value / x[0],
            -value / x[1],
            2.0 * re * scale[2] / power,
            2.0 * im * scale[3] / power,
        ];
        (value, slope)
    }

    fn cost(&self, x: [f64; 4], value: f64, weight: f64) -> f64 {
        let away = value - self.target[4];
        let distance: f64 = (0..4).map(|k| (x[k] - self.target[k]) * (x[k] - self.target[k])).sum();
        distance + weight * (away * away)
    }

    /// The unknowns after one step, halved where the cost would rise; where they are if it always does.
    fn step(&self, x: [f64; 4], rule: CompositeRule) -> [f64; 4] {
        let weight = rule.coherence_weight;
        let (value, slope) = self.coherence(x);
        let away = value - self.target[4];
        let gradient: [f64; 4] =
            std::array::from_fn(|k| (x[k] - self.target[k]) + weight * slope[k] * away);
        // Sherman–Morrison on identity + 5 s sᵀ.
        let along: f64 = (0..4).map(|k| slope[k] * gradient[k]).sum();
        let bent = 1.0 + weight * slope.iter().map(|each| each * each).sum::<f64>();
        let step: [f64; 4] =
            std::array::from_fn(|k| -(gradient[k] - weight * slope[k] * along / bent));
        let allowed = self.cost(x, value, weight) * (1.0 + rule.rounding);
        let mut length = 1.0;
        for _ in 0..rule.halvings {
            let trial: [f64; 4] = std::array::from_fn(|k| x[k] + length * step[k]);
            if trial[0] > 0.0
                && trial[1] > 0.0
                && self.cost(trial, self.coherence(trial).0, weight) <= allowed
            {
                return trial;
            }
            length *= 0.5;
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::{CompositeRule, composite};

    const RULE: CompositeRule = CompositeRule {
        coherence_weight: 5.0,
        steps: 40,
        halvings: 30,
        tolerance: 1e-11,
        rounding: 1e-13,
    };

    #[test]
    fn unknowns_that_meet_all_targets_stay() {
        // Coherence 0.5 of powers 2 and 4: |cross|² = 4.
        let scale = [2.0, 4.0, 2.0, 1.0, 0.5];
        let start = [1.0, 1.0, 1.0, 0.0];
        let target = [1.0, 1.0, 1.0, 0.0, 1.0];
        let found = composite(&start, &target, &scale, RULE);
        assert!(found.iter().zip(start).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }

    #[test]
    fn the_end_is_a_minimum_of_the_cost() {
        let scale = [2.0, 4.0, 2.0, 1.0, 0.4];
        let target = [1.02, 0.97, 1.1, 0.2, 0.9];
        let x = composite(&[1.0, 1.0, 1.0, 0.1], &target, &scale, RULE);
        let cost = |x: &[f64]| {
            let power = x[0] * x[1] * 8.0 * 0.4;
            let value = ((2.0 * x[2]).powi(2) + x[3].powi(2)) / power;
            let near: f64 = (0..4).map(|k| (x[k] - target[k]).powi(2)).sum();
            near + 5.0 * (value - target[4]).powi(2)
        };
        for k in 0..4 {
            for way in [-1e-4, 1e-4] {
                let mut moved = x.clone();
                moved[k] += way;
                assert!(cost(&moved) > cost(&x));
            }
        }
    }

    #[test]
    fn a_channel_without_power_ends() {
        let found = composite(&[0.0, 1.0, 0.0, 0.0], &[0.0; 5], &[f64::MIN_POSITIVE; 5], RULE);
        assert_eq!(found.len(), 4);
    }
}
