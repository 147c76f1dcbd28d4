//! Message definitions of ULog: primitive types, fields, nesting, sizes and column names.
//!
//! A definition is kept as it was written, never expanded: `uint8_t[65000] x` stays one field until
//! somebody asks for the columns of a table that uses it. Sizes saturate, nesting is bounded.

use std::collections::HashMap;

use super::scalar::Primitive;

/// Nesting deeper than this is refused; PX4 nests once.
const MAXIMUM_DEPTH: usize = 16;
/// A record's length is a u16, so no message can be larger.
pub const MAXIMUM_SIZE: usize = u16::MAX as usize;
/// Arrays of messages with many empty fields could take long to write out although they are small.
const MAXIMUM_STEPS: usize = 4 * MAXIMUM_SIZE;

/// Type of a field: a scalar, or another definition by name.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Kind {
    Scalar(Primitive),
    Nested(Box<str>),
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Field {
    name: Box<str>,
    kind: Kind,
    /// Length of an array; a field without brackets has none.
    count: Option<u16>,
}

impl Field {
    fn parse(text: &str) -> Option<Self> {
        let (type_text, name) = text.split_once(' ')?;
        if !is_identifier(name) {
            return None;
        }
        let (base, count) = match type_text.split_once('[') {
            Some((base, rest)) => (base, Some(rest.strip_suffix(']')?.parse().ok()?)),
            None => (type_text, None),
        };
        if !is_identifier(base) {
            return None;
        }
        let kind = Primitive::parse(base).map_or_else(|| Kind::Nested(base.into()), Kind::Scalar);
        Some(Self { name: name.into(), kind, count })
    }

    fn is_padding(&self) -> bool {
        self.name.starts_with("_padding")
    }

    fn repeats(&self) -> usize {
        self.count.map_or(1, usize::from)
    }
}

fn is_identifier(text: &str) -> bool {
    const LONGEST: usize = 64;
    (1..=LONGEST).contains(&text.len())
        && text
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'/' | b'-' | b'.'))
}

/// A column of a flattened message: where its values lie in the payload.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Flattened name, for example `esc[2].rpm` or `xyz[0]`.
    pub name: String,
    /// Type of its values.
    pub primitive: Primitive,
    /// Bytes from the start of the payload, message number excluded.
    pub offset: usize,
}

/// Sizes of a message's payload and the place of its time stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Bytes without the trailing padding, which loggers leave out.
    pub least: usize,
    /// Bytes with it.
    pub most: usize,
    /// Type and offset of the field `timestamp`.
    pub stamp: Option<(Primitive, usize)>,
}

/// Bytes of a field or message, and the steps that writing out its columns would take.
#[derive(Debug, Clone, Copy)]
struct Extent {
    bytes: usize,
    steps: usize,
}

impl Extent {
    fn plus(self, other: Self) -> Option<Self> {
        Self {
            bytes: self.bytes.checked_add(other.bytes)?,
            steps: self.steps.checked_add(other.steps)?,
        }
        .bounded()
    }

    fn repeated(self, times: usize) -> Option<Self> {
        Self { bytes: self.bytes.checked_mul(times)?, steps: self.steps.checked_mul(times)? }
            .bounded()
    }

    fn bounded(self) -> Option<Self> {
        (self.bytes <= MAXIMUM_SIZE && self.steps <= MAXIMUM_STEPS).then_some(self)
    }
}

type Memory<'a> = HashMap<&'a str, Extent>;

/// All definitions of a log, by name.
#[derive(Debug, Default, Clone)]
pub struct Formats {
    by_name: HashMap<Box<str>, Vec<Field>>,
}

/// Split `name:type field;…` into its name and its fields.
fn parse_definition(text: &[u8]) -> Option<(&str, Vec<Field>)> {
    let colon = text.iter().take(65).position(|&byte| byte == b':')?;
    let name = std::str::from_utf8(text.get(..colon)?).ok()?;
    let body = std::str::from_utf8(text.get(colon + 1..)?).ok()?;
    if !is_identifier(name) {
        return None;
    }
    let fields = body
        .split(';')
        .filter(|part| !part.is_empty())
        .map(Field::parse)
        .collect::<Option<Vec<_>>>()?;
    Some((name, fields))
}

/// Tell whether a payload is a well-formed definition.
pub fn is_definition(text: &[u8]) -> bool {
    parse_definition(text).is_some()
}

/// Tell whether a payload could name a message.
pub fn is_message_name(text: &[u8]) -> bool {
    std::str::from_utf8(text).is_ok_and(is_identifier)
}

impl Formats {
    /// Keep a definition; a later one of the same name is ignored, since samples may already be
    /// read by the first. False where it is malformed.
    pub fn add(&mut self, text: &[u8]) -> bool {
        let Some((name, fields)) = parse_definition(text) else {
            return false;
        };
        self.by_name.entry(name.into()).or_insert(fields);
        true
    }

    /// Whether a definition of this name was read.
    pub fn contains(&self, name: &str) -> bool {
        self.by_name.contains_key(name)
    }

    /// Names of all definitions, sorted.
    pub fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.by_name.keys().map(|name| &**name).collect();
        names.sort_unstable();
        names
    }

    /// Sizes of a message; none where a definition is missing, circular or too large.
    pub fn shape(&self, name: &str) -> Option<Shape> {
        let fields = self.by_name.get(name)?;
        let logged = logged_fields(fields);
        let mut total = Extent { bytes: 0, steps: 0 };
        let (mut least, mut stamp) = (0, None);
        let mut memory = HashMap::new();
        for (index, field) in fields.iter().enumerate() {
            if let (Kind::Scalar(primitive), None, "timestamp") =
                (&field.kind, field.count, &*field.name)
            {
                stamp = Some((*primitive, total.bytes));
            }
            total = total.plus(self.measure(field, MAXIMUM_DEPTH, &mut memory)?)?;
            if index < logged {
                least = total.bytes;
            }
        }
        Some(Shape { least, most: total.bytes, stamp })
    }

    fn measure<'a>(
        &'a self,
        field: &'a Field,
        depth: usize,
        memory: &mut Memory<'a>,
    ) -> Option<Extent> {
        let one = match &field.kind {
            Kind::Scalar(primitive) => Extent { bytes: primitive.size(), steps: 1 },
            Kind::Nested(name) => self.measure_nested(name, depth, memory)?,
        };
        if one.bytes == 0 {
            return Some(Extent { bytes: 0, steps: 1 });
        }
        one.repeated(field.repeats())
    }

    fn measure_nested<'a>(
        &'a self,
        name: &'a str,
        depth: usize,
        memory: &mut Memory<'a>,
    ) -> Option<Extent> {
        if let Some(&extent) = memory.get(name) {
            return Some(extent);
        }
        let below = depth.checked_sub(1)?;
        let mut total = Extent { bytes: 0, steps: 1 };
        for field in self.by_name.get(name)? {
            total = total.plus(self.measure(field, below, memory)?)?;
        }
        memory.insert(name, total);
        Some(total)
    }

    /// Columns of a message in the order of its payload, padding left out.
    pub fn columns(&self, name: &str) -> Vec<Column> {
        let mut columns = Vec::new();
        if let (Some(fields), Some(_)) = (self.by_name.get(name), self.shape(name)) {
            let mut flattener = Flattener {
                formats: self,
                memory: HashMap::new(),
                offset: 0,
                columns: &mut columns,
            };
            for field in &fields[..logged_fields(fields)] {
                flattener.add(field, "", MAXIMUM_DEPTH);
            }
        }
        columns
    }
}

/// Writes the columns of one message whose extent is known to be bounded.
struct Flattener<'a> {
    formats: &'a Formats,
    memory: Memory<'a>,
    offset: usize,
    columns: &'a mut Vec<Column>,
}

impl<'a> Flattener<'a> {
    fn add(&mut self, field: &'a Field, prefix: &str, depth: usize) {
        let extent = self.formats.measure(field, depth, &mut self.memory);
        let bytes = extent.map_or(0, |extent| extent.bytes);
        if bytes == 0 || field.is_padding() {
            self.offset += bytes;
            return;
        }
        for index in 0..field.repeats() {
            let name = match field.count {
                Some(_) => format!("{prefix}{}[{index}]", field.name),
                None => format!("{prefix}{}", field.name),
            };
            match &field.kind {
                Kind::Scalar(primitive) => {
                    self.columns.push(Column { name, primitive: *primitive, offset: self.offset });
                    self.offset += primitive.size();
                }
                Kind::Nested(kind) => {
                    let inner = format!("{name}.");
                    for nested in self.formats.by_name.get(kind).into_iter().flatten() {
                        self.add(nested, &inner, depth.saturating_sub(1));
                    }
                }
            }
        }
    }
}

/// Number of fields before the trailing padding.
fn logged_fields(fields: &[Field]) -> usize {
    fields.iter().rposition(|field| !field.is_padding()).map_or(0, |last| last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formats(texts: &[&str]) -> Formats {
        let mut formats = Formats::default();
        for text in texts {
            assert!(formats.add(text.as_bytes()), "{text}");
        }
        formats
    }

    #[test]
    fn nested_arrays_flatten_with_offsets_and_padding() {
        let formats = formats(&[
            "esc:uint8_t n;uint8_t[3] _padding0;float rpm;",
            "status:uint64_t timestamp;esc[2] esc;float[2] xyz;uint8_t[4] _padding0;",
        ]);
        let shape = formats.shape("status").expect("a shape");
        assert_eq!((shape.least, shape.most), (8 + 16 + 8, 36));
        assert_eq!(shape.stamp, Some((Primitive::U64, 0)));
        let named: Vec<_> = formats
            .columns("status")
            .into_iter()
            .map(|column| (column.name, column.offset))
            .collect();
        let expected = [
            ("timestamp", 0),
            ("esc[0].n", 8),
            ("esc[0].rpm", 12),
            ("esc[1].n", 16),
            ("esc[1].rpm", 20),
            ("xyz[0]", 24),
            ("xyz[1]", 28),
        ];
        assert_eq!(named, expected.map(|(name, at)| (name.to_string(), at)));
    }

    #[test]
    fn circular_deep_missing_and_huge_definitions_have_no_shape() {
        let circular = formats(&["a:b x;", "b:a y;", "c:missing z;", "d:uint64_t[65535] w;"]);
        for name in ["a", "b", "c", "d", "e"] {
            assert_eq!(circular.shape(name), None, "{name}");
            assert!(circular.columns(name).is_empty());
        }
        // 65535^16 empty elements: counted without walking them.
        let mut texts = vec!["n0:".to_string()];
        texts.extend((1..=15).map(|i| format!("n{i}:n{}[65535] x;", i - 1)));
        let mut empty = Formats::default();
        for text in &texts {
            assert!(empty.add(text.as_bytes()));
        }
        assert_eq!(empty.shape("n15").map(|shape| shape.most), Some(0));
        assert!(empty.columns("n15").is_empty());
    }

    #[test]
    fn malformed_definitions_are_refused() {
        for text in [
            "",
            "noColon",
            "a:float",
            "a:float[ x;",
            "a:float[-1] x;",
            "a:float[70000] x;",
            "a b:float x;",
            "a:float x y;",
        ] {
            assert!(!is_definition(text.as_bytes()), "{text}");
        }
        assert!(!is_definition(&[b'a', b':', 0xff, 0xfe]));
    }
}
