//! Numbers of recursions that have died away. (Python side: none)

/// Its square is no normal number: beside the squares of any column's other samples it is nothing, and
/// numbers that are not normal, which a recursion keeps for ever, take the processor fifty times as
/// long.
const TINY: f64 = 1e-154;

/// Leave out what has died away: what the state at the beginning does to a fast lag, after minutes.
#[inline(always)]
pub(crate) fn leave_out(values: &mut [f64]) {
    for value in values {
        *value = if value.abs() < TINY { 0.0 } else { *value };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_stays() {
        let mut values = [1.0, -1e-153, 9e-155, -5e-324, 0.0, f64::INFINITY, f64::NAN];
        leave_out(&mut values);
        assert_eq!(values[..6], [1.0, -1e-153, 0.0, 0.0, 0.0, f64::INFINITY]);
        assert!(values[6].is_nan());
    }
}
