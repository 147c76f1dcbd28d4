//! The exponential function of negative numbers, in vector registers and with the same bits on all
//! machines, which those of system libraries have not. (Python side: none)
//!
//! Reference: Muller, *Elementary Functions*, 3rd ed., sections 10.3 and 11.1 (reduction by two parts of
//! ln 2, scaling by exponent bits).

/// Beyond this the result is below the normal numbers, and zero.
const FARTHEST: f64 = 708.0;
/// Added to a small number it leaves the nearest whole number in the last bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts, the first with few digits so that its multiples are exact.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
/// 1/k!, from the highest that counts down.
const TAYLOR: [f64; 14] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// exp(−x) of x ≥ 0, to two units in the last place; zero where that is below 3.3e-308.
#[inline(always)]
pub fn decay(x: f64) -> f64 {
    let shifted = ROUNDER - x * std::f64::consts::LOG2_E;
    let halvings = shifted - ROUNDER;
    let rest = -x - halvings * LN_2[0] - halvings * LN_2[1];
    let mut sum = TAYLOR[0];
    for coefficient in &TAYLOR[1..] {
        sum = sum * rest + coefficient;
    }
    let exponent = shifted.to_bits().wrapping_sub(ROUNDER.to_bits()).wrapping_add(1023);
    if x <= FARTHEST { sum * f64::from_bits(exponent << 52) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2048))]
        #[test]
        fn agrees_with_the_library_to_two_units(x in 0.0_f64..708.0, small in 1e-12_f64..2.0) {
            for each in [x, small] {
                let exact = (-each).exp();
                prop_assert!((decay(each) / exact - 1.0).abs() <= 4.5e-16, "{each}");
            }
        }

        #[test]
        fn sums_become_products(a in 0.0_f64..300.0, b in 0.0_f64..300.0) {
            // The sum of a and b is itself rounded, by up to half a unit of 600.
            let error = decay(a + b) / (decay(a) * decay(b)) - 1.0;
            prop_assert!(error.abs() <= 1e-13);
        }
    }

    #[test]
    fn ends_of_the_range() {
        assert_eq!(decay(0.0), 1.0);
        assert_eq!(decay(f64::MIN_POSITIVE), 1.0);
        assert!((decay(1.0) - 0.367_879_441_171_442_33).abs() < 1e-16);
        assert!(decay(708.0) > 3.3e-308 && decay(708.1) == 0.0);
        assert_eq!(decay(f64::INFINITY), 0.0);
    }
}
