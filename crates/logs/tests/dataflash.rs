//! The DataFlash reader on intact, damaged and absurd logs.

use flightid_logs::dataflash::{Dataflash, SkipReason};
use proptest::prelude::*;

/// A `FMT` message.
fn fmt(type_id: u8, name: &str, format: &str, columns: &str, size: u8) -> Vec<u8> {
    let mut message = vec![0xA3, 0x95, 128, type_id, size];
    for (text, room) in [(name, 4), (format, 16), (columns, 64)] {
        let mut field = text.as_bytes().to_vec();
        field.resize(room, 0);
        message.extend(field);
    }
    message
}

/// A message of type 10, `QHf`: stamp, number, value.
fn row(stamp_us: u64, number: u16, value: f32) -> Vec<u8> {
    let mut message = vec![0xA3, 0x95, 10];
    message.extend(stamp_us.to_le_bytes());
    message.extend(number.to_le_bytes());
    message.extend(value.to_le_bytes());
    message
}

const ROW: usize = 17;

fn head() -> Vec<u8> {
    fmt(10, "ROW", "QHf", "TimeUS,N,V", ROW as u8)
}

fn rows(numbers: std::ops::Range<u16>) -> Vec<u8> {
    numbers.flat_map(|n| row(1_000_000 + 1000 * u64::from(n), n, f32::from(n) / 2.0)).collect()
}

fn open(bytes: Vec<u8>) -> Dataflash<Vec<u8>> {
    Dataflash::open(bytes).expect("a log")
}

fn column(log: &Dataflash<Vec<u8>>, table: &str, field: &str) -> Vec<f64> {
    let table = log.table(table).expect("the table");
    let field = &table.fields()[table.position(field).expect("the field")];
    log.numbers(table, field, None)
}

fn ranges(log: &Dataflash<Vec<u8>>) -> Vec<(usize, usize, SkipReason)> {
    log.skipped().iter().map(|range| (range.start, range.stop, range.reason)).collect()
}

#[test]
fn columns_and_stamps_come_back() {
    let log = open([head(), rows(0..5)].concat());
    assert_eq!(column(&log, "ROW", "N"), [0.0, 1.0, 2.0, 3.0, 4.0]);
    assert_eq!(column(&log, "ROW", "V"), [0.0, 0.5, 1.0, 1.5, 2.0]);
    assert_eq!(column(&log, "ROW", "TimeUS"), [1.0, 1.001, 1.002, 1.003, 1.004]);
    assert!(log.skipped().is_empty());
}

#[test]
fn every_storage_is_read() {
    let format = "bBhHiIqQgfdcCeEL";
    let columns = "b,B,h,H,i,I,q,Q,g,f,d,c,C,e,E,L";
    let mut message = vec![0xA3, 0x95, 11];
    message.extend((-5i8).to_le_bytes());
    message.extend(200u8.to_le_bytes());
    message.extend((-300i16).to_le_bytes());
    message.extend(60_000u16.to_le_bytes());
    message.extend((-70_000i32).to_le_bytes());
    message.extend(4_000_000_000u32.to_le_bytes());
    message.extend((-(1i64 << 40)).to_le_bytes());
    message.extend((1u64 << 50).to_le_bytes());
    message.extend(0x3555u16.to_le_bytes());
    message.extend(0.1f32.to_le_bytes());
    message.extend(0.1f64.to_le_bytes());
    message.extend((-1234i16).to_le_bytes());
    message.extend(35_999u16.to_le_bytes());
    message.extend((-1234i32).to_le_bytes());
    message.extend(4_000_000_000u32.to_le_bytes());
    message.extend((-353_632_610i32).to_le_bytes());
    let log =
        open([fmt(11, "ALL", format, columns, message.len() as u8), message.clone()].concat());
    for (name, value) in [
        ("b", -5.0),
        ("B", 200.0),
        ("h", -300.0),
        ("H", 60_000.0),
        ("i", -70_000.0),
        ("I", 4e9),
        ("q", -1_099_511_627_776.0),
        ("Q", 1_125_899_906_842_624.0),
        ("g", 0.333_251_953_125),
        ("f", f64::from(0.1f32)),
        ("d", 0.1),
        ("c", -12.34),
        ("C", 359.99),
        ("e", -12.34),
        ("E", 40_000_000.0),
        ("L", -35.363_261),
    ] {
        assert_eq!(column(&log, "ALL", name), [value], "{name}");
    }
}

#[test]
fn texts_and_arrays_are_read() {
    let mut message = vec![0xA3, 0x95, 12];
    for (text, room) in [(&b"ab"[..], 4), (b"sixteen letters!", 16), (b"\xE9t\xE9", 64)] {
        let mut field = text.to_vec();
        field.resize(room, 0);
        message.extend(field);
    }
    (0..32i16).for_each(|n| message.extend((n - 16).to_le_bytes()));
    let log = open([fmt(12, "TXT", "nNZa", "n,N,Z,a", message.len() as u8), message].concat());
    let table = log.table("TXT").expect("the table");
    let text = |place: usize| log.texts(table, &table.fields()[place], None);
    assert_eq!((text(0), text(1)), (vec!["ab".into()], vec!["sixteen letters!".into()]));
    assert_eq!(text(2), ["été"]);
    let expected: Vec<f64> = (-16..16).map(f64::from).collect();
    assert_eq!(column(&log, "TXT", "a"), expected);
}

#[test]
fn units_multipliers_and_instances_are_applied() {
    let unit = |id: u8, label: &str| {
        let mut message = vec![0xA3, 0x95, 21, id];
        let mut label = label.as_bytes().to_vec();
        label.resize(64, 0);
        message.extend(label);
        message
    };
    let multiplier = |id: u8, value: f64| {
        let mut message = vec![0xA3, 0x95, 22, id];
        message.extend(value.to_le_bytes());
        message
    };
    let mut uses = vec![0xA3, 0x95, 23, 10];
    for ids in ["s#d", "F-B"] {
        let mut ids = ids.as_bytes().to_vec();
        ids.resize(16, 0);
        uses.extend(ids);
    }
    let log = open(
        [
            head(),
            fmt(21, "UNIT", "bZ", "Id,Label", 68),
            fmt(22, "MULT", "bd", "Id,Mult", 12),
            fmt(23, "FMTU", "BNN", "FmtType,UnitIds,MultIds", 36),
            unit(b's', "s"),
            unit(b'd', "deg"),
            unit(b'#', "instance"),
            // As logged: the single-precision neighbour of 0.01, widened.
            multiplier(b'B', f64::from(0.01f32)),
            multiplier(b'F', f64::from(1e-6f32)),
            multiplier(b'-', 0.0),
            uses,
            row(1_000_000, 1, 50.0),
            row(1_000_500, 0, 25.0),
            row(1_001_000, 1, 75.0),
        ]
        .concat(),
    );
    let table = log.table("ROW").expect("the table");
    assert_eq!(column(&log, "ROW", "V"), [0.5, 0.25, 0.75]);
    assert_eq!(table.fields()[2].unit, "deg");
    assert_eq!(log.instances(table), [0, 1]);
    assert_eq!(log.numbers(table, &table.fields()[2], Some(1)), [0.5, 0.75]);
    assert_eq!(log.rows(table, Some(7)), 0);
    let stamps = log.describe(table, &[0, 1]).expect("stamps");
    assert_eq!((stamps.first_s, stamps.last_s, stamps.interval_s), (1.0, 1.001, None));
}

#[test]
fn garbage_between_messages_is_reported_and_nothing_else_lost() {
    let (head, first, second) = (head(), rows(0..3), rows(3..6));
    let start = head.len() + first.len();
    let log = open([head, first, b"garbage \xA3\x95".to_vec(), second].concat());
    assert_eq!(column(&log, "ROW", "N"), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(ranges(&log), [(start, start + 10, SkipReason::NoHeader)]);
}

#[test]
fn a_message_cut_by_lost_bytes_does_not_swallow_the_next() {
    let mut bytes = [head(), rows(0..6)].concat();
    let cut = 89 + 2 * ROW;
    bytes.drain(cut + 8..cut + 15);
    let log = open(bytes);
    assert_eq!(column(&log, "ROW", "N"), [0.0, 1.0, 3.0, 4.0, 5.0]);
    assert_eq!(ranges(&log), [(cut, cut + 10, SkipReason::CutShort(10))]);
}

#[test]
fn a_false_header_in_garbage_is_not_believed() {
    let (head, first, second) = (head(), rows(0..3), rows(3..6));
    let start = head.len() + first.len();
    let mut garbage = vec![1u8; 100];
    garbage[40..43].copy_from_slice(&[0xA3, 0x95, 10]);
    let log = open([head, first, garbage, second].concat());
    assert_eq!(log.table("ROW").expect("the table").len(), 6);
    assert_eq!(ranges(&log), [(start, start + 100, SkipReason::NoHeader)]);
}

#[test]
fn a_lone_message_in_garbage_is_proven_by_its_stamp() {
    let lone = row(1_050_000, 99, 1.0);
    let garbage = vec![7u8; 50];
    let log = open([head(), rows(0..3), garbage.clone(), lone, garbage, rows(4..6)].concat());
    assert_eq!(column(&log, "ROW", "N"), [0.0, 1.0, 2.0, 99.0, 4.0, 5.0]);
    let reasons: Vec<SkipReason> = ranges(&log).iter().map(|range| range.2).collect();
    assert_eq!(reasons, [SkipReason::Filling(7), SkipReason::Filling(7)]);
}

#[test]
fn unknown_types_and_contradicting_definitions_are_skipped_with_their_reason() {
    let strange = [&[0xA3, 0x95, 77][..], &[5; 20]].concat();
    let log = open([head(), rows(0..2), strange, rows(2..4)].concat());
    assert_eq!(ranges(&log), [(123, 146, SkipReason::UnknownType(77))]);

    let liar = fmt(30, "LIE", "QQ", "A,B", 10);
    let message = [&[0xA3, 0x95, 30][..], &[0; 7]].concat();
    let log = open([head(), liar, rows(0..2), message, rows(2..4)].concat());
    assert_eq!(column(&log, "ROW", "N"), [0.0, 1.0, 2.0, 3.0]);
    assert_eq!(ranges(&log), [(212, 222, SkipReason::BadDefinition(30))]);
}

#[test]
fn a_layout_that_changes_makes_a_second_table() {
    let other = fmt(10, "ROW", "QhHH", "TimeUS,A,B,C", ROW as u8);
    let log = open([head(), rows(0..2), head(), rows(2..4), other, rows(0..1)].concat());
    let lengths: Vec<usize> =
        log.tables().iter().filter(|t| t.name() == "ROW").map(|t| t.len()).collect();
    assert_eq!(lengths, [4, 1]);
    assert_eq!(log.table("ROW").expect("the larger").len(), 4);
}

#[test]
fn definitions_without_end_are_not_followed() {
    let many: Vec<u8> = (0..3000u32)
        .flat_map(|n| fmt(10, "ROW", "QHf", &format!("TimeUS,N{n},V"), ROW as u8))
        .collect();
    let log = open([many, rows(0..2)].concat());
    assert!(log.tables().len() <= 1024);
    assert!(log.skipped().iter().any(|range| range.reason == SkipReason::BadDefinition(10)));
}

#[test]
fn the_end_of_a_file_is_named() {
    let whole = [head(), rows(0..3)].concat();
    let end = whole.len();
    let cases = [
        (whole[..end - 5].to_vec(), (end - ROW, end - 5, SkipReason::Truncated(10))),
        ([whole.clone(), vec![0xA3, 0x95]].concat(), (end, end + 2, SkipReason::EndsInHeader)),
        ([whole.clone(), vec![0xFF; 300]].concat(), (end, end + 300, SkipReason::Filling(0xFF))),
    ];
    for (bytes, range) in cases {
        assert_eq!(ranges(&open(bytes)), [range]);
    }
}

#[test]
fn bytes_without_a_message_are_not_a_log() {
    for bytes in [vec![], b"ULog\x01\x12\x35".to_vec(), vec![0xA3; 500], row(0, 0, 0.0)] {
        let error = Dataflash::open(bytes).map(|_| ()).expect_err("no log");
        assert!(error.to_string().starts_with("not a DataFlash log"), "{error}");
    }
}

#[test]
fn a_missing_message_is_named() {
    let error = open(head()).table("RATE").map(|_| ()).expect_err("not there");
    assert!(error.to_string().contains("no message named \"RATE\"; it holds FMT, ROW"));
}

/// Every byte is in one message or one skipped range, and every column is as long as its table.
fn is_accounted_for(bytes: &[u8]) -> bool {
    let Ok(log) = Dataflash::open(bytes) else {
        return true;
    };
    let read: usize = log.tables().iter().map(|t| t.len() * t.row_size()).sum();
    let skipped: usize = log.skipped().iter().map(|r| r.stop - r.start).sum();
    let ordered = log.skipped().windows(2).all(|pair| pair[0].stop <= pair[1].start);
    let columns_fit = log.tables().iter().all(|table| {
        log.describe(table, &log.instances(table));
        table.fields().iter().all(|field| {
            let numbers = log.numbers(table, field, None).len();
            let texts = log.texts(table, field, None).len();
            let width = field.kind.width();
            numbers == table.len() * width && texts == if width == 0 { table.len() } else { 0 }
        })
    });
    read + skipped == bytes.len() && ordered && columns_fit
}

#[test]
fn truncation_at_every_byte_loses_only_the_last_message() {
    let bytes = [head(), rows(0..8)].concat();
    for end in 89..=bytes.len() {
        let part = &bytes[..end];
        assert!(is_accounted_for(part), "cut at {end}");
        let log = open(part.to_vec());
        assert_eq!(log.tables()[1].len(), (end - 89) / ROW, "cut at {end}");
    }
}

proptest! {
    #[test]
    fn any_bytes_are_accounted_for(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
        prop_assert!(is_accounted_for(&bytes));
    }

    #[test]
    fn flipped_bytes_are_accounted_for_and_cost_little(
        flips in proptest::collection::vec((89usize..89 + 40 * ROW, any::<u8>()), 0..6)
    ) {
        let mut bytes = [head(), rows(0..40)].concat();
        for (place, value) in &flips {
            bytes[*place] = *value;
        }
        prop_assert!(is_accounted_for(&bytes));
        let kept = open(bytes).tables()[1].len();
        prop_assert!(kept + 2 * flips.len() >= 40, "{kept} rows kept after {} flips", flips.len());
    }

    #[test]
    fn absurd_definitions_are_accounted_for(
        name in "[A-Z]{0,4}",
        format in "[abBcCdeEfghHiILMnNqQZ#!]{0,16}",
        columns in "[A-Za-z,#]{0,64}",
        size in any::<u8>(),
        tail in proptest::collection::vec(any::<u8>(), 0..300),
    ) {
        let bytes = [head(), fmt(10, &name, &format, &columns, size), rows(0..20), tail].concat();
        prop_assert!(is_accounted_for(&bytes));
    }
}
