//! From text to the nodes of an expression; `expression.rs` states the grammar.

use crate::error::CoreError;
use crate::language::syntax::{Binary, MAXIMUM_DEPTH, MAXIMUM_LENGTH, MAXIMUM_NODES, Node, Unary};

/// Nodes of a text, and the place of the root.
///
/// # Errors
/// `CoreError::Expression` with the byte position of the fault.
pub(crate) fn parse(text: &str, tables: Vec<&str>) -> Result<(Vec<Node>, usize), CoreError> {
    if text.len() > MAXIMUM_LENGTH {
        return fault(MAXIMUM_LENGTH, format!("longer than {MAXIMUM_LENGTH} bytes"));
    }
    let mut parser =
        Parser { text: text.as_bytes(), position: 0, depth: 0, nodes: Vec::new(), tables };
    let root = parser.sum()?;
    parser.skip_space();
    if parser.position < text.len() {
        return parser.unexpected("an operator or the end");
    }
    Ok((parser.nodes, root))
}

fn fault<T>(position: usize, problem: String) -> Result<T, CoreError> {
    Err(CoreError::Expression { position, problem })
}

struct Parser<'a> {
    text: &'a [u8],
    position: usize,
    depth: usize,
    nodes: Vec<Node>,
    tables: Vec<&'a str>,
}

impl Parser<'_> {
    fn skip_space(&mut self) {
        while self.text.get(self.position).is_some_and(u8::is_ascii_whitespace) {
            self.position += 1;
        }
    }

    fn peek(&mut self) -> Option<u8> {
        self.skip_space();
        self.text.get(self.position).copied()
    }

    fn take(&mut self, wanted: u8) -> bool {
        let found = self.peek() == Some(wanted);
        self.position += usize::from(found);
        found
    }

    fn unexpected<T>(&mut self, needed: &str) -> Result<T, CoreError> {
        let rest = self.text.get(self.position..).unwrap_or_default();
        let found = String::from_utf8_lossy(&rest[..rest.len().min(12)]).into_owned();
        let found = if found.is_empty() { "the end".to_string() } else { format!("{found:?}") };
        fault(self.position, format!("found {found}, needed {needed}"))
    }

    fn push(&mut self, node: Node) -> Result<usize, CoreError> {
        if self.nodes.len() >= MAXIMUM_NODES {
            return fault(self.position, format!("more than {MAXIMUM_NODES} terms"));
        }
        self.nodes.push(node);
        Ok(self.nodes.len() - 1)
    }

    /// A sum, or a comparison of two.
    fn test(&mut self) -> Result<usize, CoreError> {
        let left = self.sum()?;
        let greater = match self.peek() {
            Some(b'<') => false,
            Some(b'>') => true,
            _ => return Ok(left),
        };
        self.position += 1;
        let equal = self.text.get(self.position) == Some(&b'=');
        self.position += usize::from(equal);
        let right = self.sum()?;
        let function = if equal { Binary::LessEqual } else { Binary::Less };
        let (a, b) = if greater { (right, left) } else { (left, right) };
        self.push(Node::Binary(function, a, b))
    }

    fn sum(&mut self) -> Result<usize, CoreError> {
        self.depth += 1;
        if self.depth > MAXIMUM_DEPTH {
            return fault(self.position, format!("nested deeper than {MAXIMUM_DEPTH}"));
        }
        let mut left = self.product()?;
        loop {
            let operation = match self.peek() {
                Some(b'+') => Binary::Add,
                Some(b'-') => Binary::Subtract,
                _ => break,
            };
            self.position += 1;
            let right = self.product()?;
            left = self.push(Node::Binary(operation, left, right))?;
        }
        self.depth -= 1;
        Ok(left)
    }

    fn product(&mut self) -> Result<usize, CoreError> {
        let mut left = self.unary()?;
        loop {
            let operation = match self.peek() {
                Some(b'*') => Binary::Multiply,
                Some(b'/') => Binary::Divide,
                _ => return Ok(left),
            };
            self.position += 1;
            let right = self.unary()?;
            left = self.push(Node::Binary(operation, left, right))?;
        }
    }

    fn unary(&mut self) -> Result<usize, CoreError> {
        self.depth += 1;
        if self.depth > MAXIMUM_DEPTH {
            return fault(self.position, format!("nested deeper than {MAXIMUM_DEPTH}"));
        }
        let node = if self.take(b'-') {
            let child = self.unary()?;
            self.push(Node::Unary(Unary::Negate, child))?
        } else if self.take(b'+') {
            self.unary()?
        } else {
            self.power()?
        };
        self.depth -= 1;
        Ok(node)
    }

    fn power(&mut self) -> Result<usize, CoreError> {
        let base = self.atom()?;
        let rest = {
            self.skip_space();
            self.text.get(self.position..).unwrap_or_default()
        };
        let width = match rest {
            [b'^', ..] => 1,
            [b'*', b'*', ..] => 2,
            _ => return Ok(base),
        };
        self.position += width;
        let exponent = self.unary()?;
        self.push(Node::Binary(Binary::Power, base, exponent))
    }

    fn atom(&mut self) -> Result<usize, CoreError> {
        match self.peek() {
            Some(b'(') => {
                self.position += 1;
                let inner = self.test()?;
                self.close()?;
                Ok(inner)
            }
            Some(first) if first.is_ascii_digit() || first == b'.' => self.number(),
            Some(first) if first.is_ascii_alphabetic() || first == b'_' => self.name(),
            _ => self.unexpected("a number, a name or '('"),
        }
    }

    fn close(&mut self) -> Result<(), CoreError> {
        if self.take(b')') { Ok(()) } else { self.unexpected("')'") }
    }

    fn while_matches(&mut self, test: impl Fn(u8) -> bool) {
        while self.text.get(self.position).is_some_and(|&byte| test(byte)) {
            self.position += 1;
        }
    }

    fn number(&mut self) -> Result<usize, CoreError> {
        let start = self.position;
        self.while_matches(|byte| byte.is_ascii_digit() || byte == b'.');
        if matches!(self.text.get(self.position), Some(b'e' | b'E')) {
            let mark = self.position;
            self.position += 1;
            if matches!(self.text.get(self.position), Some(b'+' | b'-')) {
                self.position += 1;
            }
            let digits = self.position;
            self.while_matches(|byte| byte.is_ascii_digit());
            if digits == self.position {
                self.position = mark;
            }
        }
        let text = String::from_utf8_lossy(&self.text[start..self.position]);
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => self.push(Node::Number(value)),
            _ => fault(start, format!("{text:?} is not a finite number")),
        }
    }

    fn name(&mut self) -> Result<usize, CoreError> {
        let start = self.position;
        self.while_matches(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        self.while_matches(|byte| byte == b'\'');
        let name = String::from_utf8_lossy(&self.text[start..self.position]).into_owned();
        if self.peek() == Some(b'(') {
            return self.call(start, &name);
        }
        if name == "pi" {
            return self.push(Node::Number(std::f64::consts::PI));
        }
        self.push(Node::Name(name))
    }

    fn call(&mut self, start: usize, name: &str) -> Result<usize, CoreError> {
        self.position += 1;
        let mut arguments = vec![self.test()?];
        while self.take(b',') {
            arguments.push(self.test()?);
        }
        self.close()?;
        match (unary(name), binary(name), arguments.as_slice()) {
            (Some(function), _, &[only]) => self.push(Node::Unary(function, only)),
            (_, Some(function), &[first, second]) => {
                self.push(Node::Binary(function, first, second))
            }
            (None, None, given) => self.written_out(start, name, given),
            (.., given) => wrong_count(start, name, given.len()),
        }
    }

    /// Functions that stand for others, and tables.
    fn written_out(
        &mut self,
        start: usize,
        name: &str,
        given: &[usize],
    ) -> Result<usize, CoreError> {
        match (name, given) {
            ("where" | "if", &[test, a, b]) => self.push(Node::Select(test, a, b)),
            ("clip", &[x, low, high]) => self.clip(x, low, high),
            ("saturation", &[x, limit]) => {
                let low = self.push(Node::Unary(Unary::Negate, limit))?;
                self.clip(x, low, limit)
            }
            ("deadband", &[x, half_width]) => {
                let low = self.push(Node::Unary(Unary::Negate, half_width))?;
                let inside = self.clip(x, low, half_width)?;
                self.push(Node::Binary(Binary::Subtract, x, inside))
            }
            ("and" | "or", &[a, b]) => {
                let (one, zero) = (self.push(Node::Number(1.0))?, self.push(Node::Number(0.0))?);
                let second = self.push(Node::Select(b, one, zero))?;
                let and = name == "and";
                self.push(Node::Select(
                    a,
                    if and { second } else { one },
                    if and { zero } else { second },
                ))
            }
            ("not", &[a]) => {
                let (one, zero) = (self.push(Node::Number(1.0))?, self.push(Node::Number(0.0))?);
                self.push(Node::Select(a, zero, one))
            }
            ("where" | "if" | "clip" | "saturation" | "deadband" | "and" | "or" | "not", _) => {
                wrong_count(start, name, given.len())
            }
            _ if !self.tables.contains(&name) => {
                fault(start, format!("{name:?} is not a function known here"))
            }
            (_, &[only]) => self.push(Node::Table(name.to_string(), only, None)),
            (_, &[first, second]) => self.push(Node::Table(name.to_string(), first, Some(second))),
            _ => wrong_count(start, name, given.len()),
        }
    }

    fn clip(&mut self, x: usize, low: usize, high: usize) -> Result<usize, CoreError> {
        let raised = self.push(Node::Binary(Binary::Maximum, x, low))?;
        self.push(Node::Binary(Binary::Minimum, raised, high))
    }
}

fn wrong_count<T>(start: usize, name: &str, count: usize) -> Result<T, CoreError> {
    fault(start, format!("{name} does not take {count} argument(s)"))
}

fn unary(name: &str) -> Option<Unary> {
    Some(match name {
        "sin" => Unary::Sin,
        "cos" => Unary::Cos,
        "tan" => Unary::Tan,
        "asin" => Unary::Asin,
        "acos" => Unary::Acos,
        "atan" => Unary::Atan,
        "sinh" => Unary::Sinh,
        "cosh" => Unary::Cosh,
        "tanh" => Unary::Tanh,
        "exp" => Unary::Exp,
        "log" => Unary::Log,
        "sqrt" => Unary::Sqrt,
        "abs" => Unary::Abs,
        "sign" => Unary::Sign,
        _ => return None,
    })
}

fn binary(name: &str) -> Option<Binary> {
    Some(match name {
        "atan2" => Binary::Atan2,
        "min" => Binary::Minimum,
        "max" => Binary::Maximum,
        _ => return None,
    })
}
