//! Spans in which no message of any kind is stamped.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use super::log_index::Dataflash;
use super::message_table::Table;

/// A stamp as a key.
#[derive(Clone, Copy)]
struct Key(f64);

impl Ord for Key {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}
impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Eq for Key {}
impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<B: AsRef<[u8]>> Dataflash<B> {
    /// Stamps before and after each silence of all messages together that is longer than a limit, s,
    /// in rising order. Stamps cut the spans that are still silent one by one, in any order, those
    /// of the most numerous message first, so that few spans are held.
    pub fn silences(&self, longest_s: f64) -> Vec<(f64, f64)> {
        let mut silent = BTreeMap::from([(Key(f64::NEG_INFINITY), f64::INFINITY)]);
        let mut tables: Vec<&Table> = self.tables().iter().collect();
        tables.sort_by_key(|table| std::cmp::Reverse(table.len()));
        for table in tables {
            let Some(field) = table.layout.stamp() else {
                continue;
            };
            let mut stamps = Vec::new();
            self.each_block(table, None, |block| {
                stamps.clear();
                self.append(&mut stamps, block, field);
                for &stamp in &stamps {
                    cut(&mut silent, stamp, longest_s);
                }
            });
        }
        let ends = silent.into_iter().map(|(start, stop)| (start.0, stop));
        ends.filter(|(start, stop)| start.is_finite() && stop.is_finite()).collect()
    }
}

/// Cut the silent span around a stamp, if it lies in one; short rests are none.
fn cut(silent: &mut BTreeMap<Key, f64>, stamp: f64, longest_s: f64) {
    let before = silent.range(..Key(stamp)).next_back();
    // What is no number lies in no span.
    let Some((&start, &stop)) = before.filter(|(_, stop)| stamp < **stop) else {
        return;
    };
    if stamp - start.0 > longest_s {
        silent.insert(start, stamp);
    } else {
        silent.remove(&start);
    }
    if stop - stamp > longest_s {
        silent.insert(Key(stamp), stop);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::{Key, cut};

    #[test]
    fn spans_are_those_between_sorted_stamps() {
        let stamps = [5.0, 1.0, 1.3, f64::NAN, 9.0, 1.1, 5.1, 5.15, 1.0, 0.0];
        let mut silent = BTreeMap::from([(Key(f64::NEG_INFINITY), f64::INFINITY)]);
        for stamp in stamps {
            cut(&mut silent, stamp, 0.2);
        }
        let found: Vec<(f64, f64)> = silent.into_iter().map(|(key, stop)| (key.0, stop)).collect();
        let inner = [(0.0, 1.0), (1.3, 5.0), (5.15, 9.0)];
        assert_eq!(found[1..found.len() - 1], inner);
        assert_eq!((found[0].1, found[found.len() - 1].0), (0.0, 9.0));
    }
}
