//! The smaller log formats from a stranger: blackbox, telemetry, text logs; every column is read.
#![no_main]

use std::collections::HashMap;

use flightid_logs::blackbox::{Blackbox, flights};
use flightid_logs::dataflash::printed;
use flightid_logs::mavlink;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    for (start, stop) in flights(data) {
        let Ok(log) = Blackbox::decode(&data[start..stop]) else {
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
    let known = HashMap::from([(0, (9, 50)), (30, (28, 39))]);
    let heard = mavlink::read(data, &known);
    for ((message, ..), frames) in &heard.frames {
        assert_eq!(frames.payloads.len(), frames.stamps_us.len() * known[message].0);
    }
    let _ = mavlink::is_telemetry(data);
    let made = printed::to_binary(data);
    assert!(made.bytes.len() <= 16 * data.len() + 89);
});
