//! ULog from a stranger: whatever the bytes are, the index is made or refused, every number it
//! gives fits the file, and intact records are kept.

mod ulog_builder;

use flightid_logs::ulog::Ulog;
use proptest::prelude::*;
use ulog_builder::{Builder, flight};

fn rows(log: &Ulog) -> usize {
    log.tables.iter().map(|table| table.offsets.len()).sum()
}

fn check(bytes: &[u8]) {
    let Ok(log) = Ulog::index(bytes) else {
        return;
    };
    let mut last = 0;
    for range in &log.skipped {
        assert!(last <= range.start && range.start < range.stop && range.stop <= bytes.len());
        last = range.stop;
    }
    for table in &log.tables {
        let names: Vec<String> =
            log.formats.columns(&table.name).into_iter().take(40).map(|c| c.name).collect();
        let columns = log.gather(bytes, &table.name, Some(table.instance), &names);
        assert!(columns.is_ok_and(|all| all.iter().all(|c| c.len() == table.offsets.len())));
    }
}

#[test]
fn truncation_at_every_byte_keeps_every_whole_sample() {
    let bytes = flight(12);
    let whole = Ulog::index(&bytes).expect("a log");
    for cut in 0..bytes.len() {
        check(&bytes[..cut]);
        if let Ok(log) = Ulog::index(&bytes[..cut]) {
            let ends = whole.tables.iter().flat_map(|table| {
                // Both messages hold 20 bytes.
                table.offsets.iter().map(|at| at + 20)
            });
            let expected = ends.filter(|&end| end <= cut).count();
            assert_eq!(rows(&log), expected, "cut at {cut}");
        }
    }
}

#[test]
fn absurd_lengths_and_counts_stay_small() {
    let mut built = Builder::new();
    built.format("a:uint64_t timestamp;");
    built.record(b'A', &[]).record(b'P', &[200]).record(b'I', &[255, 1]).record(b'M', &[1]);
    built.record(b'Q', &[]).record(b'L', &[]).record(b'C', &[1; 10]).record(b'O', &[1]);
    built.record(b'R', &[]).record(b'S', &[0; 8]).record(b'D', &[1]).record(0, &[]);
    built.format("big:uint64_t[65535] x;").format("deep:deep[2] x;").format("bad:float[99999] x;");
    built.announce("a", 0, 0).announce("big", 1, 0).announce("deep", 2, 0);
    built.sample(0, &[&1_u64.to_le_bytes()]).sample(0, &[&2_u64.to_le_bytes()]);
    built.0.extend([0xff, 0xff, b'D']);
    check(&built.0);
    let log = Ulog::index(&built.0).expect("a log");
    assert_eq!(rows(&log), 2);
}

#[test]
fn a_line_with_a_damaged_length_does_not_swallow_samples() {
    let mut line = vec![b'6'];
    line.extend(5_u64.to_le_bytes());
    line.extend(b"armed");
    let mut built = Builder(flight(4));
    let at = built.0.len();
    built.record(b'L', &line);
    built.0.extend(&flight(60)[flight(0).len()..]);
    let intact = rows(&Ulog::index(&built.0).expect("a log"));
    built.0[at + 1] = 4;
    assert_eq!(rows(&Ulog::index(&built.0).expect("a log")), intact);
}

#[test]
fn the_crate_px4_ulog_agrees_on_an_intact_log() {
    use px4_ulog::stream_parser::LogParser;
    use px4_ulog::stream_parser::model::DataMessage;
    let bytes = flight(40);
    let mut theirs = 0;
    let mut count = |_: &DataMessage| theirs += 1;
    let mut parser = LogParser::default();
    parser.set_data_message_callback(&mut count);
    assert!(parser.consume_bytes(&bytes).is_ok());
    let ours = Ulog::index(&bytes).expect("a log");
    assert_eq!(rows(&ours), theirs);
    assert!(ours.skipped.is_empty());
}

#[test]
fn the_crate_px4_ulog_panics_where_this_reader_goes_on() {
    // The reason for a walk of our own: see the head of `ulog/mod.rs`.
    use px4_ulog::stream_parser::LogParser;
    let mut built = Builder::new();
    built.format("a:uint64_t timestamp;").record(b'P', &[200, b'x']);
    built.announce("a", 0, 0).sample(0, &[&1_u64.to_le_bytes()]);
    let bytes = built.0;
    let copy = bytes.clone();
    let theirs = std::panic::catch_unwind(move || {
        LogParser::default().consume_bytes(&copy).map_err(|_| "an error")
    });
    assert!(theirs.is_err(), "px4-ulog no longer panics: judge again whether to build on it");
    assert_eq!(rows(&Ulog::index(&bytes).expect("a log")), 1);
}

/// Samples of a flight, message number excluded: every one is 25 bytes with head and number.
fn samples(log: &Ulog) -> impl Iterator<Item = (usize, usize)> {
    let tables = log.tables.iter().enumerate();
    tables.flat_map(|(index, table)| table.offsets.iter().map(move |at| (index, at)))
}

/// The bytes from the first sample on.
fn flight_data(bytes: &[u8]) -> std::ops::Range<usize> {
    let whole = Ulog::index(bytes).expect("a log");
    let first = samples(&whole).map(|(_, at)| at - 5).min().expect("samples");
    first..bytes.len()
}

/// Overwrite bytes `at` behind the start of the samples; returns the samples that were lost and
/// need not be. Of those that the hit did not touch only one may go: the last before a hit that
/// starts in the head or number of the record behind it. ULog has no checksum, so where that
/// record cannot be recognised, nothing tells an intact sample from one whose end was hit too.
fn lost_to_hit(at: usize, fill: &[u8]) -> Vec<usize> {
    let intact = flight(60);
    let whole = Ulog::index(&intact).expect("a log");
    let start = flight_data(&intact).start + at;
    let stop = (start + fill.len()).min(intact.len());
    let mut bytes = intact;
    bytes[start..stop].copy_from_slice(&fill[..stop - start]);
    let log = Ulog::index(&bytes).expect("a log");
    let kept: std::collections::HashSet<_> = samples(&log).collect();
    samples(&whole)
        .filter(|sample| {
            let (from, to) = (sample.1 - 5, sample.1 + 20);
            (to + 5 <= start || from >= stop) && !kept.contains(sample)
        })
        .map(|(_, at)| at)
        .collect()
}

#[test]
fn a_damaged_length_does_not_cost_the_next_sample() {
    // `gyro` has four bytes of padding that may be left out, so lengths 22 to 26 all fit: such a
    // sample bites into the next record. Over `power` the last bytes of 26 look like a record that
    // is cut by the end of the file.
    let whole = Ulog::index(&flight(60)).expect("a log");
    let data = flight_data(&flight(60)).start;
    for (length, (_, sample)) in
        (22..=34).flat_map(|length| samples(&whole).map(move |s| (length, s)))
    {
        let at = sample - 5 - data;
        assert_eq!(lost_to_hit(at, &[length]), [], "{length} at {at}");
        let hit = [&[0; 48][..], &[length]].concat();
        assert_eq!(lost_to_hit(at.saturating_sub(48), &hit), [], "48 zeros, {length} at {at}");
    }
}

#[test]
fn a_hit_across_a_head_costs_what_it_covers() {
    for at in 0..flight_data(&flight(60)).len() {
        assert_eq!(lost_to_hit(at, &[0, 0, 0, 46, 10]), [], "at {at}");
    }
}

proptest! {
    #[test]
    fn any_bytes_behind_a_header(tail in proptest::collection::vec(any::<u8>(), 0..600)) {
        check(&[&flight(0)[..16], &tail].concat());
        check(&[flight(2), tail].concat());
    }

    #[test]
    fn flipped_bytes(flips in proptest::collection::vec((any::<prop::sample::Index>(), 1_u8..), 1..12)) {
        let mut bytes = flight(20);
        for (at, change) in flips {
            let at = at.index(bytes.len());
            bytes[at] ^= change;
        }
        check(&bytes);
    }

    #[test]
    fn one_hit_costs_what_it_covers(at in any::<prop::sample::Index>(), fill in proptest::collection::vec(any::<u8>(), 1..300)) {
        let lost = lost_to_hit(at.index(flight_data(&flight(60)).len()), &fill);
        prop_assert_eq!(lost, Vec::<usize>::new());
    }
}
