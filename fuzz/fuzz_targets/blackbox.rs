//! Blackbox logs from a stranger: every flight is decoded, every column is as long as its table.
#![no_main]

use flightid_logs::blackbox::{Blackbox, flights};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    for (start, stop) in flights(data) {
        let Ok(log) = Blackbox::decode(&data[start..stop], 1 << 24) else {
            continue;
        };
        for table in [&log.main, &log.slow, &log.gps] {
            let rows = table.stamps_us.len();
            for place in 0..table.names.len() {
                assert!(table.numbers(place).is_some_and(|values| values.len() == rows));
            }
        }
        assert!(log.skipped.iter().all(|part| part.start < part.stop && part.stop <= stop - start));
    }
});
