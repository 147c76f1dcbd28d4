//! What a field is taken to be before its difference is read.

/// How a field is predicted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Predictor {
    /// Nothing is predicted.
    Zero,
    /// As before.
    Previous,
    /// On the line through the two before.
    StraightLine,
    /// The mean of the two before.
    Average,
    /// A number of the header: least throttle, 1500, reference voltage, least motor command.
    Constant(i64),
    /// The first motor of this frame.
    FirstMotor,
    /// One more than before, and those frames that were left out on purpose.
    Increment,
    /// A coordinate of home.
    Home(usize),
    /// Stamp of the last main frame.
    LastTime,
}

/// Frames and counts that predictions need.
#[derive(Debug, Clone, Copy)]
pub struct Known<'a> {
    /// Values of this frame so far, and those of the two before.
    pub frames: [&'a [i64]; 3],
    /// Frames left out on purpose since the last.
    pub skipped: i64,
    /// Place of the first motor.
    pub first_motor: Option<usize>,
    /// Position of home.
    pub home: &'a [i64],
    /// Stamp of the last main frame, µs.
    pub last_us: i64,
}

impl Predictor {
    /// The prediction of a field.
    pub fn value(self, place: usize, known: &Known) -> i64 {
        let [current, previous, older] = known.frames;
        let at = |frame: &[i64]| frame.get(place).copied().unwrap_or(0);
        match self {
            Self::Zero => 0,
            Self::Previous => at(previous),
            Self::StraightLine => 2 * at(previous) - at(older),
            Self::Average => (at(previous) + at(older)) / 2,
            Self::Constant(value) => value,
            Self::FirstMotor => {
                known.first_motor.and_then(|motor| current.get(motor)).copied().unwrap_or(0)
            }
            Self::Increment => at(previous) + 1 + known.skipped,
            Self::Home(axis) => known.home.get(axis).copied().unwrap_or(0),
            Self::LastTime => known.last_us,
        }
    }
}
