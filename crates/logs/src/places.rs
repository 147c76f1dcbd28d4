//! Where the rows of a message lie in a file, in two bytes a row.

/// Mark of a step that two bytes do not hold.
const WIDE: u16 = u16::MAX;

/// Rising places, held as the steps between them.
#[derive(Debug, Clone, Default)]
pub struct Places {
    steps: Vec<u16>,
    /// The steps that are marked, in order.
    wide: Vec<usize>,
    last: usize,
}

impl Places {
    /// Add a place; none lies before the last one.
    #[inline]
    pub fn push(&mut self, place: usize) {
        let step = place - self.last;
        if step < usize::from(WIDE) {
            self.steps.push(step as u16);
        } else {
            self.steps.push(WIDE);
            self.wide.push(step);
        }
        self.last = place;
    }

    /// Take the last place back.
    pub fn pop(&mut self) {
        self.last -= match self.steps.pop() {
            Some(WIDE) => self.wide.pop().unwrap_or_default(),
            Some(step) => usize::from(step),
            None => 0,
        };
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// All places, in order.
    pub fn iter(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        let mut wide = self.wide.iter();
        self.steps.iter().scan(0, move |at, &step| {
            *at += if step == WIDE { *wide.next()? } else { usize::from(step) };
            Some(*at)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Places;

    #[test]
    fn near_and_far_places_come_back() {
        let all = [0, 3, 65_537, 65_540, 131_075, 196_609, 1 << 40, (1 << 40) + 9];
        let mut places = Places::default();
        for (count, place) in all.into_iter().enumerate() {
            places.push(place);
            places.push(place + 70_000);
            places.pop();
            assert_eq!(places.iter().collect::<Vec<_>>(), all[..=count]);
        }
        for count in (0..all.len()).rev() {
            places.pop();
            assert_eq!((places.len(), places.is_empty()), (count, count == 0));
            assert_eq!(places.iter().collect::<Vec<_>>(), all[..count]);
        }
        places.pop();
        assert!(places.is_empty());
    }
}
