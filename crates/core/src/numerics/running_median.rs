//! Medians of the neighbours of each sample. (Python side: `record/outlying.py`)

use super::widest::widest;

const LANES: usize = 4;

/// Median of each sample and `half` neighbours on either side; the ends go on as they are.
pub fn running_median(values: &[f64], half: usize) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else {
        return Vec::new();
    };
    // Neighbours beyond as many as there are samples would repeat the ends and no more.
    let half = half.min(values.len());
    let mut padded = vec![first; half];
    padded.extend_from_slice(values);
    padded.resize(values.len() + 2 * half, last);
    let mut found = vec![0.0; values.len()];
    widest(
        #[inline(always)]
        || match half {
            0 => found.copy_from_slice(values),
            1 => narrow::<3>(&padded, &mut found),
            2 => narrow::<5>(&padded, &mut found),
            3 => narrow::<7>(&padded, &mut found),
            4 => narrow::<9>(&padded, &mut found),
            _ => sliding(&padded, half, &mut found),
        },
    );
    found
}

/// Neighbours change places until they are in order: as many rounds as there are.
#[inline(always)]
fn narrow<const WIDTH: usize>(padded: &[f64], found: &mut [f64]) {
    let whole = found.len() / LANES * LANES;
    let (many, few) = found.split_at_mut(whole);
    for (place, out) in many.chunks_exact_mut(LANES).enumerate() {
        let from = &padded[place * LANES..place * LANES + LANES + WIDTH - 1];
        out.copy_from_slice(&middle::<WIDTH>(from));
    }
    if !few.is_empty() {
        let mut from = vec![0.0; LANES + WIDTH - 1];
        from[..padded.len() - whole].copy_from_slice(&padded[whole..]);
        few.copy_from_slice(&middle::<WIDTH>(&from)[..few.len()]);
    }
}

#[inline(always)]
fn middle<const WIDTH: usize>(from: &[f64]) -> [f64; LANES] {
    let mut sorted = [[0.0; LANES]; WIDTH];
    for (offset, lanes) in sorted.iter_mut().enumerate() {
        lanes.copy_from_slice(&from[offset..offset + LANES]);
    }
    for round in 0..WIDTH {
        let mut low = round % 2;
        while low + 1 < WIDTH {
            let (a, b) = (sorted[low], sorted[low + 1]);
            for lane in 0..LANES {
                sorted[low][lane] = if a[lane] < b[lane] { a[lane] } else { b[lane] };
                sorted[low + 1][lane] = if a[lane] < b[lane] { b[lane] } else { a[lane] };
            }
            low += 2;
        }
    }
    sorted[WIDTH / 2]
}

/// A window kept in order: one sample leaves it and one enters.
fn sliding(padded: &[f64], half: usize, found: &mut [f64]) {
    let width = 2 * half + 1;
    let mut sorted = padded[..width].to_vec();
    sorted.sort_by(f64::total_cmp);
    for (place, out) in found.iter_mut().enumerate() {
        *out = sorted[half];
        let Some(new) = padded.get(place + width) else { continue };
        let at = |value: f64, of: &[f64]| of.partition_point(|each| each.total_cmp(&value).is_lt());
        sorted.remove(at(padded[place], &sorted));
        sorted.insert(at(*new, &sorted), *new);
    }
}

#[cfg(test)]
mod tests {
    use super::running_median;

    #[test]
    fn each_is_the_middle_of_its_sorted_neighbours() {
        let mut state = 1_u64;
        let values: Vec<f64> = (0..101)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 60) as f64
            })
            .collect();
        for half in [0, 1, 3, 7, 8, 20, 1000] {
            let found = running_median(&values, half);
            for (at, median) in found.iter().enumerate() {
                let near = at as i64 - half as i64..=at as i64 + half as i64;
                let mut near: Vec<f64> = near.map(|k| values[k.clamp(0, 100) as usize]).collect();
                near.sort_by(f64::total_cmp);
                assert_eq!(*median, near[half], "half {half}, at {at}");
            }
        }
        assert!(running_median(&[], 3).is_empty());
    }
}
