//! A small writer of ULog bytes for tests.

/// Bytes of a log that grow record by record.
pub struct Builder(pub Vec<u8>);

impl Builder {
    /// Header and flag record.
    pub fn new() -> Self {
        let mut bytes = b"ULog\x01\x12\x35\x01".to_vec();
        bytes.extend(1_000_u64.to_le_bytes());
        let mut built = Self(bytes);
        built.record(b'B', &[0; 40]);
        built
    }

    pub fn record(&mut self, kind: u8, payload: &[u8]) -> &mut Self {
        let length = u16::try_from(payload.len()).expect("a payload below 64 kB");
        self.0.extend(length.to_le_bytes());
        self.0.push(kind);
        self.0.extend(payload);
        self
    }

    pub fn format(&mut self, text: &str) -> &mut Self {
        self.record(b'F', text.as_bytes())
    }

    pub fn announce(&mut self, name: &str, number: u16, instance: u8) -> &mut Self {
        let mut payload = vec![instance];
        payload.extend(number.to_le_bytes());
        payload.extend(name.as_bytes());
        self.record(b'A', &payload)
    }

    pub fn sample(&mut self, number: u16, fields: &[&[u8]]) -> &mut Self {
        let mut payload = number.to_le_bytes().to_vec();
        fields.iter().for_each(|field| payload.extend(*field));
        self.record(b'D', &payload)
    }

    pub fn parameter(&mut self, name: &str, value: f32) -> &mut Self {
        let key = format!("float {name}");
        let mut payload = vec![u8::try_from(key.len()).expect("a short key")];
        payload.extend(key.as_bytes());
        payload.extend(value.to_le_bytes());
        self.record(b'P', &payload)
    }

    pub fn dropout(&mut self, length_ms: u16) -> &mut Self {
        self.record(b'O', &length_ms.to_le_bytes())
    }
}

/// Two instances of a rate and a nested message, `samples` of each.
pub fn flight(samples: u16) -> Vec<u8> {
    let mut built = Builder::new();
    built.format("esc:uint16_t rpm;float volt;");
    built.format("power:uint64_t timestamp;esc[2] esc;");
    built.format("gyro:uint64_t timestamp;float[3] xyz;uint8_t[4] _padding0;");
    built.parameter("MC_ROLL_P", 6.5);
    built.announce("gyro", 7, 0).announce("gyro", 8, 1).announce("power", 9, 0);
    for index in 0..samples {
        let stamp = (10_000 + 4_000 * u64::from(index)).to_le_bytes();
        let value = f32::from(index).to_le_bytes();
        built.sample(7, &[&stamp, &value, &value, &value]);
        built.sample(8, &[&stamp, &value, &[0; 8]]);
        let rpm = index.to_le_bytes();
        built.sample(9, &[&stamp, &rpm, &value, &rpm, &value]);
        if index % 8 == 3 {
            built.dropout(12);
        }
    }
    built.0
}
