//! Face of `flightid_core::language::expression` and `tape`. (Python side: formula.py)

use std::collections::BTreeMap;

use flightid_core::language::expression::Expression;
use flightid_core::language::syntax::Node;
use flightid_core::tape::expression_tape::{Registers, Tape as CoreTape};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::models::lookup_table::{LookupTable, shared};
use crate::row_major::RowMajor1;

/// expression_names(text: str, tables: Sequence[str] = ...) -> list[str]
///
/// Names that occur in a formula, in order of first occurrence; it may call the tables named.
#[pyfunction]
#[pyo3(signature = (text, tables = vec![]))]
fn expression_names(text: &str, tables: Vec<String>) -> PyResult<Vec<String>> {
    let expression = Expression::parse_with(text, &tables).map_err(from_core)?;
    Ok(expression.names().into_iter().map(String::from).collect())
}

type Printed = (String, String, f64, Vec<usize>);

/// expression_nodes(text: str, tables: Sequence[str] = ...) -> list[tuple[str, str, float, list[int]]]
///
/// Parsed formula: kind ("number", "name", "select", "table" or the function), name, number and the
/// places of the arguments; arguments stand before what uses them and the last node is the whole
/// formula.
#[pyfunction]
#[pyo3(signature = (text, tables = vec![]))]
fn expression_nodes(text: &str, tables: Vec<String>) -> PyResult<Vec<Printed>> {
    let expression = Expression::parse_with(text, &tables).map_err(from_core)?;
    let function = |kind: &dyn std::fmt::Debug| format!("{kind:?}").to_lowercase();
    let nodes = expression.nodes.into_iter().take(expression.root + 1);
    Ok(nodes
        .map(|node| {
            let places = node.children();
            match node {
                Node::Number(value) => ("number".into(), String::new(), value, places),
                Node::Name(name) => ("name".into(), name, 0.0, places),
                Node::Unary(kind, _) => (function(&kind), String::new(), 0.0, places),
                Node::Binary(kind, ..) => (function(&kind), String::new(), 0.0, places),
                Node::Select(..) => ("select".into(), String::new(), 0.0, places),
                Node::Table(name, ..) => ("table".into(), name, 0.0, places),
            }
        })
        .collect())
}

/// __init__(self, expressions: Sequence[str], names: Sequence[str], definitions: dict[str, str], tables: dict[str, LookupTable] = ...) -> None
///
/// Formulas of the same names, compiled once.
#[pyclass(frozen, module = "flightid._native")]
struct Tape {
    tape: CoreTape,
}

#[pymethods]
impl Tape {
    #[new]
    #[pyo3(signature = (expressions, names, definitions, tables = BTreeMap::new()))]
    fn new(
        expressions: Vec<String>,
        names: Vec<String>,
        definitions: BTreeMap<String, String>,
        tables: BTreeMap<String, Py<LookupTable>>,
    ) -> PyResult<Self> {
        let tables = shared(tables);
        let callable: Vec<&String> = tables.keys().collect();
        let parse = |text: &String| Expression::parse_with(text, &callable).map_err(from_core);
        let expressions = expressions.iter().map(parse).collect::<PyResult<Vec<_>>>()?;
        let definitions = definitions
            .iter()
            .map(|(name, text)| Ok((name.clone(), parse(text)?)))
            .collect::<PyResult<_>>()?;
        let tape = CoreTape::compile_with(&expressions, &names, &definitions, &tables)
            .map_err(from_core)?;
        Ok(Self { tape })
    }

    /// evaluate(self, values: NDArray[np.float64]) -> NDArray[np.float64]
    ///
    /// Value of each formula.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mut result = vec![0.0; self.tape.n_outputs()];
        self.tape
            .evaluate(values.as_slice()?, &mut Registers::default(), &mut result)
            .map_err(from_core)?;
        Ok(result.into_pyarray(py))
    }

    /// jacobian(self, values: NDArray[np.float64], directions: Sequence[int]) -> NDArray[np.float64]
    ///
    /// Exact derivatives, shape (n_expressions, n_directions).
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        directions: Vec<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let values = values.as_slice()?;
        let (n, m) = (self.tape.n_outputs(), directions.len());
        if let Some(&found) = directions.iter().find(|&&index| index >= values.len()) {
            let needed = values.len();
            let what = "index of a direction";
            return Err(from_core(flightid_core::CoreError::Shape { what, found, needed }));
        }
        let (mut result, mut jacobian) = (vec![0.0; n], vec![0.0; n * m]);
        let registers = &mut Registers::default();
        self.tape
            .jacobian(values, &directions, registers, &mut result, &mut jacobian)
            .map_err(from_core)?;
        jacobian.into_pyarray(py).reshape([n, m])
    }
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(expression_names, module)?)?;
    module.add_function(wrap_pyfunction!(expression_nodes, module)?)?;
    module.add_class::<Tape>()
}
