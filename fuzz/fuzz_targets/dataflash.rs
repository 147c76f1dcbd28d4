//! Any bytes: no panic, every byte accounted for, every column as long as its table.
#![no_main]

use flightid_logs::dataflash::Dataflash;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(log) = Dataflash::open(data) else {
        return;
    };
    let skipped: usize = log.skipped().iter().map(|range| range.stop - range.start).sum();
    let read: usize = log.tables().iter().map(|table| table.len() * table.row_size()).sum();
    assert_eq!(read + skipped, data.len());
    for table in log.tables() {
        let instances = log.instances(table);
        log.describe(table, &instances);
        let only = instances.first().copied();
        assert!(log.rows(table, only) <= table.len());
        for field in table.fields() {
            let numbers = log.numbers(table, field, None);
            assert_eq!(numbers.len(), table.len() * field.kind.width());
            let texts = log.texts(table, field, None).len();
            assert_eq!(texts, if field.kind.width() == 0 { table.len() } else { 0 });
            log.numbers(table, field, only);
        }
    }
});
