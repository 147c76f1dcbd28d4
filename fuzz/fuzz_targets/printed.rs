//! Text logs from a stranger: what is made of them is no larger than said, and is a binary log.
#![no_main]

use flightid_logs::dataflash::{Dataflash, printed};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(made) = printed::to_binary(data, 1 << 24) else {
        return;
    };
    assert!(made.bytes.len() <= 16 * data.len() + 89);
    if let Ok(log) = Dataflash::open(made.bytes.as_slice()) {
        for table in log.tables() {
            for field in table.fields() {
                let _ = (log.numbers(table, field, None), log.texts(table, field, None));
            }
        }
    }
});
