//! ULog from a stranger: index the bytes and read every column of every table.
#![no_main]

use flightid_logs::ulog::Ulog;
use libfuzzer_sys::fuzz_target;

/// Magic, version and start, so that not every run has to find them.
const HEADER: [u8; 16] = *b"ULog\x01\x12\x35\x01\x00\x00\x00\x00\x00\x00\x00\x00";

fuzz_target!(|data: &[u8]| {
    let bytes = [&HEADER, data].concat();
    let Ok(log) = Ulog::index(&bytes) else {
        return;
    };
    let mut last = 0;
    for range in &log.skipped {
        assert!(last <= range.start && range.start < range.stop && range.stop <= bytes.len());
        last = range.stop;
    }
    for table in &log.tables {
        let columns = log.formats.columns(&table.name);
        let names: Vec<String> =
            columns.into_iter().take(64).map(|column| column.name).collect();
        let values = log.gather(&bytes, &table.name, Some(table.instance), &names);
        assert!(values.is_ok_and(|values| values.iter().all(|v| v.len() == table.offsets.len())));
    }
});
