//! Equations and outputs of a model at every sample of a record, with derivatives along chosen
//! directions. (Python side: identification/regression/sampled_equations.py)

use crate::error::CoreError;
use crate::state_space::model_tape::ModelTape;
use crate::tape::expression_tape::Registers;

/// Values and derivatives at all samples, time first.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    /// Residuals (left − right side) and outputs, n_samples × (n_states + n_outputs).
    pub values: Vec<f64>,
    /// Their derivatives, n_samples × (n_states + n_outputs) × n_directions.
    pub slopes: Vec<f64>,
}

/// Evaluate a model at `points`, n_samples × (2 n_states + n_inputs): ẋ, x, u of each sample.
/// Directions are places in the joined list of a point and the parameters.
///
/// # Errors
/// `Shape` for lengths or directions that do not fit, `NotFinite` where a value or derivative has
/// no meaning at a sample (`index` is the sample).
pub fn sample(
    model: &ModelTape,
    points: &[f64],
    parameters: &[f64],
    directions: &[usize],
) -> Result<Sampled, CoreError> {
    let (width, height) = (model.width(), model.height());
    let tape = model.tape();
    let needed = tape.n_inputs();
    if parameters.len() != model.n_parameters() {
        let (found, needed) = (parameters.len(), model.n_parameters());
        return Err(CoreError::Shape { what: "parameter values", found, needed });
    }
    if !points.len().is_multiple_of(width) {
        let (found, needed) = (points.len(), width);
        return Err(CoreError::Shape { what: "entries of the points", found, needed });
    }
    if let Some(&found) = directions.iter().find(|&&place| place >= needed) {
        return Err(CoreError::Shape { what: "direction of a derivative", found, needed });
    }
    let n = directions.len();
    let count = points.len() / width.max(1);
    let mut values = Vec::with_capacity(count * height);
    let mut slopes = Vec::with_capacity(count * height * n);
    let mut registers = Registers::default();
    let mut joined = [vec![0.0; width], parameters.to_vec()].concat();
    let mut each = vec![0.0; tape.n_outputs()];
    let mut gradient = vec![0.0; tape.n_outputs() * n];
    for (index, point) in points.chunks_exact(width.max(1)).enumerate() {
        joined[..width].copy_from_slice(point);
        tape.jacobian(&joined, directions, &mut registers, &mut each, &mut gradient)
            .map_err(|_| CoreError::NotFinite { what: "a sample of the equations", index })?;
        values.extend_from_slice(&each[..height]);
        slopes.extend_from_slice(&gradient[..height * n]);
    }
    Ok(Sampled { values, slopes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state_space::model_tape::tests::text;

    fn example() -> ModelTape {
        let equations = [("x'", "v"), ("m*v' + c*x'", "-k*x - twice*v + f/m")];
        ModelTape::new(&text(&equations, &["v' - k*x", "x + c*f"])).unwrap()
    }

    #[test]
    fn each_sample_has_the_values_of_its_own_point() {
        let model = example();
        let (m, c, k) = (2.0, 0.3, 5.0);
        let points = [[1.0, 2.0, 3.0, 4.0, 5.0], [-1.0, 0.5, 0.0, 2.0, 1.0]];
        let found = sample(&model, points.as_flattened(), &[m, c, k, 0.01], &[5, 1]).unwrap();
        for (place, [dx, dv, x, v, f]) in points.into_iter().enumerate() {
            let second = m * dv + c * dx + k * x + 2.0 * c * m * v - f / m;
            let values = &found.values[4 * place..4 * place + 4];
            for (value, wanted) in values.iter().zip([dx - v, second, dv - k * x, x + c * f]) {
                assert!((value - wanted).abs() < 1e-12, "{value} {wanted}");
            }
            // By the mass and by v'.
            let row = &found.slopes[8 * place + 2..8 * place + 4];
            assert!((row[0] - (dv + 2.0 * c * v + f / (m * m))).abs() < 1e-12, "{}", row[0]);
            assert!((row[1] - m).abs() < 1e-12);
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let model = example();
        let values = [2.0, 0.3, 5.0, 0.01];
        assert!(matches!(sample(&model, &[0.0; 4], &values, &[]), Err(CoreError::Shape { .. })));
        assert!(matches!(sample(&model, &[0.0; 5], &[1.0], &[]), Err(CoreError::Shape { .. })));
        assert!(matches!(sample(&model, &[0.0; 5], &values, &[9]), Err(CoreError::Shape { .. })));
        let points = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0];
        let found = sample(&model, &points, &values, &[]);
        assert!(matches!(found, Err(CoreError::NotFinite { index: 1, .. })));
    }
}
