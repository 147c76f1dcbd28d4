//! Tapes in the making: operations appended once each, constants folded, names and definitions
//! followed.

use std::collections::{BTreeMap, HashMap};

use crate::error::CoreError;
use crate::language::expression::Expression;
use crate::language::lookup_table::{LookupTable, Part};
use crate::language::syntax::{Binary, Node, Unary};
use crate::tape::operation::{Operation, apply_binary, apply_unary};

/// Longest chain of definitions that refer to one another.
pub const MAXIMUM_CHAIN: usize = 100;
/// Most operations on one tape.
pub const MAXIMUM_OPERATIONS: usize = 200_000;

#[derive(PartialEq, Eq, Hash)]
enum Key {
    Constant(u64),
    Input(usize),
    Unary(Unary, usize),
    Binary(Binary, usize, usize),
    Select(usize, usize, usize),
    Table(usize, Part, usize, usize),
}

/// Appends operations to a tape; equal ones share a register and constants are folded.
#[derive(Default)]
pub(crate) struct Assembler {
    pub(crate) operations: Vec<Operation>,
    seen: HashMap<Key, usize>,
}

impl Assembler {
    /// Go on after the operations of a tape.
    pub(crate) fn resume(operations: Vec<Operation>) -> Self {
        let places = operations.iter().enumerate().map(|(place, operation)| {
            let key = match *operation {
                Operation::Constant(value) => Key::Constant(value.to_bits()),
                Operation::Input(input) => Key::Input(input),
                Operation::Unary(function, a) => Key::Unary(function, a),
                Operation::Binary(function, a, b) => Key::Binary(function, a, b),
                Operation::Select(test, a, b) => Key::Select(test, a, b),
                Operation::Table(table, part, a, b) => Key::Table(table, part, a, b),
            };
            (key, place)
        });
        let seen = places.collect();
        Self { operations, seen }
    }

    pub(crate) fn input(&mut self, place: usize) -> Result<usize, CoreError> {
        self.push(Key::Input(place), Operation::Input(place))
    }

    pub(crate) fn value(&self, register: usize) -> Option<f64> {
        match self.operations[register] {
            Operation::Constant(value) => Some(value),
            _ => None,
        }
    }

    pub(crate) fn constant(&mut self, value: f64) -> Result<usize, CoreError> {
        self.push(Key::Constant(value.to_bits()), Operation::Constant(value))
    }

    pub(crate) fn unary(&mut self, function: Unary, a: usize) -> Result<usize, CoreError> {
        match self.value(a) {
            Some(value) => self.constant(apply_unary(function, value)),
            None => self.push(Key::Unary(function, a), Operation::Unary(function, a)),
        }
    }

    pub(crate) fn binary(
        &mut self,
        function: Binary,
        a: usize,
        b: usize,
    ) -> Result<usize, CoreError> {
        match (self.value(a), self.value(b)) {
            (Some(left), Some(right)) => self.constant(apply_binary(function, left, right)),
            _ => self.push(Key::Binary(function, a, b), Operation::Binary(function, a, b)),
        }
    }

    pub(crate) fn select(&mut self, test: usize, a: usize, b: usize) -> Result<usize, CoreError> {
        match self.value(test) {
            _ if a == b => Ok(a),
            Some(value) => Ok(if value == 0.0 { b } else { a }),
            None => self.push(Key::Select(test, a, b), Operation::Select(test, a, b)),
        }
    }

    pub(crate) fn table(
        &mut self,
        table: usize,
        part: Part,
        a: usize,
        b: usize,
    ) -> Result<usize, CoreError> {
        self.push(Key::Table(table, part, a, b), Operation::Table(table, part, a, b))
    }

    fn push(&mut self, key: Key, operation: Operation) -> Result<usize, CoreError> {
        if let Some(&register) = self.seen.get(&key) {
            return Ok(register);
        }
        let register = self.operations.len();
        if register >= MAXIMUM_OPERATIONS {
            let problem = format!("more than {MAXIMUM_OPERATIONS} operations in one model");
            return Err(CoreError::Expression { position: 0, problem });
        }
        self.operations.push(operation);
        self.seen.insert(key, register);
        Ok(register)
    }
}

/// Follows names and definitions.
pub(crate) struct Builder<'a> {
    pub(crate) places: HashMap<&'a str, usize>,
    pub(crate) definitions: &'a BTreeMap<String, Expression>,
    pub(crate) done: HashMap<String, usize>,
    pub(crate) open: Vec<String>,
    pub(crate) assembler: Assembler,
    pub(crate) tables: &'a BTreeMap<String, LookupTable>,
}

impl Builder<'_> {
    pub(crate) fn expression(&mut self, expression: &Expression) -> Result<usize, CoreError> {
        let mut wanted = vec![false; expression.nodes.len()];
        wanted[expression.root] = true;
        for index in (0..=expression.root).rev() {
            if wanted[index] {
                expression.nodes[index].children().into_iter().for_each(|a| wanted[a] = true);
            }
        }
        let mut registers = vec![0; expression.nodes.len()];
        for (index, node) in expression.nodes.iter().enumerate() {
            if !wanted[index] {
                continue;
            }
            registers[index] = match node {
                Node::Number(value) => self.assembler.constant(*value)?,
                Node::Name(name) => self.name(name)?,
                Node::Unary(function, a) => self.assembler.unary(*function, registers[*a])?,
                Node::Binary(function, a, b) => {
                    self.assembler.binary(*function, registers[*a], registers[*b])?
                }
                Node::Select(test, a, b) => {
                    self.assembler.select(registers[*test], registers[*a], registers[*b])?
                }
                Node::Table(name, a, b) => {
                    self.called(name, registers[*a], b.map(|place| registers[place]))?
                }
            };
        }
        Ok(registers[expression.root])
    }

    fn called(&mut self, name: &str, a: usize, b: Option<usize>) -> Result<usize, CoreError> {
        let mut tables = self.tables.iter().enumerate();
        let Some((place, (_, table))) = tables.find(|(_, (known, _))| *known == name) else {
            return Err(CoreError::UnknownName { name: name.to_string() });
        };
        let (found, needed) = (1 + usize::from(b.is_some()), table.n_axes());
        if found != needed {
            return Err(CoreError::Shape { what: "arguments of a table", found, needed });
        }
        self.assembler.table(place, Part::Value, a, b.unwrap_or(a))
    }

    fn name(&mut self, name: &str) -> Result<usize, CoreError> {
        if let Some(&place) = self.places.get(name) {
            return self.assembler.input(place);
        }
        if let Some(&register) = self.done.get(name) {
            return Ok(register);
        }
        let definitions = self.definitions;
        let Some(definition) = definitions.get(name) else {
            return Err(CoreError::UnknownName { name: name.to_string() });
        };
        if self.open.iter().any(|each| each == name) || self.open.len() >= MAXIMUM_CHAIN {
            return Err(CoreError::Circular { names: self.open.join(" → ") + " → " + name });
        }
        self.open.push(name.to_string());
        let register = self.expression(definition)?;
        self.open.pop();
        self.done.insert(name.to_string(), register);
        Ok(register)
    }
}
